// Expansion: gives lines and points corners on the screen. Their triangles are then faces as all others.
//
//   expand_lines    a line segment a work-item: cuts it, and writes the corners around it
//   expand_points   a point a work-item: writes the corners of its outline
//
// It runs behind project_vertices, and writes the vertices behind those of the scene (clpeel/stages/outlines.py). What is
// drawn has outcode 0: it is cut already. What is not has one outcode at all of its corners.
//
// Without joints an end of a line has two corners, left and right of it, half a width away. With joints it has five:
//
//     left ----------- left ___             0, 1   left and right: straight across at the outer side of a joint, and on
//       |                |     \ tip               the line between both segments at its inner side
//     end -------------- end                2      the end itself
//       |               /                   3, 4   straight across at the outer side, and the tip of the mitre
//     right ------- right
//
// Two segments share the corners on the line between them to the bit. So joints have no gaps, and no pixel is covered
// twice. Corners 0, 1 and 2 of both ends lie in one plane, so depth is that of the nearest place on the segment. Around the
// tip that is the end. Where segments are so short that the inner corner would lie beyond their middle, it is moved
// towards the end.
#undef WIDE
#define WIDE 1
#include "stages/planes.h"

// Lines are cut at a band that leaves room for their width up to the guard band: a mitre's tip is MITRE_LIMIT halves of a
// width away from its joint.
#define CUT_BAND (GUARD_BAND / 4 * 3)
#define MOST_HALF (MOST_WIDTH / 2 * SUBPIXELS)
#define MITRE_LIMIT 4.0f

// A place on the screen: subpixels from the image's centre, and depth.
typedef struct { Pair x, y; float depth; } Place;

// The way from one place to another: its direction, of length 1, and how long it is. Ways, widths and joints are counted in
// subpixels of a pixel's height. `across` times as many make the same length across, where samples lie closer together.
typedef struct { float x, y, length; } Way;

INLINE void place_of(const ClipVertex *v, Place *place)
{
    Pair depth;
    pair_div(&v->x, &v->w, &place->x);
    pair_div(&v->y, &v->w, &place->y);
    pair_div(&v->z, &v->w, &depth);
    place->depth = depth.hi;
}

// The way to a point that may lie behind the eye; then it has no end. Returns whether there is a way.
INLINE bool way_to(const Place *from, const ClipVertex *to, float across, Way *way)
{
    Pair x, y;
    pair_mul(&from->x, &to->w, &x);
    pair_sub(&to->x, &x, &x);
    pair_mul(&from->y, &to->w, &y);
    pair_sub(&to->y, &y, &y);
    float level = x.hi / across, most = MAX(fabs(level), fabs(y.hi));
    if (!(most > 0.0f) || !IS_FINITE(most)) return false;
    float right = level / most, down = y.hi / most, length = sqrt(right * right + down * down);
    way->x = right / length, way->y = down / length;
    way->length = to->w.hi > 0.0f ? most * length / to->w.hi : MAXFLOAT;
    return true;
}

INLINE bool is_less(const Pair *a, const Pair *b) { return a->hi < b->hi || (a->hi == b->hi && a->lo < b->lo); }

// What is left of a segment between the planes: its ends, and their places along it, 0 .. 1. cut: whether planes made
// them.
typedef struct { ClipVertex end[2]; float place[2]; bool cut[2]; } Segment;

// Cuts a segment (Liang and Barsky). Returns whether anything is left.
static bool cut_segment(const ClipVertex *a, const ClipVertex *b, DepthRange depth, Segment *segment)
{
    Pair from = {0.0f, 0.0f}, to = {1.0f, 0.0f};
    int from_plane = -1, to_plane = -1;
    for (int plane = 0; plane < 6; ++plane) {
        Pair da, db, t;
        plane_distance(plane, a, depth, CUT_BAND, &da);
        plane_distance(plane, b, depth, CUT_BAND, &db);
        bool a_in = da.hi >= 0.0f, b_in = db.hi >= 0.0f;
        if (!a_in && !b_in) return false;
        if (a_in && b_in) continue;
        pair_sub(&da, &db, &t);
        pair_div(&da, &t, &t);
        if (a_in && is_less(&t, &to)) to = t, to_plane = plane;
        if (b_in && is_less(&from, &t)) from = t, from_plane = plane;
    }
    if (!is_less(&from, &to)) return false;
    segment->end[0] = *a, segment->end[1] = *b;
    segment->place[0] = from.hi, segment->place[1] = to.hi;
    segment->cut[0] = from_plane >= 0, segment->cut[1] = to_plane >= 0;
    if (from_plane >= 0) {
        along(a, b, &from, segment->end);
        put_on_plane(from_plane, segment->end, depth, CUT_BAND);
    }
    if (to_plane >= 0) {
        along(a, b, &to, segment->end + 1);
        put_on_plane(to_plane, segment->end + 1, depth, CUT_BAND);
    }
    return true;
}

// A joint, as one of its segments sees it: the corners left and right of it, relative to it; which of them is on the inner
// side; and how far along the segment the inner corner is.
typedef struct { float left_x, left_y, right_x, right_y, inset; bool left_inside; } Joint;

// own, other: the other ends of this segment and of the one that it is joined to. to_joint: whether this segment runs to
// the joint, or from it. Returns whether there is a joint: where lines turn back, there is none. The other segment goes
// through the joint the other way, and so computes the same numbers with other signs.
static bool joint_of(const Place *at, const ClipVertex *own, const ClipVertex *other, bool to_joint, float half_width,
                     float across, Joint *joint)
{
    Way back, on;
    if (!way_to(at, own, across, &back) || !way_to(at, other, across, &on)) return false;
    float x = on.x - back.x, y = on.y - back.y, length = sqrt(x * x + y * y), cosine = 0.5f * length;  // of half the turn
    if (!(cosine * MITRE_LIMIT >= 1.0f)) return false;
    float turn = back.y * on.x - back.x * on.y, sine = 0.5f * fabs(turn) / cosine, outer = half_width / cosine;
    float nearer = MIN(back.length, on.length), inner = sine * outer * 2.0f > nearer ? nearer / (2.0f * sine) : outer;
    bool left_inside = turn > 0.0f;
    joint->inset = inner * sine;
    float left = left_inside ? inner : outer, right = left_inside ? outer : inner;
    float n_x = -y / length, n_y = x / length;  // to the left of the way from this segment to the other
    joint->left_inside = to_joint == left_inside;
    joint->left_x = to_joint ? left * n_x : -right * n_x, joint->left_y = to_joint ? left * n_y : -right * n_y;
    joint->right_x = to_joint ? -right * n_x : left * n_x, joint->right_y = to_joint ? -right * n_y : left * n_y;
    return true;
}

INLINE void put(global Vertex *vertex, const Place *at, float x, float y, float across, float depth)
{
    Pair right = {x * across, 0.0f}, down = {y, 0.0f};
    float rest;
    pair_add(&at->x, &right, &right);
    pair_add(&at->y, &down, &down);
    vertex->x = snap(&right, &rest);
    vertex->offset_x = rest;
    vertex->y = snap(&down, &rest);
    vertex->offset_y = rest;
    vertex->depth = depth;
    vertex->outcode = 0;
}

// lines: for each segment its two vertices, between those that the segments before and behind it come from and go to;
// negative if there is none. first_vertex: of lines. ends: 2 or 5, the vertices of an end. Half a width is
// half_width + half_by_depth * depth subpixels. places: of each vertex, how far along the segment it is, 0 .. 1.
kernel void expand_lines(global const int4 *lines, uint line_count, uint first_vertex, uint ends,
                         global const float *positions, global const float *low_positions, global const float *matrix,
                         float depth_near, float depth_far, int perspective, float half_width, float half_by_depth,
                         float across, global Vertex *vertices, global float *places)
{
    uint id = get_global_id(0);
    if (id >= line_count) return;
    const DepthRange range = {depth_near, depth_far};
    int4 line = lines[id];
    int number[4] = {line.x, line.y, line.z, line.w};
    ClipVertex corner[4];  // the neighbours are the first and the last
    bool finite = !((vertices[line.y].outcode | vertices[line.z].outcode) & NOT_FINITE);
    for (int i = 0; i < 4; ++i) {
        Point point;
        uint vertex = number[i] < 0 ? number[1] : number[i];
        for (int j = 0; j < 3; ++j) {
            point.high[j] = positions[3 * vertex + j];
            if (LOW_POSITIONS) point.low[j] = low_positions[3 * vertex + j];
        }
        to_clip_space(matrix, &point, corner + i);
    }
    global Vertex *own = vertices + first_vertex + 2 * ends * id;
    global float *own_places = places + 2 * ends * id;
    Segment segment;
    Place at[2];
    Way way;
    bool drawn = finite && cut_segment(corner + 1, corner + 2, range, &segment);
    if (drawn) {
        place_of(segment.end, at);
        place_of(segment.end + 1, at + 1);
        drawn = way_to(at, segment.end + 1, across, &way);
    }
    if (!drawn) {
        for (uint k = 0; k < 2 * ends; ++k) own[k].outcode = OUT_NEAR, own_places[k] = 0.0f;
        return;
    }
    for (int e = 0; e < 2; ++e, own += ends, own_places += ends) {
        const Place *here = at + e;
        float depth = here->depth, half_here = MIN(half_width + half_by_depth * depth, MOST_HALF / across);
        float n_x = -way.y * half_here, n_y = way.x * half_here;
        float place = segment.place[e];
        Joint joint;
        bool joined = ends > 2 && number[3 * e] >= 0 && !segment.cut[e] &&
                      joint_of(here, corner + (e == 0 ? 2 : 1), corner + 3 * e, e == 1, half_here, across, &joint);
        bool left = joined && joint.left_inside, right = joined && !joint.left_inside;
        put(own, here, left ? joint.left_x : n_x, left ? joint.left_y : n_y, across, depth);
        put(own + 1, here, right ? joint.right_x : -n_x, right ? joint.right_y : -n_y, across, depth);
        for (uint k = 0; k < ends; ++k) own_places[k] = place;
        if (ends == 2) continue;
        for (int k = 2; k < 5; ++k) put(own + k, here, 0.0f, 0.0f, across, depth);
        if (!joined) continue;
        float share = MIN(joint.inset / way.length, 1.0f), far = at[1 - e].depth, inner = depth + share * (far - depth);
        own[left ? 0 : 1].depth = inner;
        if (perspective) share *= far / inner;
        own_places[left ? 0 : 1] = place + share * (segment.place[1 - e] - place);
        put(own + 3, here, left ? -n_x : n_x, left ? -n_y : n_y, across, depth);
        put(own + 4, here, left ? joint.right_x : joint.left_x, left ? joint.right_y : joint.left_y, across, depth);
    }
}

// points: the vertex of each. first_vertex: of points. outline: x and y of each of the corners, in radii, y down; and for
// balls in z how much it comes towards the eye. A radius is half_width + half_by_depth * depth subpixels. normals: those of
// balls, to be written for corners; else NULL. axes: right, down and towards the eye, of length 1.
//
// All outlines of one size are the same, moved by whole subpixels. So a square of one pixel covers as many samples as a
// pixel has, wherever it is.
kernel void expand_points(global const uint *points, uint point_count, uint first_vertex, global const float4 *outline,
                          uint corners, float half_width, float half_by_depth, float across,
                          global const float *axes, global float *normals, global Vertex *vertices)
{
    uint id = get_global_id(0);
    if (id >= point_count) return;
    Vertex at = vertices[points[id]];
    uint first = first_vertex + id * corners;
    const int most = GUARD_BAND - 2 * MOST_HALF;
    bool drawn = at.outcode == 0 && at.x >= -most && at.x <= most && at.y >= -most && at.y <= most;
    float radius = MIN(half_width + half_by_depth * at.depth, MOST_HALF / across);
    for (uint k = 0; k < corners; ++k) {
        float4 corner = outline[k];
        if (normals)
            for (int j = 0; j < 3; ++j)
                normals[3 * (first + k) + j] = corner.x * axes[j] + corner.y * axes[3 + j] + corner.z * axes[6 + j];
        vertices[first + k].outcode = drawn ? 0 : OUT_NEAR;
        if (!drawn) continue;
        vertices[first + k].x = at.x + nearest(radius * across * corner.x);
        vertices[first + k].y = at.y + nearest(radius * corner.y);
        vertices[first + k].offset_x = vertices[first + k].offset_y = 0.0f;
        vertices[first + k].depth = at.depth;
    }
}
