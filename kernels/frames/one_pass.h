// Drawing: what a technique that goes through a pixel's fragments once is built into.
//
//   draw    a work-group draws tile after tile: emits the fragments, resolves them, composites the picture
//
// Groups take the tiles as they come to them, so that all have work to the end, whichever tiles are full.
// A group's tiles put their fragments one after the other into the same place, `slab` long, where they are read while they
// are still in the device's caches: they never cross its memory.
//
// First all fragments go into rows of `rows` layers (raster.h), so that nothing needs to be counted before. Strips with more
// layers than that, or than RUN_MAX, are then emitted again, into lists, as many pixels at once as the slab holds. A tile with
// a pixel that it does not hold is left out, and drawn when it is asked for again with a larger one.
//
// The technique defines, before it includes this,
//   resolve_strip(fragments, scratch, begin, step, count, colors, resolved)
// which blends the count[k] fragments at begin[k], begin[k] + step, ... of a strip's pixels into `resolved`, from premultiplied
// colour 0 and transmittance 1.
// With VALUES it gets two more, (..., resolved, parameters, found): what it finds of a pixel besides (composite.h), from 0, and
// what it is told for that.
#ifndef DRAW_H
#define DRAW_H

#include "stages/opaque.h"

// Puts those of a strip's pixels that are `here` into place.
INLINE void put_where(VECTOR(int) here, const Colors *strip, local Colors *place)
{
    place->red = here ? strip->red : place->red;
    place->green = here ? strip->green : place->green;
    place->blue = here ? strip->blue : place->blue;
    place->alpha = here ? strip->alpha : place->alpha;
}

// tile_totals: fragments of the tile, of its deepest pixel, and samples with an opaque surface. layers_before: only tiles
// deeper than that, if it is not 0.
kernel void draw(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                 uint first_tile, volatile global uint *next_tile, uint to_tile, int columns, int width, int height,
                 float depth_scale, global const uint *faces, global const void *palette, global const float *weights,
                 global const float *normals, float view_x, float view_y, float view_z, uint layers_before, uint rows,
                 uint slab, global ulong *fragments, global ulong *scratch, global float4 *colors, global uint4 *tile_totals,
                 int side_bits, int picture_width, int picture_height, float red, float green, float blue,
                 int has_background, int keep_color, volatile global uint *clamped, global uint *image,
                 global float4 *color, global const float *parameters, global float *values)
{
    local Colors layer[TILE_PIXELS / STRIP];
#if VALUES
    local Found found[TILE_PIXELS / STRIP];
    const Found nothing = NOTHING;
#endif
    local uint ends[TILE_PIXELS] __attribute__((aligned(64)));  // inclusive prefix sum of the lists' room
    local uint taken, total, deepest, solid;
    const Colors clear = {(VECTOR(float))(0.0f), (VECTOR(float))(0.0f), (VECTOR(float))(0.0f), (VECTOR(float))(1.0f)};
    const float3 view = (float3)(view_x, view_y, view_z);
    uint lane = get_local_id(0), held = MIN(rows, (uint)RUN_MAX) / ROWS * ROWS;
    size_t own_slab = (size_t)get_group_id(0) * (slab + FRAGMENT_PADDING);
    fragments += own_slab;
    if (scratch) scratch += own_slab;
    if (FRAGMENT_COLOR) colors += own_slab;
    for (;;) {
        if (lane == 0) taken = atomic_inc(next_tile), total = deepest = solid = 0;
        barrier(CLK_LOCAL_MEM_FENCE);
        uint tile = taken;
        if (tile >= to_tile) break;
        bool wanted = layers_before == 0 || tile_totals[tile].y > layers_before;
        uint begin = pair_start[tile], end = pair_start[tile + 1];
        VECTOR(ulong) z_far[STRIPS_A_LANE];
        Colors behind[STRIPS_A_LANE];
        if (MIXED && wanted) {
            begin = transparent_from(triangles, pairs, begin, end);
            uint samples = draw_opaque(triangles, pair_start, pairs, tile, begin, first_tile, columns, width, height, depth_scale,
                                       faces, palette, weights, normals, view, z_far, behind);
            atomic_add(&solid, samples);
        }
        bool empty = begin == end;
        if (empty)
            for (uint own = 0; own < STRIPS_A_LANE; ++own) {
                layer[own * LANES + lane] = clear;
#if VALUES
                found[own * LANES + lane] = nothing;
#endif
            }
        bool lists = false;
        uint first = 0, last = TILE_PIXELS - 1;
        while (wanted && !empty && first < TILE_PIXELS) {
            VECTOR(uint) next[STRIPS_A_LANE];
            Layout layout = {STRIP, rows * STRIP, rows * STRIP};
            uint blocks = (1u << TILE_BLOCKS) - 1, start = 0;
            for (uint own = 0; own < STRIPS_A_LANE; ++own) next[own] = (VECTOR(uint))(IOTA);
            if (lists) {
                layout = (Layout){1, slab, 0};
                start = first ? ends[first - 1] : 0, blocks = 0;
                last = TILE_PIXELS - 1;
                while (ends[last] - start > slab) --last;
                for (uint b = first / BLOCK_PIXELS; b <= last / BLOCK_PIXELS; ++b)
                    blocks |= (uint)(ends[(b + 1) * BLOCK_PIXELS - 1] != (b ? ends[b * BLOCK_PIXELS - 1] : 0)) << b;
                for (uint own = 0; own < STRIPS_A_LANE; ++own)
                    for (uint k = 0; k < STRIP; ++k) {
                        uint p = (own * LANES + lane) * STRIP + k, begin = p ? ends[p - 1] : 0;
                        ((uint *)(next + own))[k] = ends[p] != begin ? begin - start : slab;
                    }
            }
            emit_tile(triangles, pair_start, pairs, tile, begin, first_tile, columns, width, height, depth_scale, blocks,
                      z_far, &layout, next, faces, palette, weights, normals, view, fragments, colors, 0);

            uint sum = 0, most = 0;
            for (uint own = 0; own < STRIPS_A_LANE; ++own) {
                uint strip = own * LANES + lane, p = strip * STRIP;
                VECTOR(uint) pixel = (VECTOR(uint))(p) + (VECTOR(uint))(IOTA), begin, count;
                VECTOR(int) here = (VECTOR(int))(-1);
                if (lists) {
                    VECTOR(uint) end = *(local const VECTOR(uint) *)(ends + p);
                    for (int k = 0; k < STRIP; ++k) ((uint *)&begin)[k] = p + k ? ends[p + k - 1] : 0;
                    here = pixel >= (VECTOR(uint))(first) && pixel <= (VECTOR(uint))(last) && end != begin;
                    count = here ? end - begin - LIST_GAP : (VECTOR(uint))(0);
                    begin -= start;
                } else {
                    begin = (VECTOR(uint))(strip * layout.strip_room) + (VECTOR(uint))(IOTA);
                    count = next[own] / (VECTOR(uint))(STRIP);
                    uint layers = largest(count);
                    for (int k = 0; k < STRIP; ++k) sum += ((const uint *)&count)[k];
                    most = MAX(most, layers);
                    VECTOR(int) listed = count > (VECTOR(uint))(0) && (VECTOR(int))(layers > held ? -1 : 0);
                    *(local VECTOR(uint) *)(ends + p) = listed ? count + LIST_GAP : (VECTOR(uint))(0);
                    if (layers > held) count = (VECTOR(uint))(0);
                }
                Colors resolved = clear;
                global const void *own_colors = FRAGMENT_COLOR ? (global const void *)colors : palette;
#if VALUES
                Found measured = nothing;
                resolve_strip(fragments, scratch, begin, layout.step, count, own_colors, &resolved, parameters, &measured);
#if BOUNDED
                found[strip] = here ? measured : found[strip];
#else
                put_where(here, &measured, found + strip);
#endif
#else
                resolve_strip(fragments, scratch, begin, layout.step, count, own_colors, &resolved);
#endif
                put_where(here, &resolved, layer + strip);
            }
            first = last + 1;
            if (!lists) {
                atomic_add(&total, sum);
                atomic_max(&deepest, most);
                barrier(CLK_LOCAL_MEM_FENCE);
                if (deepest > held && deepest + LIST_GAP <= slab) first = 0, lists = true;
                if (lane == 0) {
                    tile_totals[tile] = (uint4)(total, deepest, solid, 0);
                    for (uint p = 1; lists && p < TILE_PIXELS; ++p) ends[p] += ends[p - 1];
                }
                barrier(CLK_LOCAL_MEM_FENCE);
            }
        }
        for (uint own = 0; MIXED && wanted && own < STRIPS_A_LANE; ++own) {
            Colors over = layer[own * LANES + lane];
            put_over(&over, behind + own);
            layer[own * LANES + lane] = over;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        if (empty && lane == 0) tile_totals[tile] = (uint4)(0, 0, solid, 0);
        if (wanted && deepest + LIST_GAP <= slab) {
            uint beyond = composite_tile(layer, first_tile + tile, columns, side_bits, picture_width, picture_height, red, green,
                                         blue, has_background, keep_color, image, color);
            if (beyond) atomic_add(clamped, beyond);
#if VALUES
            store_values(found, first_tile + tile, columns, side_bits, picture_width, picture_height, values);
#endif
        }
        barrier(CLK_LOCAL_MEM_FENCE);
    }
}

#endif
