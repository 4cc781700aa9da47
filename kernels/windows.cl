// Windows: fragments in the device's memory, for techniques that go through them more than once.
//
//   emit_fragments    one work-group a tile: the walk of count_fragments again, writing the fragments (raster.h)
//
#include "raster.h"

// A window is a run of the batch's fragments, of whole tiles or of a part of one: positions are relative to its first.
kernel void emit_fragments(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                           global const ushort *pair_blocks, uint first_tile, uint window_tile, int columns, int width,
                           int height, global const uint *pixel_end, global const uint *tile_start, uint window_start, uint capacity,
                           global const uint *faces, global const void *palette, global const float *weights,
                           global const float *normals, float view_x, float view_y, float view_z,
                           global ulong *fragments, global float4 *colors)
{
    uint tile = window_tile + get_group_id(0);
    emit_tile(triangles, pair_start, pairs, pair_blocks, tile, first_tile, columns, width, height, pixel_end, 0xFFFF,
              window_start - tile_start[tile], capacity, faces, palette, weights, normals,
              (float3)(view_x, view_y, view_z), fragments, colors);
}
