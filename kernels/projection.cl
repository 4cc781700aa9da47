// Projection: scene triangles to snapped, clipped screen triangles.
//
//   project_vertices    one work-item a vertex: clip space in float pairs, then snapped to 1/256 pixel
//   setup_triangles     one work-item a face: a record, or nothing, or a count of those that need clipping
//   collect_clipped     one work-item a face: the list of those (any order; the host sorts it)
//   clip_triangles      one work-item a clipped face: its fan, in records of its own behind all others
//
// Clip space: x, y are in subpixels times w, from the image's centre, y down; depth = z / w is reversed.
// Inside is  z <= depth_near * w,  z >= depth_far * w,  |x|, |y| <= GUARD_BAND * w.  The depths of the two planes reach
// 2^-22 beyond 1 and the far one's (camera.py), so that what lies exactly on them is inside whatever the rounding.
#include "common.h"

typedef struct { Pair x, y, z, w; float3 weight; } ClipVertex;

// A row of the matrix (four floats, then the same four's low parts) times a point.
INLINE Pair row_times(global const float *row, float3 high, float3 low)
{
    Pair sum = pair_of(row[3], row[7]);
#define TERM(k, component)                                                                 \
    {                                                                                      \
        float p = row[k] * high.component, e = FMA(row[k], high.component, -p);            \
        e += row[4 + k] * high.component;                                                  \
        if (LOW_POSITIONS) e += row[k] * low.component;                                    \
        Pair s = two_sum(sum.high, p);                                                     \
        sum = pair_of(s.high, sum.low + (s.low + e));                                      \
    }
    TERM(0, x) TERM(1, y) TERM(2, z)
#undef TERM
    return quick_two_sum(sum.high, sum.low);
}

INLINE ClipVertex to_clip_space(global const float *matrix, global const float *positions,
                                       global const float *low_positions, uint vertex)
{
    float3 high = load3(positions, vertex), low = (float3)(0.0f);
    if (LOW_POSITIONS) low = load3(low_positions, vertex);
    ClipVertex v;
    v.x = row_times(matrix, high, low);
    v.y = row_times(matrix + 8, high, low);
    v.z = row_times(matrix + 16, high, low);
    v.w = row_times(matrix + 24, high, low);
    return v;
}

typedef struct { float near, far; } DepthRange;

// Signed distance inside plane k (its outcode is 1 << k), linear in clip space.
INLINE Pair plane_distance(int plane, ClipVertex v, DepthRange depth)
{
    Pair guard = pair_of(v.w.high * GUARD_BAND, v.w.low * GUARD_BAND);
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
    Pair guard = pair_of(v->w.high * GUARD_BAND, v->w.low * GUARD_BAND);
    switch (plane) {
    case 0: v->z = pair_mul(v->w, pair_of(depth.near, 0.0f)); break;
    case 1: v->z = pair_mul(v->w, pair_of(depth.far, 0.0f)); break;
    case 2: v->x = pair_of(-guard.high, -guard.low); break;
    case 3: v->x = guard; break;
    case 4: v->y = pair_of(-guard.high, -guard.low); break;
    default: v->y = guard;
    }
}

// Which planes a vertex is outside of. Rounded once more than plane_distance(): a vertex on a plane to within a rounding
// may be called outside by one and inside by the other, and is then cut at its own place.
INLINE uint outcode_of(ClipVertex v, DepthRange depth)
{
    float guard = v.w.high * GUARD_BAND;
    return (v.z.high > v.w.high * depth.near ? OUT_NEAR : 0u) | (v.z.high < v.w.high * depth.far ? OUT_FAR : 0u) |
           (v.x.high < -guard ? OUT_LEFT : 0u) | (v.x.high > guard ? OUT_RIGHT : 0u) |
           (v.y.high < -guard ? OUT_TOP : 0u) | (v.y.high > guard ? OUT_BOTTOM : 0u);
}

// Nearest subpixel to a pair, and what is left of it.
INLINE int snap(Pair value, float *offset)
{
    int whole = nearest(value.high);
    float rest = (value.high - (float)whole) + value.low;
    int step = nearest(rest);
    *offset = rest - (float)step;
    return whole + step;
}

INLINE Vertex to_screen(ClipVertex c)
{
    Vertex v;
    v.x = snap(pair_div(c.x, c.w), &v.offset_x);
    v.y = snap(pair_div(c.y, c.w), &v.offset_y);
    v.depth = c.z.high / c.w.high;
    v.outcode = 0;
    return v;
}

// No branches, so that items run side by side: past the end the last vertex is done again, into padding.
kernel void project_vertices(global const float *positions, global const float *low_positions,
                             global const float *matrix, float depth_near, float depth_far, uint vertex_count,
                             global Vertex *vertices)
{
    const DepthRange depth = {depth_near, depth_far};
    uint i = get_global_id(0), from = MIN(i, vertex_count - 1);
    ClipVertex c = to_clip_space(matrix, positions, low_positions, from);
    // A NaN or infinity anywhere makes this sum one: positions are below 2^61, so it cannot overflow by itself.
    float3 p = load3(positions, from);
    // Field by field: the copy of a whole struct keeps a CPU compiler from running items side by side.
    Vertex v = to_screen(c);
    vertices[i].x = v.x;
    vertices[i].y = v.y;
    vertices[i].offset_x = v.offset_x;
    vertices[i].offset_y = v.offset_y;
    vertices[i].depth = v.depth;
    vertices[i].outcode = is_finite((p.x + p.y) + p.z) ? outcode_of(c, depth) : NOT_FINITE;
}

// The record of a triangle with these corners; false when it covers no sample.
//
// Depth is linear over the screen. Snapping moves the corners by up to 1/512 pixel, so the plane is evaluated at the
// snapped corners: where triangles cross, the picture is then that of the exact triangles. The same matrix `moved`
// (barycentric coordinates of the exact triangle at the snapped corners) carries colours and normals over.
//
// The corners are first put into one order, whichever the face gave them in: positive area with y down, the topmost (then
// leftmost) first. Coincident faces then have the same depths to the bit, and stay in submission order.
INLINE bool make_triangle(const Vertex *given, uint source, int width, int height, Triangle *triangle, ushort4 *bounds,
                          float moved[3][3], int order[3])
{
    int first = 0;
    for (int k = 1; k < 3; ++k)
        if (given[k].y < given[first].y || (given[k].y == given[first].y && given[k].x < given[first].x)) first = k;
    int second = first < 2 ? first + 1 : 0, third = first > 0 ? first - 1 : 2;
    int2 a = (int2)(given[second].x - given[first].x, given[second].y - given[first].y);
    int2 b = (int2)(given[third].x - given[first].x, given[third].y - given[first].y);
    long area = (long)a.x * b.y - (long)b.x * a.y;
    bool flip = area < 0;
    order[0] = first, order[1] = flip ? third : second, order[2] = flip ? second : third;
    const Vertex c0 = given[order[0]], c1 = given[order[1]], c2 = given[order[2]];
    area = flip ? -area : area;

    int x_min = MIN(c0.x, MIN(c1.x, c2.x)), x_max = MAX(c0.x, MAX(c1.x, c2.x));
    int y_min = c0.y, y_max = MAX(c1.y, c2.y);
    int left = MAX(first_pixel(x_min, width), 0), right = MIN(last_pixel(x_max, width), width - 1);
    int top = MAX(first_pixel(y_min, height), 0), bottom = MIN(last_pixel(y_max, height), height - 1);
    if (area == 0 || left > right || top > bottom) {
        *bounds = (ushort4)(1, 0, 1, 0);
        return false;
    }
    *bounds = (ushort4)(left, right, top, bottom);
    triangle->left_right = (uint)left | (uint)right << 16;
    triangle->top_bottom = (uint)top | (uint)bottom << 16;

    // The exact corners relative to the first, and the gradients of the barycentric coordinates 1 and 2.
    float2 e = (float2)((float)(c1.x - c0.x) + (c1.offset_x - c0.offset_x),
                        (float)(c1.y - c0.y) + (c1.offset_y - c0.offset_y));
    float2 f = (float2)((float)(c2.x - c0.x) + (c2.offset_x - c0.offset_x),
                        (float)(c2.y - c0.y) + (c2.offset_y - c0.offset_y));
    float exact_area = e.x * f.y - f.x * e.y;
    float2 g1 = (float2)(f.y, -f.x) / exact_area, g2 = (float2)(-e.y, e.x) / exact_area;
    // A sliver that snapping turned over has no use for its gradients: leave it as it is.
    if (!(exact_area > 0.0f) || !is_finite((g1.x + g1.y) + (g2.x + g2.y))) g1 = g2 = (float2)(0.0f);
    for (int k = 0; k < 3; ++k) {
        const Vertex c = k == 0 ? c0 : k == 1 ? c1 : c2;
        float m1 = -(g1.x * c.offset_x + g1.y * c.offset_y), m2 = -(g2.x * c.offset_x + g2.y * c.offset_y);
        moved[k][0] = (k == 0 ? 1.0f : 0.0f) - (m1 + m2);
        moved[k][1] = (k == 1 ? 1.0f : 0.0f) + m1;
        moved[k][2] = (k == 2 ? 1.0f : 0.0f) + m2;
        triangle->x[k] = c.x;
        triangle->y[k] = c.y;
        // Written so that no shift leaves the depth's bits as they were.
        triangle->depth[k] = c.depth + (m1 * (c1.depth - c0.depth) + m2 * (c2.depth - c0.depth));
    }
    triangle->depth_min = MIN(c0.depth, MIN(c1.depth, c2.depth));
    triangle->depth_max = MAX(c0.depth, MAX(c1.depth, c2.depth));
    triangle->inverse_area = 1.0f / (float)area;
    triangle->source = source;
    triangle->small = MAX(x_max - x_min, y_max - y_min) < SMALL_EXTENT;
    return true;
}

// weights[3 k + j]: share of the face's vertex j at corner k, over w, so that interpolation is perspective-correct.
// share[i][j]: the same at the given corner i.
INLINE void store_weights(global float *weights, uint record, float moved[3][3], const int order[3],
                          const float share[3][3])
{
    for (int k = 0; k < 3; ++k)
        for (int j = 0; j < 3; ++j) {
            float sum = 0.0f;
            for (int i = 0; i < 3; ++i) sum += moved[k][i] * share[order[i]][j];
            weights[9 * record + 3 * k + j] = sum;
        }
}

kernel void setup_triangles(global const uint *faces, uint face_count, uint vertex_count, global const Vertex *vertices,
                            int width, int height, global Triangle *triangles, global ushort4 *bounds,
                            global float *weights, volatile global uint *counters)
{
    uint i = get_global_id(0);
    if (i >= face_count) return;
    uint3 face = load_face(faces, i);
    bounds[i] = (ushort4)(1, 0, 1, 0);
    // The host refuses such faces; this guard is for memory's sake.
    if (MAX(face.x, MAX(face.y, face.z)) >= vertex_count) return;
    Vertex corner[3] = {vertices[face.x], vertices[face.y], vertices[face.z]};
    uint any = corner[0].outcode | corner[1].outcode | corner[2].outcode;
    if (any) {
        if (any & NOT_FINITE) atomic_inc(counters);  // Counters.discarded
        else if (!(corner[0].outcode & corner[1].outcode & corner[2].outcode)) atomic_inc(counters + 1);
        return;
    }
    Triangle triangle;
    ushort4 pixel_bounds;
    float moved[3][3];
    int order[3];
    if (!make_triangle(corner, i, width, height, &triangle, &pixel_bounds, moved, order)) return;
    triangles[i] = triangle;
    bounds[i] = pixel_bounds;
#if FRAGMENT_COLOR
    float share[3][3] = {{0}};
    for (int k = 0; k < 3; ++k) share[k][k] = PERSPECTIVE ? corner[k].depth : 1.0f;
    store_weights(weights, i, moved, order, share);
#endif
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
        bool a_in = da.high >= 0.0f, b_in = db.high >= 0.0f;
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
        cut.weight = a.weight + t.high * (b.weight - a.weight);
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
    polygon[0] = to_clip_space(matrix, positions, low_positions, face.x);
    polygon[1] = to_clip_space(matrix, positions, low_positions, face.y);
    polygon[2] = to_clip_space(matrix, positions, low_positions, face.z);
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
        Vertex corner[3] = {to_screen(polygon[0]), to_screen(polygon[k + 1]), to_screen(polygon[k + 2])};
        Triangle triangle;
        ushort4 pixel_bounds;
        float moved[3][3];
        int order[3];
        if (!make_triangle(corner, source, width, height, &triangle, &pixel_bounds, moved, order)) continue;
        triangles[record] = triangle;
        bounds[record] = pixel_bounds;
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
