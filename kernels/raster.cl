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

INLINE Edge edge_of(global const Triangle *t, int a, int b)
{
    Edge e = {t->x[b] - t->x[a], t->y[b] - t->y[a], t->x[a], t->y[a], 0};
    e.bias = e.dy < 0 || (e.dy == 0 && e.dx > 0) ? 0 : -1;
    return e;
}

typedef struct {
    Edge edge[3];  // edge k is opposite corner k: E is twice the area of the sub-triangle that weighs corner k
    int left, right, top, bottom;  // pixels of the tile to look at
    bool small;  // E fits 32 bits all over the tile
} Walk;

INLINE Walk walk_of(global const Triangle *t, ushort4 bounds, int tile_x, int tile_y)
{
    Walk w;
    w.edge[0] = edge_of(t, 1, 2), w.edge[1] = edge_of(t, 2, 0), w.edge[2] = edge_of(t, 0, 1);
    w.left = MAX(bounds.x - tile_x, 0), w.right = MIN(bounds.y - tile_x, TILE - 1);
    w.top = MAX(bounds.z - tile_y, 0), w.bottom = MIN(bounds.w - tile_y, TILE - 1);
    w.small = t->small;
    return w;
}

// E at a strip's samples, in 32 bits where proven to fit and in 64 elsewhere: the same integers either way.
#define DEFINE_EDGE_VALUES(name, integer)                                                                       \
    INLINE VECTOR(integer) name(Edge e, int x, int y)                                                    \
    {                                                                                                           \
        integer first = (integer)e.dx * (y - e.y) - (integer)e.dy * (x - e.x);                                  \
        return (VECTOR(integer))(first) - (VECTOR(integer))((integer)e.dy * SUBPIXELS) * (VECTOR(integer))(IOTA); \
    }
DEFINE_EDGE_VALUES(edge_values_small, int)
DEFINE_EDGE_VALUES(edge_values_large, long)

// Coverage of a strip, -1 or 0 a pixel, and the barycentric weights times twice the area, each rounded once.
INLINE VECTOR(int) cover(const Walk *w, int column, int x, int y, VECTOR(float) weight[3])
{
    // The last strip of a row may reach beyond the image, and so may the triangle.
    VECTOR(int) covered = (VECTOR(int))(IOTA) <= (VECTOR(int))(w->right - column);
    if (w->small) {
        for (int k = 0; k < 3; ++k) {
            VECTOR(int) e = edge_values_small(w->edge[k], x, y);
            covered &= (e + (VECTOR(int))(w->edge[k].bias)) >= (VECTOR(int))(0);
            weight[k] = CONVERT(float, STRIP, e);
        }
    } else {
        for (int k = 0; k < 3; ++k) {
            VECTOR(long) e = edge_values_large(w->edge[k], x, y);
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

kernel void count_fragments(global const Triangle *triangles, global const ushort4 *bounds,
                           global const uint *pair_start, global const uint *pairs,
                            uint first_tile, int columns, int width, int height,
                            global uint *pixel_end, global uint2 *tile_totals)
{
    local uint prefix[TILE_PIXELS] __attribute__((aligned(64)));
    uint tile = get_group_id(0);
    int lane = get_local_id(0);
    int tile_x = (int)((first_tile + tile) % columns) * TILE, tile_y = (int)((first_tile + tile) / columns) * TILE;
    VECTOR(uint) counts[STRIPS_A_LANE];
    for (int own = 0; own < STRIPS_A_LANE; ++own) counts[own] = (VECTOR(uint))(0);

    for (uint k = pair_start[tile]; k < pair_start[tile + 1]; ++k) {
        uint record = pairs[k];
        Walk w = walk_of(triangles + record, bounds[record], tile_x, tile_y);
        VECTOR(float) weight[3];
        FOR_EACH_STRIP(w, lane, s, own) {
            int column = (s % STRIPS_A_ROW) * STRIP;
            int x = sample_at(tile_x + column, width), y = sample_at(tile_y + s / STRIPS_A_ROW, height);
            counts[own] -= PASTE(as_, VECTOR(uint))(cover(&w, column, x, y, weight));
        }
    }

    for (int own = 0; own < STRIPS_A_LANE; ++own) *(local VECTOR(uint) *)(prefix + (own * LANES + lane) * STRIP) = counts[own];
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

// A window is a run of fragments of the batch: positions are relative to its first, and those outside `capacity` (a tile
// too deep for one window) are left to the others.
kernel void emit_fragments(global const Triangle *triangles, global const ushort4 *bounds,
                           global const uint *pair_start, global const uint *pairs,
                           uint first_tile, uint window_tile, int columns, int width, int height,
                           global const uint *pixel_end, global const uint *tile_start, uint capacity,
                           global const uint *faces, global const void *palette, global const float *weights,
                           global const float *normals, float view_x, float view_y, float view_z,
                           global ulong *fragments, global float4 *colors)
{
    uint tile = window_tile + get_group_id(0);
    int lane = get_local_id(0);
    int tile_x = (int)((first_tile + tile) % columns) * TILE, tile_y = (int)((first_tile + tile) / columns) * TILE;
    VECTOR(uint) next[STRIPS_A_LANE];
    for (int own = 0; own < STRIPS_A_LANE; ++own)
        for (int k = 0; k < STRIP; ++k) {
            int p = (own * LANES + lane) * STRIP + k;
            ((uint *)&next[own])[k] = tile_start[get_group_id(0)] + (p ? pixel_end[tile * TILE_PIXELS + p - 1] : 0);
        }

    for (uint pair = pair_start[tile]; pair < pair_start[tile + 1]; ++pair) {
        uint record = pairs[pair];
        global const Triangle *t = triangles + record;
        Walk w = walk_of(t, bounds[record], tile_x, tile_y);
        float d0 = t->depth[0], d1 = t->depth[1], d2 = t->depth[2];
        VECTOR(float) weight[3];
#if FRAGMENT_COLOR
        float corner_weight[9];
        for (int k = 0; k < 9; ++k) corner_weight[k] = weights[9 * record + k];
#else
        uint payload = face_payload(palette, t->source);
#endif
        FOR_EACH_STRIP(w, lane, s, own) {
            int column = (s % STRIPS_A_ROW) * STRIP;
            int x = sample_at(tile_x + column, width), y = sample_at(tile_y + s / STRIPS_A_ROW, height);
            VECTOR(int) coverage = cover(&w, column, x, y, weight);
            VECTOR(float) depth = ((weight[0] * d0 + weight[1] * d1) + weight[2] * d2) * t->inverse_area;
            depth = MAX(depth, (VECTOR(float))(t->depth_min));
            depth = MIN(depth, (VECTOR(float))(t->depth_max));
            VECTOR(uint) key = DEPTH_KEY(VECTOR(uint), depth), place = next[own];
            next[own] -= PASTE(as_, VECTOR(uint))(coverage);
            coverage &= place < (VECTOR(uint))(capacity);
            for (int k = MAX(w.left - column, 0); k <= MIN(w.right - column, STRIP - 1); ++k) {
                if (!((const int *)&coverage)[k]) continue;
                uint at = ((const uint *)&place)[k];
#if FRAGMENT_COLOR
                float vertex_weight[3];
                for (int j = 0; j < 3; ++j)
                    vertex_weight[j] = ((const float *)&weight[0])[k] * corner_weight[j] +
                                       ((const float *)&weight[1])[k] * corner_weight[3 + j] +
                                       ((const float *)&weight[2])[k] * corner_weight[6 + j];
                colors[at] = shade(vertex_weight, t->source, faces, palette, normals, (float3)(view_x, view_y, view_z));
                uint payload = at;
#endif
                fragments[at] = (ulong)((const uint *)&key)[k] << 32 | payload;
            }
        }
    }
}
