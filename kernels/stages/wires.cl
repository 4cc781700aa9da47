// Wires: edges of faces, as a view sees them (kernels/shading/wires.h draws them).
//
//   see_edges      an edge a work-item: cuts it, and finds whether it has a surface on one of its sides alone
//   expand_bands   such an edge a work-item: writes the triangles of a band on its other side
//
// An edge is drawn on its faces, up to half its width away from it. Where all faces of an edge lie on one side of it, as at
// an outline, or there is but one, strokes end there. So a band of triangles, behind all others, takes them on:
//
//     tip --- out ------------- out --- tip       The ends are the edge's own vertices, so band and face share the edge
//        \     |                 |     /          as two faces do. At an end where other bands begin, this one and the next one
//          \   |                 |   /            beyond its open side end at the line between them: at the tip where they
//             end  -----------  end               turn away from each other, or with `out` on that line where they turn to
//            ------- surface -------              each other.
#include "stages/segments.h"

// How far the tip of a band may be from its end, in widths of the band.
#define TIP_LIMIT 2.0f

// Where more other bands than this end at one place, none are joined.
#define MOST_JOINED 7

// On which side of the way from a to b a vertex lies: 1 where it is clockwise from b as seen from a (y down), or -1; 0 if
// it is on the line, or is no number. a, b, apex: as projected. Whole vertices decide by whole numbers, as records do.
INLINE int side_of(const Vertex *a, const Vertex *b, const Vertex *apex, const Place *from, const Way *way, float across,
                   const ClipVertex *clipped)
{
    if (apex->outcode & NOT_FINITE) return 0;
    if (!(a->outcode | b->outcode | apex->outcode)) {
        long area = (long)(b->x - a->x) * (apex->y - a->y) - (long)(b->y - a->y) * (apex->x - a->x);
        return area > 0 ? 1 : area < 0 ? -1 : 0;
    }
    Way to;
    if (!way_to(from, clipped, across, &to)) return 0;
    float turn = way->x * to.y - way->y * to.x;
    return turn > 0.0f ? 1 : turn < 0.0f ? -1 : 0;
}

// edges: for each edge the vertices at its ends, and those across from it of its faces; negative if there is no such face.
// kinds: WIRED | ... (clpeel/device/layout.py). one_sided: whether no face is seen from behind. wires: receives where each
// edge is. sides: for each edge on which side of it a band is wanted, 1 or -1, as above; 0 if on none.
kernel void see_edges(global const int4 *edges, uint edge_count, global const uchar *kinds, int one_sided,
                      global const float *positions, global const float *low_positions, global const float *matrix,
                      float depth_near, float depth_far, float half_width, float half_by_depth, float across,
                      global const Vertex *vertices, global Wire *wires, global char *sides)
{
    uint id = get_global_id(0);
    if (id >= edge_count) return;
    const DepthRange range = {depth_near, depth_far};
    int4 edge = edges[id];
    uchar kind = kinds[id];
    Vertex a = vertices[edge.x], b = vertices[edge.y];
    Segment segment;
    Place at[2];
    Way way = {0.0f, 0.0f, 0.0f};
    Wire wire = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, -1.0f, 0.0f, 0};
    sides[id] = 0;
    wires[id] = wire;
    if ((a.outcode | b.outcode) & NOT_FINITE || a.outcode & b.outcode) return;
    bool whole = !(a.outcode | b.outcode);
    if (whole) {
        wire.x = ((float)a.x + a.offset_x) / across, wire.y = (float)a.y + a.offset_y;
        wire.right = ((float)(b.x - a.x) + (b.offset_x - a.offset_x)) / across;
        wire.down = (float)(b.y - a.y) + (b.offset_y - a.offset_y);
        at[0].depth = a.depth, at[1].depth = b.depth;
    } else {
        ClipVertex corner[2];
        vertex_in_clip_space(positions, low_positions, matrix, edge.x, corner);
        vertex_in_clip_space(positions, low_positions, matrix, edge.y, corner + 1);
        if (!cut_segment(corner, corner + 1, range, &segment)) return;
        place_of(segment.end, at);
        place_of(segment.end + 1, at + 1);
        Pair right, down;
        pair_sub(&at[1].x, &at[0].x, &right);
        pair_sub(&at[1].y, &at[0].y, &down);
        wire.x = at[0].x.hi / across, wire.y = at[0].y.hi, wire.right = right.hi / across, wire.down = down.hi;
        if (!way_to(at, segment.end + 1, across, &way)) return;
    }
    float length2 = wire.right * wire.right + wire.down * wire.down, most = MOST_HALF / across;
    wire.inverse_length2 = length2 > 0.0f ? 1.0f / length2 : 0.0f;
    wire.reach = MIN(half_width + half_by_depth * at[0].depth, most);
    wire.growth = MIN(half_width + half_by_depth * at[1].depth, most) - wire.reach;
    int found[2] = {0, 0}, apexes[2] = {edge.z, edge.w};
    for (int k = 0; k < 2; ++k) {
        if (apexes[k] < 0) continue;
        Vertex apex = vertices[apexes[k]];
        ClipVertex clipped;
        if (!whole || apex.outcode) vertex_in_clip_space(positions, low_positions, matrix, apexes[k], &clipped);
        if (whole && apex.outcode) {
            ClipVertex end[2];
            vertex_in_clip_space(positions, low_positions, matrix, edge.x, end);
            vertex_in_clip_space(positions, low_positions, matrix, edge.y, end + 1);
            place_of(end, at);
            way_to(at, end + 1, across, &way);
        }
        found[k] = side_of(&a, &b, &apex, at, &way, across, &clipped);
        // The first face runs from end to end. So it is seen from behind if its corners run clockwise. What has no area
        // counts as seen from the front, at all of its edges, so that outlines are closed.
        int behind = k == 0 || kind & ALIKE ? 1 : -1;
        if (!found[k] && !(apex.outcode & NOT_FINITE)) found[k] = -behind;
        if (found[k]) wire.face |= found[k] == behind ? FROM_BEHIND : FROM_FRONT;
        if ((one_sided || kind & (k == 0 ? FIRST_ONE_SIDED : SECOND_ONE_SIDED)) && found[k] == behind) found[k] = 0;
    }
    wires[id] = wire;
    if (found[0] * found[1] >= 0) sides[id] = (char)(found[0] ? -found[0] : -found[1]);
}

// Where a band has its corners at one end: `out` and the tip, relative to the end. share: how far along the band `out` is.
typedef struct { float out_x, out_y, tip_x, tip_y, share; } BandEnd;

// way: from this end along the band. n_x, n_y: the direction of length 1 across the band, away from the surface. width: of
// the band. on, m_x, m_y: the same two of the band that this one is joined to; else NULL.
INLINE BandEnd band_end(const Way *way, float n_x, float n_y, float width, const Way *on, float m_x, float m_y)
{
    BandEnd end = {n_x * width, n_y * width, n_x * width, n_y * width, 0.0f};
    if (!on) return end;
    float cosine = 1.0f + n_x * m_x + n_y * m_y;  // twice the square of that of half the turn
    if (on->x * n_x + on->y * n_y > 0.0f) {  // they turn to each other
        float shift = cosine > 0.0f ? (m_x * way->x + m_y * way->y) / cosine * width : way->length;
        shift = MIN(MAX(shift, 0.0f), MIN(way->length, on->length));
        end.out_x += way->x * shift, end.out_y += way->y * shift;
        end.tip_x = end.out_x, end.tip_y = end.out_y, end.share = shift / way->length;
    } else if (cosine * TIP_LIMIT * TIP_LIMIT >= 2.0f) {
        end.tip_x = (n_x + m_x) / cosine * width, end.tip_y = (n_y + m_y) / cosine * width;
    } else {
        float x = n_x + m_x, y = n_y + m_y, length = sqrt(x * x + y * y);
        bool turned = !(length > 0x1p-10f);
        end.tip_x = (turned ? -way->x : x / length) * TIP_LIMIT * width;
        end.tip_y = (turned ? -way->y : y / length) * TIP_LIMIT * width;
    }
    return end;
}

// chosen: the edges that have bands. outlines: whether all of these are drawn, on bands as wide as a whole stroke, as little
// of an outline may be seen on the surface. Else those that are WIRED are, on bands of half the width. faces_of: a face of
// each edge. places: for each vertex the same number as for all others at its place. around_starts, around: the edges that
// end at each place. margin: how much wider than seen a band is, in subpixels, so that its rim can be smooth. wires, faces,
// vertices: receive the wires of bands, their triangles and their corners, from first_wire, first_face and first_vertex on.
kernel void expand_bands(global const uint *chosen, uint band_count, global const int4 *edges, global const char *sides,
                         global const uchar *kinds, int outlines, global const uint *faces_of,
                         global const uint *places, global const uint *around_starts, global const uint *around,
                         global const float *positions, global const float *low_positions, global const float *matrix,
                         float depth_near, float depth_far, float across, float margin, uint first_vertex, uint first_face,
                         uint first_wire, global Wire *wires, global uint *faces, global Vertex *vertices)
{
    uint id = get_global_id(0);
    if (id >= band_count) return;
    const DepthRange range = {depth_near, depth_far};
    uint number = chosen[id];
    Wire wire = wires[number];
    if (outlines) wire.reach *= 2.0f, wire.growth *= 2.0f;
    Wire shown = wire;
    shown.face = faces_of[number];
    if (!(kinds[number] & WIRED) && !outlines) shown.reach = -1.0f, shown.growth = 0.0f;
    wires[first_wire + id] = shown;
    int4 edge = edges[number];
    int vertex[2] = {edge.x, edge.y};
    uint first = first_vertex + BAND_CORNERS * id;
    global Vertex *own = vertices + first;
    global uint *triangle = faces + 3 * (first_face + BAND_TRIANGLES * id);
    const uint corners[3 * BAND_TRIANGLES] = {0, 1, 4, 0, 4, 3, 0, 2, 1, 3, 4, 5};
    for (int k = 0; k < 3 * BAND_TRIANGLES; ++k) triangle[k] = first + corners[k];
    ClipVertex corner[2];
    for (int e = 0; e < 2; ++e) vertex_in_clip_space(positions, low_positions, matrix, vertex[e], corner + e);
    Segment segment;
    Place at[2];
    Way way[2];
    bool drawn = cut_segment(corner, corner + 1, range, &segment);
    if (drawn) {
        place_of(segment.end, at);
        place_of(segment.end + 1, at + 1);
        drawn = way_to(at, segment.end + 1, across, way);
        way[1].x = -way[0].x, way[1].y = -way[0].y, way[1].length = way[0].length;
    }
    for (int k = 0; k < BAND_CORNERS; ++k) own[k].outcode = OUT_NEAR;
    if (!drawn) return;
    float side = (float)sides[number], n_x = -side * way[0].y, n_y = side * way[0].x;
    for (int e = 0; e < 2; ++e, own += 3) {
        float width = wire.reach + (e ? wire.growth : 0.0f) + margin, m_x = 0.0f, m_y = 0.0f, least = MAXFLOAT;
        Way on, other_way;
        uint others = segment.cut[e] ? MOST_JOINED + 1 : 0, here = places[vertex[e]];
        for (uint k = around_starts[here]; k < around_starts[here + 1] && others <= MOST_JOINED; ++k) {
            uint other = around[k];
            if (other == number || !sides[other]) continue;
            ++others;
            bool begins = places[edges[other].x] == here;
            float turn = begins ? (float)sides[other] : -(float)sides[other];
            if (turn == (e ? -side : side)) continue;  // its surface is on the other side
            ClipVertex far;
            vertex_in_clip_space(positions, low_positions, matrix, begins ? edges[other].y : edges[other].x, &far);
            if (!way_to(at + e, &far, across, &other_way)) continue;
            float along = other_way.x * way[e].x + other_way.y * way[e].y;
            float angle = other_way.x * n_x + other_way.y * n_y > 0.0f ? 1.0f - along : 3.0f + along;  // grows with it
            if (angle < least) least = angle, on = other_way, m_x = -turn * on.y, m_y = turn * on.x;
        }
        bool joined = others <= MOST_JOINED && least < MAXFLOAT;
        BandEnd end = band_end(way + e, n_x, n_y, width, joined ? &on : 0, m_x, m_y);
        put(own, at + e, 0.0f, 0.0f, across, at[e].depth);
        float depth = at[e].depth + end.share * (at[1 - e].depth - at[e].depth);
        put(own + 1, at + e, end.out_x, end.out_y, across, depth);
        put(own + 2, at + e, end.tip_x, end.tip_y, across, depth);
    }
}
