// Rasterization: the records of each tile to fragments, exactly.
//
//   count_fragments   one work-group a tile: how many fragments each pixel gets
//   emit_fragments    the same walk again: writes them where the counts say
//
// A tile of TILE x TILE pixels is cut into strips of STRIP pixels of a row; strip s belongs to lane s % LANES, which alone
// writes its pixels. So there is nothing to guard with atomics, and a pixel's fragments lie in submission order:
//
//   fragments:  | pixel 0: first submitted .. last | pixel 1: ... |      key << 32 | payload
//   pixel_end:    inclusive prefix sum of the counts within the tile
//   tile_totals:  fragments of the tile, and of its deepest pixel
//
// key: depth_key() of the fragment's depth; payload: the packed colour, or an index into `colors`.
#include "shading.h"

#define STRIPS (TILE_PIXELS / STRIP)
#define STRIPS_A_ROW (TILE / STRIP)
#define STRIPS_A_LANE (STRIPS / LANES)

// One edge, E(x, y) = dx (y - y_a) - dy (x - x_a), and what makes a sample exactly on it belong to one side only:
// with y down and positive area, top edges run right and left edges run up; they own their samples.
typedef struct { int dx, dy, x, y, bias; } Edge;

INLINE void edge_of(global const Triangle *t, int a, int b, Edge *e)
{
    e->dx = t->x[b] - t->x[a], e->dy = t->y[b] - t->y[a];
    e->x = t->x[a], e->y = t->y[a];
    e->bias = e->dy < 0 || (e->dy == 0 && e->dx > 0) ? 0 : -1;
}

typedef struct {
    Edge edge[3];  // edge k is opposite corner k: E is twice the area of the sub-triangle that weighs corner k
    int left, right, top, bottom;  // pixels of the tile to look at
    bool small;  // E fits 32 bits all over the tile
} Walk;

INLINE void walk_of(global const Triangle *t, int tile_x, int tile_y, Walk *w)
{
    edge_of(t, 1, 2, w->edge), edge_of(t, 2, 0, w->edge + 1), edge_of(t, 0, 1, w->edge + 2);
    int left = t->left_right & 0xFFFF, right = t->left_right >> 16;
    int top = t->top_bottom & 0xFFFF, bottom = t->top_bottom >> 16;
    w->left = MAX(left - tile_x, 0), w->right = MIN(right - tile_x, TILE - 1);
    w->top = MAX(top - tile_y, 0), w->bottom = MIN(bottom - tile_y, TILE - 1);
    w->small = t->small;
}

// What a lane tests at once is a block of STRIP samples: a strip of a row, `columns` right of its first sample. A lane that
// has the tile to itself takes a record no larger than 4 x 4 pixels, as most of a fine mesh are, in one square block
// from the record's own corner instead.
#define STRIP_COLUMNS (VECTOR(int))(IOTA)
#define STRIP_ROWS (VECTOR(int))(0)
#if LANES == 1
#define SQUARE 4
#define SQUARE_COLUMNS (STRIP_COLUMNS & (VECTOR(int))(SQUARE - 1))
#define SQUARE_ROWS (STRIP_COLUMNS / (VECTOR(int))(SQUARE))
INLINE bool is_square(const Walk *w) { return w->right - w->left < SQUARE && w->bottom - w->top < SQUARE; }
#endif

// E at a block's samples, in 32 bits where proven to fit and in 64 elsewhere: the same integers either way.
#define DEFINE_EDGE_VALUES(name, integer)                                                                       \
    INLINE VECTOR(integer) name(Edge e, int x, int y, VECTOR(integer) columns, VECTOR(integer) rows)            \
    {                                                                                                           \
        integer first = (integer)e.dx * (y - e.y) - (integer)e.dy * (x - e.x);                                  \
        return (VECTOR(integer))(first) + ((VECTOR(integer))((integer)e.dx * SUBPIXELS) * rows -                \
                                           (VECTOR(integer))((integer)e.dy * SUBPIXELS) * columns);             \
    }
DEFINE_EDGE_VALUES(edge_values_small, int)
DEFINE_EDGE_VALUES(edge_values_large, long)

// Coverage of a block whose first sample is at x, y: -1 or 0 a sample, and the barycentric weights times twice the area,
// each rounded once.
INLINE VECTOR(int) cover(const Walk *w, int x, int y, VECTOR(int) columns, VECTOR(int) rows, VECTOR(float) weight[3])
{
    VECTOR(int) covered = (VECTOR(int))(-1);
    if (w->small) {
        for (int k = 0; k < 3; ++k) {
            VECTOR(int) e = edge_values_small(w->edge[k], x, y, columns, rows);
            covered &= (e + (VECTOR(int))(w->edge[k].bias)) >= (VECTOR(int))(0);
            weight[k] = CONVERT(float, STRIP, e);
        }
    } else {
        for (int k = 0; k < 3; ++k) {
            VECTOR(long) e = edge_values_large(w->edge[k], x, y, CONVERT(long, STRIP, columns), CONVERT(long, STRIP, rows));
            covered &= CONVERT(int, STRIP, (e + (VECTOR(long))(w->edge[k].bias)) >= (VECTOR(long))(0));
            weight[k] = CONVERT(float, STRIP, e);
        }
    }
    return covered;
}

// Walks this lane's strips that the record can touch: s is the strip, own its place among the lane's own.
#define FOR_EACH_STRIP(w, lane, s, own)                                                                         \
    for (int s = (w).top * STRIPS_A_ROW + ((lane - (w).top * STRIPS_A_ROW) & (LANES - 1)), own = s / LANES;     \
         s < ((w).bottom + 1) * STRIPS_A_ROW; s += LANES, ++own)                                                \
        if ((s % STRIPS_A_ROW) * STRIP <= (w).right && (s % STRIPS_A_ROW) * STRIP + STRIP > (w).left)

kernel void count_fragments(global const Triangle *triangles, global const uint *pair_start,
                            global const uint *pairs, uint first_tile, int columns, int width,
                            int height, global uint *pixel_end, global uint2 *tile_totals)
{
    local uint prefix[TILE_PIXELS] __attribute__((aligned(64)));
    uint tile = get_group_id(0);
    int lane = get_local_id(0);
    int tile_x = (int)((first_tile + tile) % columns) * TILE, tile_y = (int)((first_tile + tile) / columns) * TILE;
    int x = sample_at(tile_x, width), y = sample_at(tile_y, height);
    VECTOR(uint) counts[STRIPS_A_LANE];
    for (int own = 0; own < STRIPS_A_LANE; ++own) counts[own] = (VECTOR(uint))(0);

    for (uint pair = pair_start[tile], end = pair_start[tile + 1]; pair < end; ++pair) {
        if (pair + PREFETCH_DISTANCE < end) PREFETCH(triangles + pairs[pair + PREFETCH_DISTANCE]);
        Walk w;
        walk_of(triangles + pairs[pair], tile_x, tile_y, &w);
        VECTOR(float) weight[3];
#if LANES == 1
        if (is_square(&w)) {
            VECTOR(int) covered = cover(&w, x + w.left * SUBPIXELS, y + w.top * SUBPIXELS, SQUARE_COLUMNS, SQUARE_ROWS, weight);
            for (int row = w.top; row <= w.bottom; ++row)
                for (int column = w.left; column <= w.right; ++column)
                    ((uint *)counts)[row * TILE + column] -=
                        ((const int *)&covered)[(row - w.top) * SQUARE + column - w.left];
            continue;
        }
#endif
        FOR_EACH_STRIP(w, lane, s, own) {
            int column = (s % STRIPS_A_ROW) * STRIP, row = s / STRIPS_A_ROW;
            VECTOR(int) covered = cover(&w, x + column * SUBPIXELS, y + row * SUBPIXELS, STRIP_COLUMNS, STRIP_ROWS, weight);
            // The last strip of a row may reach beyond the image, and so may the triangle.
            covered &= STRIP_COLUMNS <= (VECTOR(int))(w.right - column);
            counts[own] -= PASTE(as_, VECTOR(uint))(covered);
        }
    }

    for (int own = 0; own < STRIPS_A_LANE; ++own)
        *(local VECTOR(uint) *)(prefix + (own * LANES + lane) * STRIP) = counts[own];
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane == 0) {
        uint sum = 0, deepest = 0;
        for (int p = 0; p < TILE_PIXELS; ++p) {
            deepest = MAX(deepest, prefix[p]);
            prefix[p] = sum += prefix[p];
        }
        tile_totals[tile] = (uint2)(sum, deepest);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int p = lane; p < TILE_PIXELS; p += LANES) pixel_end[tile * TILE_PIXELS + p] = prefix[p];
}

#if FRAGMENT_COLOR
// Colour of one fragment: weights of the face's vertices, not yet divided by their sum.
INLINE float4 shade(const float vertex_weight[3], uint source, global const uint *faces,
                           global const void *palette, global const float *normals, float3 view_direction)
{
    // Snapping can push a weight below zero by 1/512 pixel's worth; colours stay within those of the corners.
    float a = MAX(vertex_weight[0], 0.0f), b = MAX(vertex_weight[1], 0.0f), c = MAX(vertex_weight[2], 0.0f);
    float scale = 1.0f / (a + b + c);
    a *= scale, b *= scale, c *= scale;
    uint3 face = load_face(faces, source);
#if COLOR_RATE_VERTEX
    float4 color = a * palette_color(palette, face.x) + b * palette_color(palette, face.y) +
                   c * palette_color(palette, face.z);
#else
    float4 color = palette_color(palette, COLOR_RATE_FACE ? source : 0);
#endif
#if HEADLIGHT
    float3 n = a * load3(normals, face.x) + b * load3(normals, face.y) + c * load3(normals, face.z);
    float length2 = n.x * n.x + n.y * n.y + n.z * n.z;
    float facing = n.x * view_direction.x + n.y * view_direction.y + n.z * view_direction.z;
    float cosine = length2 > 0.0f ? MIN(fabs(facing) / sqrt(length2), 1.0f) : 1.0f;
    color.xyz *= AMBIENT + (1.0f - AMBIENT) * cosine;
#endif
    return color;
}
#endif

// Where fragments go, and what colours them.
typedef struct {
    global const uint *faces;
    global const void *palette;
    global const float *normals;
    float3 view_direction;
    uint capacity;
    global ulong *fragments;
    global float4 *colors;
} Target;

// Emits a record's fragments within a block: its samples `from` .. `to` of each row, `pitch` samples apart.
// next: places for the block's first sample and those after it, a row of the tile apart.
INLINE void emit_block(const Target *target, global const Triangle *t, const float *corner_weight, uint payload,
                       VECTOR(int) covered, const VECTOR(float) *weight, int rows, int from, int to, int pitch,
                       uint *next)
{
    VECTOR(float) depth = t->depth[0] + (weight[1] * t->depth[1] + weight[2] * t->depth[2]) * t->inverse_area;
    depth = MAX(depth, (VECTOR(float))(t->depth_min));
    depth = MIN(depth, (VECTOR(float))(t->depth_max));
    VECTOR(uint) key = DEPTH_KEY(VECTOR(uint), depth);
    for (int row = 0; row < rows; ++row)
        for (int column = from; column <= to; ++column) {
            int k = row * pitch + column;
            if (!((const int *)&covered)[k]) continue;
            uint at = next[row * TILE + column]++;
            if (at >= target->capacity) continue;
#if FRAGMENT_COLOR
            float vertex_weight[3];
            for (int j = 0; j < 3; ++j)
                vertex_weight[j] = ((const float *)&weight[0])[k] * corner_weight[j] +
                                   ((const float *)&weight[1])[k] * corner_weight[3 + j] +
                                   ((const float *)&weight[2])[k] * corner_weight[6 + j];
            target->colors[at] = shade(vertex_weight, t->source, target->faces, target->palette, target->normals,
                                       target->view_direction);
            payload = at;
#endif
            target->fragments[at] = (ulong)((const uint *)&key)[k] << 32 | payload;
        }
}

// A window is a run of fragments of the batch: positions are relative to its first, and those outside `capacity` (a tile
// too deep for one window) are left to the others.
kernel void emit_fragments(global const Triangle *triangles, global const uint *pair_start,
                           global const uint *pairs, uint first_tile, uint window_tile,
                           int columns, int width, int height, global const uint *pixel_end,
                           global const uint *tile_start, uint capacity, global const uint *faces,
                           global const void *palette, global const float *weights, global const float *normals,
                           float view_x, float view_y, float view_z, global ulong *fragments, global float4 *colors)
{
    uint tile = window_tile + get_group_id(0);
    int lane = get_local_id(0);
    int tile_x = (int)((first_tile + tile) % columns) * TILE, tile_y = (int)((first_tile + tile) / columns) * TILE;
    int x = sample_at(tile_x, width), y = sample_at(tile_y, height);
    Target target = {faces, palette, normals, (float3)(view_x, view_y, view_z), capacity, fragments, colors};
    uint next[STRIPS_A_LANE * STRIP];
    for (int own = 0; own < STRIPS_A_LANE; ++own)
        for (int k = 0; k < STRIP; ++k) {
            int p = (own * LANES + lane) * STRIP + k;
            next[own * STRIP + k] = tile_start[get_group_id(0)] + (p ? pixel_end[tile * TILE_PIXELS + p - 1] : 0);
        }

    for (uint pair = pair_start[tile], end = pair_start[tile + 1]; pair < end; ++pair) {
        if (pair + PREFETCH_DISTANCE < end) PREFETCH(triangles + pairs[pair + PREFETCH_DISTANCE]);
        uint record = pairs[pair], payload = 0;
        global const Triangle *t = triangles + record;
        Walk w;
        walk_of(t, tile_x, tile_y, &w);
        VECTOR(float) weight[3];
        float corner_weight[9];
#if FRAGMENT_COLOR
        for (int k = 0; k < 9; ++k) corner_weight[k] = weights[9 * record + k];
#else
        payload = face_payload(palette, t->source);
#endif
#if LANES == 1
        if (is_square(&w)) {
            VECTOR(int) covered = cover(&w, x + w.left * SUBPIXELS, y + w.top * SUBPIXELS, SQUARE_COLUMNS, SQUARE_ROWS, weight);
            emit_block(&target, t, corner_weight, payload, covered, weight, w.bottom - w.top + 1, 0, w.right - w.left,
                       SQUARE, next + w.top * TILE + w.left);
            continue;
        }
#endif
        FOR_EACH_STRIP(w, lane, s, own) {
            int column = (s % STRIPS_A_ROW) * STRIP, row = s / STRIPS_A_ROW;
            VECTOR(int) covered = cover(&w, x + column * SUBPIXELS, y + row * SUBPIXELS, STRIP_COLUMNS, STRIP_ROWS, weight);
            emit_block(&target, t, corner_weight, payload, covered, weight, 1, MAX(w.left - column, 0),
                       MIN(w.right - column, STRIP - 1), STRIP, next + own * STRIP);
        }
    }
}
