// Rasterization: how many fragments there are (raster.h). Drawing goes the same way again, and has them (draw.h).
//
//   count_fragments   one work-group a tile: how many fragments each pixel gets
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

    for (uint at = pair_start[tile], end = pair_start[tile + 1]; at < end; at += WIDE) {
        Walks walks;
        uint ready = ready_walks(triangles, pairs, at, end, x, y, tile_x, tile_y, &walks);
        for (uint n = 0; n < ready; ++n) {
            Walk w;
            walk_of(&walks, n, &w);
            uint covers = 0;
            FOR_EACH_BLOCK(blocks_met(&walks, n, &w, lane)) {
                int block = LOWEST_BIT(left);
                VECTOR(float) weight[3];
                VECTOR(int) covered = cover(&w, block, weight);
                if (beyond) covered &= in_image(block, lane, width - tile_x, height - tile_y);
                counts[OWN(block)] -= PASTE(as_, VECTOR(uint))(covered);
                if (LANES == 1) covers |= (uint)(BITS_OF(covered) != 0) << block;
            }
            if (LANES == 1) pair_blocks[at + n] = (ushort)covers;
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
