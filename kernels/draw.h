// Drawing: what a technique that goes through a pixel's fragments once is built into.
//
//   draw    a work-group draws tile after tile: emits the fragments, resolves them, composites the picture
//
// Groups take the tiles as they come to them, so that all have work to the end, whichever tiles are full.
// A group's tiles put their fragments one after the other into the same place, `slab` long, where they are read while they
// are still in the device's caches: they never cross its memory. A tile that holds more is drawn in runs of pixels.
//
// The technique defines, before it includes this,
//   resolve_strip(fragments, scratch, begin, count, colors, resolved)
// which blends the fragments begin[k] .. begin[k] + count[k] of a strip's pixels into `resolved`, from premultiplied colour 0
// and transmittance 1.
#ifndef DRAW_H
#define DRAW_H

#include "composite.h"
#include "raster.h"

kernel void draw(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                 global const ushort *pair_blocks, uint first_tile, volatile global uint *next_tile, uint to_tile,
                 int columns, int width, int height, global const uint *pixel_end, global const uint *faces,
                 global const void *palette, global const float *weights, global const float *normals, float view_x,
                 float view_y, float view_z, uint slab, global ulong *fragments, global ulong *scratch,
                 global float4 *colors, int side_bits, int picture_width, int picture_height, float red, float green,
                 float blue, int has_background, int keep_color, volatile global uint *clamped, global uchar4 *image,
                 global float4 *color)
{
    local float4 layer[TILE_PIXELS];
    local uint taken;
    size_t own = (size_t)get_group_id(0) * (slab + FRAGMENT_PADDING);
    fragments += own;
    if (scratch) scratch += own;
    if (FRAGMENT_COLOR) colors += own;
    for (;;) {
        if (get_local_id(0) == 0) taken = atomic_inc(next_tile);
        barrier(CLK_LOCAL_MEM_FENCE);
        uint tile = taken;
        if (tile >= to_tile) break;
        global const uint *ends = pixel_end + tile * TILE_PIXELS;
        if (ends[TILE_PIXELS - 1] == 0)
            for (uint p = get_local_id(0); p < TILE_PIXELS; p += LANES) layer[p] = (float4)(0.0f, 0.0f, 0.0f, 1.0f);
        barrier(CLK_LOCAL_MEM_FENCE);
        for (uint first = ends[TILE_PIXELS - 1] ? 0 : TILE_PIXELS, last; first < TILE_PIXELS; first = last + 1) {
            uint start = first ? ends[first - 1] : 0;
            last = TILE_PIXELS - 1;
            while (ends[last] - start > slab) --last;
            uint blocks = (2u << last / BLOCK_PIXELS) - (1u << first / BLOCK_PIXELS);
            emit_tile(triangles, pair_start, pairs, pair_blocks, tile, first_tile, columns, width, height, pixel_end, blocks,
                      start, ends[last] - start, faces, palette, weights, normals, (float3)(view_x, view_y, view_z), fragments,
                      colors);
            barrier(CLK_GLOBAL_MEM_FENCE);
            for (uint p = get_local_id(0) * STRIP; p < TILE_PIXELS; p += LANES * STRIP) {
                VECTOR(uint) begin, end = *(global const VECTOR(uint) *)(ends + p);
                for (int k = 0; k < STRIP; ++k) ((uint *)&begin)[k] = p + k ? ends[p + k - 1] : 0;
                VECTOR(uint) pixel = (VECTOR(uint))(p) + (VECTOR(uint))(IOTA);
                VECTOR(int) here = pixel >= (VECTOR(uint))(first) && pixel <= (VECTOR(uint))(last);
                Colors resolved = {(VECTOR(float))(0.0f), (VECTOR(float))(0.0f), (VECTOR(float))(0.0f),
                                   (VECTOR(float))(1.0f)};
                resolve_strip(fragments, scratch, begin - start, here ? end - begin : (VECTOR(uint))(0),
                              FRAGMENT_COLOR ? (global const void *)colors : palette, &resolved);
                for (int k = 0; k < STRIP; ++k)
                    if (((const int *)&here)[k])
                        layer[p + k] = (float4)(((const float *)&resolved.red)[k], ((const float *)&resolved.green)[k],
                                                ((const float *)&resolved.blue)[k], ((const float *)&resolved.alpha)[k]);
            }
            barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
        }
        uint beyond = composite_tile(layer, first_tile + tile, columns, side_bits, picture_width, picture_height,
                                     (float4)(red, green, blue, has_background), keep_color, image, color);
        if (beyond) atomic_add(clamped, beyond);
        barrier(CLK_LOCAL_MEM_FENCE);
    }
}

#endif
