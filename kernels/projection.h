// Clip space, the screen's grid, and the record of a screen triangle: what projection and clipping share.
//
// Clip space: x, y are in subpixels times w, from the image's centre, y down; depth = z / w is reversed.
// Inside is  z <= depth_near * w,  z >= depth_far * w,  |x|, |y| <= GUARD_BAND * w.  The depths of the two planes reach
// 2^-22 beyond 1 and the far one's (camera.py), so that what lies exactly on them is inside whatever the rounding.
#ifndef PROJECTION_H
#define PROJECTION_H

#include "common.h"

typedef struct { float near, far; } DepthRange;

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
        Pair s = two_sum(sum.hi, p);                                                       \
        sum = pair_of(s.hi, sum.lo + (s.lo + e));                                          \
    }
    TERM(0, x) TERM(1, y) TERM(2, z)
#undef TERM
    return quick_two_sum(sum.hi, sum.lo);
}

INLINE void to_clip_space(global const float *matrix, global const float *positions, global const float *low_positions,
                          uint vertex, ClipVertex *v)
{
    float3 high = load3(positions, vertex), low = (float3)(0.0f);
    if (LOW_POSITIONS) low = load3(low_positions, vertex);
    v->x = row_times(matrix, high, low);
    v->y = row_times(matrix + 8, high, low);
    v->z = row_times(matrix + 16, high, low);
    v->w = row_times(matrix + 24, high, low);
}

// Nearest subpixel to a pair, and what is left of it.
INLINE int snap(Pair value, float *offset)
{
    int whole = nearest(value.hi);
    float rest = (value.hi - (float)whole) + value.lo;
    int step = nearest(rest);
    *offset = rest - (float)step;
    return whole + step;
}

INLINE void to_screen(const ClipVertex *c, Vertex *v)
{
    v->x = snap(pair_div(c->x, c->w), &v->offset_x);
    v->y = snap(pair_div(c->y, c->w), &v->offset_y);
    v->depth = pair_div(c->z, c->w).hi;
    v->outcode = 0;
}

// The one order of corners: farthest, then topmost, then leftmost.
INLINE bool is_before(const Vertex *a, const Vertex *b)
{
    if (a->depth != b->depth) return a->depth < b->depth;
    return a->y != b->y ? a->y < b->y : a->x < b->x;
}

// Writes the record of a triangle with these corners, and its bounds; false when it covers no sample.
//
// Depth is linear over the screen. Snapping moves the corners by up to 1/512 pixel, so the plane is evaluated at the
// snapped corners: where triangles cross, the picture is then that of the exact triangles. The same matrix `moved`
// (barycentric coordinates of the exact triangle at the snapped corners) carries colours and normals over.
//
// The corners are first put into one order, whichever the face gave them in: positive area with y down, the farthest (then
// topmost, then leftmost) first. Coincident faces then have the same depths to the bit, and stay in submission order; and
// a fragment's depth is the farthest corner's plus what the others add, so that only what they add is rounded often.
INLINE bool make_triangle(const Vertex *given, uint source, int width, int height, global Triangle *triangle,
                          global ushort4 *bounds, float moved[3][3], int order[3])
{
    int first = 0;
    for (int k = 1; k < 3; ++k)
        if (is_before(given + k, given + first)) first = k;
    int second = first < 2 ? first + 1 : 0, third = first > 0 ? first - 1 : 2;
    int2 a = (int2)(given[second].x - given[first].x, given[second].y - given[first].y);
    int2 b = (int2)(given[third].x - given[first].x, given[third].y - given[first].y);
    long area = (long)a.x * b.y - (long)b.x * a.y;
    bool flip = area < 0;
    order[0] = first, order[1] = flip ? third : second, order[2] = flip ? second : third;
    const Vertex c0 = given[order[0]], c1 = given[order[1]], c2 = given[order[2]];
    area = flip ? -area : area;

    int x_min = MIN(c0.x, MIN(c1.x, c2.x)), x_max = MAX(c0.x, MAX(c1.x, c2.x));
    int y_min = MIN(c0.y, MIN(c1.y, c2.y)), y_max = MAX(c0.y, MAX(c1.y, c2.y));
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
    float first_shift = 0.0f;
    for (int k = 0; k < 3; ++k) {
        const Vertex c = k == 0 ? c0 : k == 1 ? c1 : c2;
        float m1 = -(g1.x * c.offset_x + g1.y * c.offset_y), m2 = -(g2.x * c.offset_x + g2.y * c.offset_y);
        moved[k][0] = (k == 0 ? 1.0f : 0.0f) - (m1 + m2);
        moved[k][1] = (k == 1 ? 1.0f : 0.0f) + m1;
        moved[k][2] = (k == 2 ? 1.0f : 0.0f) + m2;
        triangle->x[k] = c.x;
        triangle->y[k] = c.y;
        float shift = m1 * (c1.depth - c0.depth) + m2 * (c2.depth - c0.depth);
        if (k == 0) first_shift = shift;
        triangle->depth[k] = k == 0 ? c.depth + shift : (c.depth - c0.depth) + (shift - first_shift);
    }
    triangle->depth_min = c0.depth;
    triangle->depth_max = MAX(c1.depth, c2.depth);
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

#endif
