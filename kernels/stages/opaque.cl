// Scenes with nothing transparent: one pass draws them, whatever the technique, as there is nothing to peel, sort or
// add up.
//
//   draw    a work-group takes tile after tile: draws colour and z-far (stages/opaque.h), then composites the picture
#include "stages/opaque.h"

// tile_samples: how many samples of each tile have a surface.
kernel void draw(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs, Screen screen,
                 volatile global uint *next_tile, uint to_tile, global const uint *faces, global const void *palette,
                 global const float *weights, global const float *normals, global const float *uv,
                 global const int *material_of, global const Material *materials, global const uint *textures,
                 global const Lighting *lighting, global const Wiring *wiring,
                 global const uint *wire_lists, global const Wire *wires,
                 global uint *tile_samples, int side_bits,
                 global const float4 *background, int gradient, global const uint *scales,
                 volatile global uint *clamped, global uint *image, global float4 *color,
                 global const float *parameters, global float *values)
{
    const Batch records = {triangles, pair_start, pairs, screen}, *batch = &records;
    const Shading colored = GIVEN_SHADING, *shading = &colored;
    local Colors layer[TILE_PIXELS / STRIP];
    local uint taken, solid;
#if LANES > 1
    local VECTOR(ulong) z_far[KEPT_STRIPS];
#endif
    for (;;) {
        if (LANE == 0) taken = atomic_inc(next_tile), solid = 0;
        BARRIER;
        uint tile = UNIFORM(taken);
        if (tile >= to_tile) break;
#if LANES == 1
        VECTOR(ulong) z_far[KEPT_STRIPS];
        Colors behind[KEPT_STRIPS];
        uint samples = draw_opaque(batch, shading, tile, pair_start[tile + 1], z_far, behind);
        for (int own = 0; own < STRIPS_A_LANE; ++own) layer[own] = behind[own];
#else
        uint samples = draw_opaque(batch, shading, tile, pair_start[tile + 1], z_far, layer);
#endif
        atomic_add(&solid, samples);
        BARRIER;
        if (LANE == 0) tile_samples[tile] = solid;
        composite_tile(layer, screen.first_tile + tile, screen.columns, side_bits, screen.width,
                       screen.height, background, gradient, scales, image, color);
        BARRIER;
    }
}
