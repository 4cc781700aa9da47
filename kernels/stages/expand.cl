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
#include "stages/segments.h"

// A joint is at most so many halves of a width long.
#define MITRE_LIMIT 4.0f

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
    for (int i = 0; i < 4; ++i)
        vertex_in_clip_space(positions, low_positions, matrix, number[i] < 0 ? number[1] : number[i], corner + i);
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
