// Windows: fragments in the device's memory, in lists (stages/walk.h), for finding layers (stages/find_layers.cl).
//
//   count_fragments   a tile a work-group: counts the fragments of each pixel
//   emit_fragments    a tile a work-group: walks its records once more, and writes the fragments
//
//   pixel_end     where each pixel's list ends among those of its tile: inclusive prefix sums of the counts, pixels in
//                 the order of base/common.h
//   tile_totals   fragments of the tile, and fragments of its deepest pixel
#include "stages/opaque.h"

// z_far: of each pixel of the tiles, where surfaces are MIXED; else NULL.
kernel void count_fragments(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                            Screen screen, global const uint *faces, global const void *palette,
                            global const float *weights, global const float *normals, global const float *uv,
                            global const int *material_of, global const Material *materials,
                            global const uint *textures,
                        global const Lighting *lighting, global const Wiring *wiring,
                 global const uint *wire_lists, global const Wire *wires, global const ulong *z_far, global uint *pixel_end,
                            global uint2 *tile_totals)
{
    const Batch records = {triangles, pair_start, pairs, screen}, *batch = &records;
    const Shading colored = GIVEN_SHADING, *shading = &colored;
    local uint prefix[TILE_PIXELS] __attribute__((aligned(64)));
    uint tile = get_group_id(0);
    ENTER_TILE
    if (MIXED) list_begin = transparent_from(triangles, pairs, list_begin, list_end);
    VECTOR(uint) counts[STRIPS_A_LANE];
    for (int own = 0; own < STRIPS_A_LANE; ++own) counts[own] = (VECTOR(uint))(0);

    VISITS((1u << TILE_BLOCKS) - 1)
#if MIXED
    global const ulong *far = z_far + tile * TILE_PIXELS + block * BLOCK_PIXELS + FIRST_PIXEL;
    covered &= is_in_front(keys_of(t, weight, screen.depth_scale), t->source, *(global const VECTOR(ulong) *)far);
#endif
    ROUTE(false)
    count_up(counts + OWN(block), covered);
    END_VISITS

    for (int own = 0; own < STRIPS_A_LANE; ++own)
        *(local VECTOR(uint) *)(prefix + (own * LANES + lane) * STRIP) = counts[own];
    BARRIER;
    if (lane == 0) {
        uint sum = 0, deepest = 0;
        for (int p = 0; p < TILE_PIXELS; ++p) {
            deepest = MAX(deepest, prefix[p]);
            prefix[p] = sum += prefix[p];
        }
        tile_totals[tile] = (uint2)(sum, deepest);
    }
    BARRIER;
    for (int p = lane; p < TILE_PIXELS; p += LANES) pixel_end[tile * TILE_PIXELS + p] = prefix[p];
}

// A window is a run of the batch's fragments, of whole tiles or of some pixels of one tile. Places are relative to its
// first fragment, modulo 2^32. A pixel outside of the window starts beyond `capacity`, so it emits nothing.
kernel void emit_fragments(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                           Screen screen, uint window_tile, global const uint *pixel_end, global const uint *tile_start,
                           uint window_start, uint capacity, global const uint *faces, global const void *palette,
                           global const float *weights, global const float *normals, global const float *uv,
                           global const int *material_of, global const Material *materials,
                           global const uint *textures,
                        global const Lighting *lighting, global const Wiring *wiring,
                 global const uint *wire_lists, global const Wire *wires, global ulong *fragments,
                           global float4 *colors, global uint *sources)
{
    const Batch records = {triangles, pair_start, pairs, screen}, *batch = &records;
    const Shading colored = GIVEN_SHADING, *shading = &colored;
    uint tile = window_tile + get_group_id(0);
    const Layout lists = {1, capacity, 0};
    VECTOR(uint) next[STRIPS_A_LANE];
    for (int own = 0; own < STRIPS_A_LANE; ++own)
        STRIP_LOOP for (int k = 0; k < STRIP; ++k) {
            int p = (own * LANES + LANE) * STRIP + k;
            ((uint *)(next + own))[k] = (p ? pixel_end[tile * TILE_PIXELS + p - 1] : 0) + tile_start[tile] - window_start;
        }
    emit_tile(batch, shading, tile, pair_start[tile], 0xFFFF, 0, &lists, next, fragments, colors, sources);
}
