// Scenes with nothing transparent: one pass draws them, whatever the technique, as there is nothing to peel, sort or
// add up.
//
//   draw    a work-group takes tile after tile: draws colour and z-far (stages/opaque.h), then composites the picture
#include "stages/opaque.h"

// tile_samples: how many samples of each tile have a surface.
kernel void draw(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                 uint first_tile, volatile global uint *next_tile, uint to_tile, int columns, int width, int height,
                 float depth_scale, global const uint *faces, global const void *palette, global const float *weights,
                 global const float *normals, float view_x, float view_y, float view_z, global uint *tile_samples,
                 int side_bits, int picture_width, int picture_height, float red, float green, float blue,
                 int has_background, int keep_color, volatile global uint *clamped, global uint *image,
                 global float4 *color, global const float *parameters, global float *values)
{
    local Colors layer[TILE_PIXELS / STRIP];
    local uint taken, solid;
    for (;;) {
        if (LANE == 0) taken = atomic_inc(next_tile), solid = 0;
        BARRIER;
        uint tile = taken;
        if (tile >= to_tile) break;
        VECTOR(ulong) z_far[STRIPS_A_LANE];
        Colors behind[STRIPS_A_LANE];
        uint samples = draw_opaque(triangles, pair_start, pairs, tile, pair_start[tile + 1], first_tile, columns, width, height,
                                   depth_scale, faces, palette, weights, normals, (float3)(view_x, view_y, view_z), z_far,
                                   behind);
        atomic_add(&solid, samples);
        for (int own = 0; own < STRIPS_A_LANE; ++own) layer[own * LANES + LANE] = behind[own];
        BARRIER;
        if (LANE == 0) tile_samples[tile] = solid;
        composite_tile(layer, first_tile + tile, columns, side_bits, picture_width, picture_height, red, green, blue,
                       has_background, keep_color, image, color);
        BARRIER;
    }
}
