// Clipping: the faces that cross a clipping plane or the guard band, cut into fans of screen triangles (projection.h).
//
//   collect_clipped     one work-item a face: the list of those faces (any order; the host sorts it)
//   clip_triangles      one work-item a clipped face: its fan, in records of its own behind all others
#include "projection.h"

// Signed distance inside plane k (its outcode is 1 << k), linear in clip space.
INLINE Pair plane_distance(int plane, ClipVertex v, DepthRange depth)
{
    Pair guard = pair_of(v.w.hi * GUARD_BAND, v.w.lo * GUARD_BAND);
    switch (plane) {
    case 0: return pair_sub(pair_mul(v.w, pair_of(depth.near, 0.0f)), v.z);
    case 1: return pair_sub(v.z, pair_mul(v.w, pair_of(depth.far, 0.0f)));
    case 2: return pair_add(guard, v.x);
    case 3: return pair_sub(guard, v.x);
    case 4: return pair_add(guard, v.y);
    default: return pair_sub(guard, v.y);
    }
}

// A point that is on plane k but for rounding, put there: far outside, the rounding can be larger than the picture.
INLINE void put_on_plane(int plane, ClipVertex *v, DepthRange depth)
{
    Pair guard = pair_of(v->w.hi * GUARD_BAND, v->w.lo * GUARD_BAND);
    switch (plane) {
    case 0: v->z = pair_mul(v->w, pair_of(depth.near, 0.0f)); break;
    case 1: v->z = pair_mul(v->w, pair_of(depth.far, 0.0f)); break;
    case 2: v->x = pair_of(-guard.hi, -guard.lo); break;
    case 3: v->x = guard; break;
    case 4: v->y = pair_of(-guard.hi, -guard.lo); break;
    default: v->y = guard;
    }
}

kernel void collect_clipped(global const uint *faces, uint face_count, uint vertex_count, global const Vertex *vertices,
                            volatile global uint *counters, global uint *clipped)
{
    uint i = get_global_id(0);
    if (i >= face_count) return;
    uint3 face = load_face(faces, i);
    if (MAX(face.x, MAX(face.y, face.z)) >= vertex_count) return;
    uint a = vertices[face.x].outcode, b = vertices[face.y].outcode, c = vertices[face.z].outcode;
    if ((a | b | c) && !((a | b | c) & NOT_FINITE) && !(a & b & c)) clipped[atomic_inc(counters + 2)] = i;
}

INLINE Pair along(Pair from, Pair to, Pair t) { return pair_add(from, pair_mul(t, pair_sub(to, from))); }

// Sutherland and Hodgman's polygon clipping against one plane; cuts are made from inside to outside, so that two faces
// that share an edge share its cut.
// A convex polygon gains one corner at most; rounding can make one that is a sliver gain more, which `room` cuts short.
static int clip_polygon(const ClipVertex *in, int count, int plane, DepthRange depth, ClipVertex *out)
{
    int kept = 0, room = MAX_CLIP_VERTICES - 1;
    for (int k = 0; k < count && kept < room; ++k) {
        ClipVertex a = in[k], b = in[k + 1 < count ? k + 1 : 0];
        Pair da = plane_distance(plane, a, depth), db = plane_distance(plane, b, depth);
        bool a_in = da.hi >= 0.0f, b_in = db.hi >= 0.0f;
        if (a_in) out[kept++] = a;
        if (a_in == b_in) continue;
        if (!a_in) {
            ClipVertex c = a;
            Pair d = da;
            a = b, b = c, da = db, db = d;
        }
        Pair t = pair_div(da, pair_sub(da, db));
        ClipVertex cut;
        cut.x = along(a.x, b.x, t), cut.y = along(a.y, b.y, t), cut.z = along(a.z, b.z, t), cut.w = along(a.w, b.w, t);
        cut.weight = a.weight + t.hi * (b.weight - a.weight);
        put_on_plane(plane, &cut, depth);
        out[kept++] = cut;
    }
    return kept;
}

kernel void clip_triangles(global const uint *clipped, uint clipped_count, global const uint *faces, uint face_count,
                           global const float *positions, global const float *low_positions,
                           global const float *matrix, float depth_near, float depth_far, int width, int height,
                           global Triangle *triangles, global ushort4 *bounds, global float *weights)
{
    uint n = get_global_id(0);
    if (n >= clipped_count) return;
    const DepthRange depth = {depth_near, depth_far};
    uint source = clipped[n], first = face_count + n * CLIP_TRIANGLES;
    uint3 face = load_face(faces, source);
    ClipVertex polygon[MAX_CLIP_VERTICES], other[MAX_CLIP_VERTICES];
    to_clip_space(matrix, positions, low_positions, face.x, polygon);
    to_clip_space(matrix, positions, low_positions, face.y, polygon + 1);
    to_clip_space(matrix, positions, low_positions, face.z, polygon + 2);
    polygon[0].weight = (float3)(1.0f, 0.0f, 0.0f);
    polygon[1].weight = (float3)(0.0f, 1.0f, 0.0f);
    polygon[2].weight = (float3)(0.0f, 0.0f, 1.0f);
    int count = 3;
    for (int plane = 0; plane < 6; ++plane) {
        count = clip_polygon(polygon, count, plane, depth, other);
        for (int k = 0; k < count; ++k) polygon[k] = other[k];
    }
    for (int k = 0; k < CLIP_TRIANGLES; ++k) {
        uint record = first + k;
        bounds[record] = (ushort4)(1, 0, 1, 0);
        if (k + 2 >= count) continue;
        Vertex corner[3];
        for (int i = 0; i < 3; ++i) to_screen(polygon + (i == 0 ? 0 : k + i), corner + i);
        float moved[3][3];
        int order[3];
        if (!make_triangle(corner, source, width, height, triangles + record, bounds + record, moved, order)) continue;
#if FRAGMENT_COLOR
        float share[3][3];
        for (int i = 0; i < 3; ++i) {
            ClipVertex c = polygon[i == 0 ? 0 : k + i];
            float scale = PERSPECTIVE ? corner[i].depth : 1.0f;
            share[i][0] = c.weight.x * scale, share[i][1] = c.weight.y * scale, share[i][2] = c.weight.z * scale;
        }
        store_weights(weights, record, moved, order, share);
#endif
    }
    // The face itself has no record: its bounds name its fan (binning.cl, FOR_EACH_PAIR).
    bounds[source] = (ushort4)(CLIPPED_FACE, 0, n & 0xFFFF, n >> 16);
}
