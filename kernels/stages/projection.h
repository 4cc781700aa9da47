// Clip space, the screen's grid, and records, which are what projection leaves of a triangle. Projection and clipping
// share it.
//
// In clip space x and y are in subpixels times w, from the image's centre, y down; depth = z / w is reversed. Inside is
// z <= depth_near * w,  z >= depth_far * w,  |x|, |y| <= GUARD_BAND * w.  These depths lie a little outside of those of
// the two planes (clpeel/stages/projection.py, PLANE_SLACK, 2^-22). So a point exactly on a plane is inside, in spite
// of rounding.
#ifndef PROJECTION_H
#define PROJECTION_H

#include "base/wide.h"

// Whether positions are pairs of floats. Positions that are floats need no second part.
#ifndef LOW_POSITIONS
#define LOW_POSITIONS 0
#endif

typedef struct { float near, far; } DepthRange;

typedef struct { Pair x, y, z, w; } ClipVertex;

// A corner on the screen (clpeel/device/records.py, VERTEX): snapped place in subpixels, exact less snapped place,
// depth.
typedef struct { Ints x, y; Floats offset_x, offset_y, depth; } Corner;

// A position, and the part of it that float32 rounds away.
typedef struct { Floats high[3], low[3]; } Point;

// A row of the matrix times a point. row: four floats, then the low parts of the same four.
INLINE void row_times(global const float *row, const Point *point, Pair *product)
{
    Pair sum = {(Floats)(row[3]), (Floats)(row[7])};
    UNROLL for (int k = 0; k < 3; ++k) {
        Floats p = row[k] * point->high[k], e = FMA((Floats)(row[k]), point->high[k], -p), before = sum.lo;
        e += row[4 + k] * point->high[k];
        if (LOW_POSITIONS) e += row[k] * point->low[k];
        two_sum(sum.hi, p, &sum);
        sum.lo = before + (sum.lo + e);
    }
    quick_two_sum(sum.hi, sum.lo, product);
}

INLINE void to_clip_space(global const float *matrix, const Point *point, ClipVertex *v)
{
    row_times(matrix, point, &v->x);
    row_times(matrix + 8, point, &v->y);
    row_times(matrix + 16, point, &v->z);
    row_times(matrix + 24, point, &v->w);
}

// The subpixel nearest to a pair, and in `offset` what is left, within +-0.5.
INLINE Ints snap(const Pair *value, Floats *offset)
{
    Ints whole = nearest(value->hi);
    Floats rest = (value->hi - TO(Floats, whole)) + value->lo;
    Ints step = nearest(rest);
    *offset = rest - TO(Floats, step);
    return whole + step;
}

INLINE void to_screen(const ClipVertex *v, Corner *corner)
{
    Pair x, y, depth;
    pair_div(&v->x, &v->w, &x);
    pair_div(&v->y, &v->w, &y);
    pair_div(&v->z, &v->w, &depth);
    corner->x = snap(&x, &corner->offset_x);
    corner->y = snap(&y, &corner->offset_y);
    corner->depth = depth.hi;
}

// --- records --------------------------------------------------------------------------------------------------------
// The pixels of the image whose samples may lie in the box around three corners; there are none where first > last. With
// samples in the middle of pixels they do. In other patterns a pixel counts if the box reaches any of their places in it.
typedef struct { Ints left, right, top, bottom; } Reach;

INLINE void reach_of(const Ints *x, const Ints *y, int width, int height, uint pattern, Reach *reach)
{
    int first_x = FIRST_X(pattern), first_y = FIRST_Y(pattern);
    reach->left = MAX(FIRST_PIXEL_FROM(MIN(x[0], MIN(x[1], x[2])), width, first_x), (Ints)(0));
    reach->right = MIN(LAST_PIXEL_TO(MAX(x[0], MAX(x[1], x[2])), width, first_x), (Ints)(width - 1));
    reach->top = MAX(FIRST_PIXEL_FROM(MIN(y[0], MIN(y[1], y[2])), height, first_y), (Ints)(0));
    reach->bottom = MIN(LAST_PIXEL_TO(MAX(y[0], MAX(y[1], y[2])), height, first_y), (Ints)(height - 1));
}

// Twice the signed area, positive where the corners run clockwise as seen (y down).
INLINE Longs area_of(const Ints *x, const Ints *y)
{
    return TO(Longs, x[1] - x[0]) * TO(Longs, y[2] - y[0]) - TO(Longs, x[2] - x[0]) * TO(Longs, y[1] - y[0]);
}

// The one order of corners: farthest first (depth is reversed), then topmost, then leftmost.
INLINE Ints is_before(const Corner *a, const Corner *b)
{
    return (a->depth < b->depth) |
           ((a->depth == b->depth) & ((a->y < b->y) | ((a->y == b->y) & (a->x < b->x))));
}

INLINE void choose(Ints which, const Corner *there, const Corner *otherwise, Corner *chosen)
{
    chosen->x = which ? there->x : otherwise->x;
    chosen->y = which ? there->y : otherwise->y;
    chosen->offset_x = which ? there->offset_x : otherwise->offset_x;
    chosen->offset_y = which ? there->offset_y : otherwise->offset_y;
    chosen->depth = which ? there->depth : otherwise->depth;
}

// Where the given corners of a triangle are put, and where snapping moves them.
typedef struct {
    Ints order[3];  // the given corner, 0 .. 2, that is now at each place
    Floats moved[3][3];  // moved[k][j]: weight of exact corner j (as now ordered) at the snapped corner k
} Arrangement;

// Writes the records of WIDE triangles, from `record` on, and their bounds. Where one covers no sample its bounds are
// empty, first > last. source: their faces. flags: those known already.
//
// The corners are first put in one order, whichever order the face gives: positive area with y down, the farthest
// corner first (is_before). There are two reasons. Coincident faces get the same depths to the bit, and so stay in
// submission order. And a fragment's depth is that of the farthest corner plus what the others add, so only what they
// add is rounded often.
//
// Depth is linear over the screen. Snapping moves corners by up to 1/512 pixel. So the plane of the exact triangle is
// evaluated at the snapped corners, and where triangles cross, the picture is that of the exact ones. `moved` has the
// barycentric weights of the exact triangle at the snapped corners. It carries colours and normals over in the same
// way.
OUTLINE void make_triangles(const Corner *given, Uints source, Uints flags, int width, int height, uint pattern, uint record,
                           global Triangle *triangles, global ushort4 *bounds, Arrangement *arrangement)
{
    // Rotate until the first corner is first, then swap the other two where the area is negative.
    Corner nearest_two, c[3];
    Ints second = is_before(given + 1, given);
    choose(second, given + 1, given, &nearest_two);
    Ints third = is_before(given + 2, &nearest_two);
    Ints x[3] = {given[0].x, given[1].x, given[2].x}, y[3] = {given[0].y, given[1].y, given[2].y};
    Longs area = area_of(x, y);
    Ints flip = TO(Ints, area < (Longs)(0)), first = third ? (Ints)(2) : second ? (Ints)(1) : (Ints)(0);
    area = area < (Longs)(0) ? -area : area;
    UNROLL for (int k = 0; k < 3; ++k) {
        Ints place = first + (k == 0 ? (Ints)(0) : flip ? (Ints)(3 - k) : (Ints)(k));
        place = place > (Ints)(2) ? place - (Ints)(3) : place;
        arrangement->order[k] = place;
        choose(place == (Ints)(1), given + 1, given, c + k);
        choose(place == (Ints)(2), given + 2, c + k, c + k);
        x[k] = c[k].x, y[k] = c[k].y;
    }

    Reach reach;
    reach_of(x, y, width, height, pattern, &reach);
    Ints none = (reach.left > reach.right) | (reach.top > reach.bottom) | TO(Ints, area == (Longs)(0));
    reach.left = none ? (Ints)(1) : reach.left, reach.right = none ? (Ints)(0) : reach.right;
    Ints extent = MAX(MAX(x[0], MAX(x[1], x[2])) - MIN(x[0], MIN(x[1], x[2])),
                      MAX(y[0], MAX(y[1], y[2])) - MIN(y[0], MIN(y[1], y[2])));

    // The exact corners relative to the first one, and the gradients of barycentric weights 1 and 2, for each subpixel.
    Floats e_x = TO(Floats, x[1] - x[0]) + (c[1].offset_x - c[0].offset_x);
    Floats e_y = TO(Floats, y[1] - y[0]) + (c[1].offset_y - c[0].offset_y);
    Floats f_x = TO(Floats, x[2] - x[0]) + (c[2].offset_x - c[0].offset_x);
    Floats f_y = TO(Floats, y[2] - y[0]) + (c[2].offset_y - c[0].offset_y);
    Floats exact_area = e_x * f_y - f_x * e_y;
    Floats g1_x = f_y / exact_area, g1_y = -f_x / exact_area, g2_x = -e_y / exact_area, g2_y = e_x / exact_area;
    // Snapping can turn a sliver over. Then its gradients mean nothing, and its corners count as not moved.
    Ints useless = !(exact_area > (Floats)(0.0f)) | !IS_FINITE((g1_x + g1_y) + (g2_x + g2_y));
    g1_x = useless ? (Floats)(0.0f) : g1_x, g1_y = useless ? (Floats)(0.0f) : g1_y;
    g2_x = useless ? (Floats)(0.0f) : g2_x, g2_y = useless ? (Floats)(0.0f) : g2_y;
    Floats depth[3], first_shift = (Floats)(0.0f);
    UNROLL for (int k = 0; k < 3; ++k) {
        Floats m1 = -(g1_x * c[k].offset_x + g1_y * c[k].offset_y), m2 = -(g2_x * c[k].offset_x + g2_y * c[k].offset_y);
        arrangement->moved[k][0] = (k == 0 ? 1.0f : 0.0f) - (m1 + m2);
        arrangement->moved[k][1] = (k == 1 ? 1.0f : 0.0f) + m1;
        arrangement->moved[k][2] = (k == 2 ? 1.0f : 0.0f) + m2;
        Floats shift = m1 * (c[1].depth - c[0].depth) + m2 * (c[2].depth - c[0].depth);
        if (k == 0) first_shift = shift;
        depth[k] = k == 0 ? c[k].depth + shift : (c[k].depth - c[0].depth) + (shift - first_shift);
    }
    Floats depth_max = MAX(c[1].depth, c[2].depth), inverse_area = (Floats)(1.0f) / TO(Floats, area);
    flags |= AS_UINTS(extent < (Ints)(pattern == (uint)REGULAR ? SMALL_EXTENT : SMALL_EXTENT_IN_PATTERNS)) & (Uints)(SMALL);
    flags |= flip ? (Uints)(0) : (Uints)(BACK_FACING);
    Uints left_right = AS_UINTS(reach.left | reach.right << (Ints)(16));
    Uints top_bottom = AS_UINTS(reach.top | reach.bottom << (Ints)(16));
    FOR_EACH_ELEMENT
        bounds[record + k] = (ushort4)(INT_OF(reach.left), INT_OF(reach.right), INT_OF(reach.top), INT_OF(reach.bottom));
    Uints field[RECORD_FIELDS] = {  // the fields of a Triangle (clpeel/device/records.py), in order
        AS_UINTS(x[0]), AS_UINTS(x[1]), AS_UINTS(x[2]), AS_UINTS(y[0]), AS_UINTS(y[1]), AS_UINTS(y[2]), AS_UINTS(depth[0]),
        AS_UINTS(depth[1]), AS_UINTS(depth[2]), AS_UINTS(c[0].depth), AS_UINTS(depth_max), AS_UINTS(inverse_area), source,
        flags, left_right, top_bottom};
    store_records(triangles + record, field);
}

// A record's nine weights, or eight of them, are written at once. They need not begin at multiples of their size.
#if WIDE == RECORD_FIELDS
typedef uint8 EightWords __attribute__((aligned(4)));
#endif

// weights[9 record + 3 k + j]: the weight of the face's vertex j at corner k of the record. In perspective it
// is divided by w, so that interpolation is perspective-correct. share[i][j]: the same at the given corner i.
OUTLINE void store_weights(global float *weights, uint record, const Arrangement *arrangement, const Floats share[3][3])
{
    Uints field[RECORD_FIELDS];
    UNROLL for (int n = 9; n < RECORD_FIELDS; ++n) field[n] = (Uints)(0);
    UNROLL for (int j = 0; j < 3; ++j) {
        Floats at[3];  // of the corners, as they are ordered
        UNROLL for (int i = 0; i < 3; ++i) {
            Ints from = arrangement->order[i];
            at[i] = from == (Ints)(0) ? share[0][j] : from == (Ints)(1) ? share[1][j] : share[2][j];
        }
        UNROLL for (int corner = 0; corner < 3; ++corner) {
            Floats sum = (Floats)(0.0f);
            UNROLL for (int i = 0; i < 3; ++i) sum += arrangement->moved[corner][i] * at[i];
            field[3 * corner + j] = AS_UINTS(sum);
        }
    }
    turn(field);
#if WIDE == RECORD_FIELDS
    UNROLL for (int k = 0; k < WIDE; ++k) {
        *(global EightWords *)(weights + 9 * (record + k)) = field[k].lo;
        weights[9 * (record + k) + 8] = as_float(field[k].s8);
    }
#else
    UNROLL for (int n = 0; n < 9; ++n) weights[9 * record + n] = as_float(field[n]);
#endif
}

#endif
