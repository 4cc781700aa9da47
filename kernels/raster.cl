// Rasterization: how many fragments there are, and all of them (raster.h).
//
//   count_fragments   one work-group a tile: how many fragments each pixel gets
//   emit_fragments    the same walk again: writes them where the counts say
//
//   tile_totals:  fragments of the tile, and of its deepest pixel
#include "raster.h"

kernel void count_fragments(global const Triangle *triangles, global const uint *pair_start,
                            global const uint *pairs, uint first_tile, int columns, int width,
                            int height, global ushort *pair_blocks, global uint *pixel_end, global uint2 *tile_totals)
{
    local uint prefix[TILE_PIXELS] __attribute__((aligned(64)));
    uint tile = get_group_id(0);
    ENTER_TILE
    VECTOR(uint) counts[STRIPS_A_LANE];
    for (int own = 0; own < STRIPS_A_LANE; ++own) counts[own] = (VECTOR(uint))(0);

    FOR_EACH_RECORD
        uint covers = 0;
        FOR_EACH_BLOCK(blocks_met(&walks, n, &w, lane)) {
            int block = LOWEST_BIT(left);
            VECTOR(float) weight[3];
            VECTOR(int) covered = cover(&w, block, weight);
            if (beyond) covered &= in_image(block, lane, width - tile_x, height - tile_y);
            counts[OWN(block)] -= PASTE(as_, VECTOR(uint))(covered);
            if (LANES == 1) covers |= (uint)(BITS_OF(covered) != 0) << block;
        }
        if (LANES == 1) pair_blocks[batch + n] = (ushort)covers;
    }}

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

// A window is a run of fragments of the batch, of whole tiles or of a part of one: its positions are relative to its first.
kernel void emit_fragments(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                           global const ushort *pair_blocks, uint first_tile, uint window_tile, int columns, int width, int height,
                           global const uint *pixel_end, global const uint *tile_start, uint window_start, uint capacity,
                           global const uint *faces, global const void *palette, global const float *weights,
                           global const float *normals, float view_x, float view_y, float view_z,
                           global ulong *fragments, global float4 *colors)
{
    uint tile = window_tile + get_group_id(0);
    emit_tile(triangles, pair_start, pairs, pair_blocks, tile, first_tile, columns, width, height, pixel_end,
              window_start - tile_start[tile], capacity, faces, palette, weights, normals,
              (float3)(view_x, view_y, view_z), fragments, colors);
}
