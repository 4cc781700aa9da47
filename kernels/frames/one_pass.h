// One pass: the kernel of techniques that need each pixel's fragments once, such as sort and the weighted ones.
//
//   draw    a work-group draws tile after tile: it emits the fragments, resolves them, and composites the picture
//
// Groups take the next tile from a shared counter. So all of them have work to the end, even if a few tiles hold most
// fragments. All tiles of a group use the same slab of memory, which has room for `slab` fragments. There a tile's
// fragments are read while they are still in the device's caches, and need not travel through its memory.
//
// First all fragments of a tile go into rows of `rows` layers (stages/walk.h), so nothing has to be counted before.
// Some strips may have more layers than that, or than RUN_MAX. Their fragments are then emitted again, into lists, for
// as many pixels at once as the slab has room for. A tile is skipped if a single pixel of it does not fit the slab. The
// host then launches this kernel again with a larger slab, for these tiles only.
//
// Before it includes this file, the technique defines
//   resolve_strip(fragments, scratch, begin, step, count, colors, resolved)
//
// This blends the fragments of a strip into `resolved`, which comes with premultiplied colour 0 and transmittance 1.
// The count[k] fragments of pixel k are at begin[k], begin[k] + step, ... A technique with VALUES gets two arguments
// more, (..., resolved, parameters, found): numbers of its own, and where it puts what it finds besides colours
// (stages/composite.h), which comes as NOTHING. One with PARAMETERS gets (..., resolved, parameters). One with PLACED gets
// (..., resolved, place): the sample's column in the picture, and from the 16th bit on its row. One that loses what is
// behind so many fragments of a pixel says so by CUT_AFTER; the pixels where it does are counted.
#ifndef DRAW_H
#define DRAW_H

#ifndef PARAMETERS
#define PARAMETERS 0
#endif
#ifndef CUT_AFTER
#define CUT_AFTER ~0u
#endif
#ifndef PLACED
#define PLACED 0
#endif

#include "stages/opaque.h"

// Copies a strip to its place in the tile, but only the pixels where `here` is -1.
INLINE void put_where(VECTOR(int) here, const Colors *strip, local Colors *place)
{
    place->red = here ? strip->red : place->red;
    place->green = here ? strip->green : place->green;
    place->blue = here ? strip->blue : place->blue;
    place->alpha = here ? strip->alpha : place->alpha;
}

// The places in the picture of some pixels of a tile.
INLINE VECTOR(uint) places_of(uint tile, int columns, VECTOR(uint) pixel)
{
    const VECTOR(uint) side = (VECTOR(uint))(BLOCK), blocks = (VECTOR(uint))(BLOCKS_A_ROW);
    VECTOR(uint) block = pixel / (VECTOR(uint))(BLOCK_PIXELS), within = pixel % (VECTOR(uint))(BLOCK_PIXELS);
    VECTOR(uint) x = block % blocks * side + within % side + (VECTOR(uint))(tile % (uint)columns * TILE);
    VECTOR(uint) y = block / blocks * side + within / side + (VECTOR(uint))(tile / (uint)columns * TILE);
    return x | y << (VECTOR(uint))(16);
}

// layers_before: 0, or else only tiles whose deepest pixel has more layers than this are drawn; the launch before has
// put that number into tile_totals. rows, slab: layers of a strip, and fragments of a group, that there is room for.
// tile_totals, one for each tile of the batch: x fragments, y layers of the deepest pixel, z samples with an opaque
// surface, w pixels with fragments that are lost.
kernel void draw(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs, Screen screen,
                 volatile global uint *next_tile, uint to_tile, global const uint *faces, global const void *palette,
                 global const float *weights, global const float *normals, global const float *uv,
                 global const int *material_of, global const Material *materials, global const uint *textures,
                 global const Lighting *lighting, global const Wiring *wiring,
                 global const uint *wire_lists, global const Wire *wires,
                 uint layers_before, uint rows, uint slab,
                 global ulong *fragments, global ulong *scratch, global float4 *colors, global uint4 *tile_totals,
                 int side_bits, global const float4 *background, int gradient, global const uint *scales,
                 volatile global uint *clamped, global uint *image, global float4 *color,
                 global const float *parameters, global float *values)
{
    const Batch records = {triangles, pair_start, pairs, screen}, *batch = &records;
    const Shading colored = GIVEN_SHADING, *shading = &colored;
    local Colors layer[TILE_PIXELS / STRIP];
#if VALUES
    local Found found[TILE_PIXELS / STRIP];
    const Found nothing = NOTHING;
#endif
    // Where each pixel's list ends among those of the tile: inclusive prefix sums of the lengths, gaps included.
    local uint ends[TILE_PIXELS] __attribute__((aligned(64)));
    local uint taken, total, deepest, solid, cut;
#if LANES > 1
    local VECTOR(ulong) z_far[KEPT_STRIPS];
    local Colors *behind = layer;  // what is resolved is put over it
#endif
    Colors clear;
    clear_layer(&clear);
    uint held = MIN(rows, (uint)RUN_MAX) / ROWS * ROWS;
    size_t own_slab = (size_t)get_group_id(0) * (slab + FRAGMENT_PADDING);
    fragments += own_slab;
    if (scratch) scratch += own_slab;
    if (FRAGMENT_COLOR) colors += own_slab;
    for (;;) {
        if (LANE == 0) taken = atomic_inc(next_tile), total = deepest = solid = cut = 0;
        BARRIER;
        uint tile = UNIFORM(taken);
        if (tile >= to_tile) break;
        uint lane = LANE_IN(tile);
        bool wanted = layers_before == 0 || tile_totals[tile].y > layers_before;
        uint begin = pair_start[tile], end = pair_start[tile + 1];
#if LANES == 1
        VECTOR(ulong) z_far[KEPT_STRIPS];
        Colors behind[KEPT_STRIPS];
#endif
        if (MIXED && wanted) {
            uint transparent = transparent_from(triangles, pairs, begin, end);
            uint samples = draw_opaque(batch, shading, tile, transparent, z_far, behind);
            if (!BEHIND) begin = transparent;
#if BEHIND
            for (uint own = 0; own < STRIPS_A_LANE; ++own) behind[LANES == 1 ? own : own * LANES + lane] = clear;
#endif
            atomic_add(&solid, samples);
        }
        bool empty = begin == end;
        if (empty)
            for (uint own = 0; own < STRIPS_A_LANE; ++own) {
#if LANES == 1 || !MIXED
                layer[own * LANES + lane] = clear;
#endif
#if VALUES
                found[own * LANES + lane] = nothing;
#endif
            }
        // The first turn takes all pixels, in rows. Each further turn takes the pixels first .. last, in lists.
        bool lists = false;
        uint first = 0, last = TILE_PIXELS - 1;
        while (wanted && !empty && first < TILE_PIXELS) {
            VECTOR(uint) next[STRIPS_A_LANE];
            Layout layout = {STRIP, rows * STRIP, rows * STRIP};
            uint blocks = (1u << TILE_BLOCKS) - 1, start = 0;
            for (uint own = 0; own < STRIPS_A_LANE; ++own) next[own] = (VECTOR(uint))(IOTA);
            if (lists) {
                // As many pixels as the slab holds. Pixels without a list start beyond the room, so they emit nothing.
                layout = (Layout){1, slab, 0};
                start = first ? ends[first - 1] : 0, blocks = 0;
                last = TILE_PIXELS - 1;
                while (ends[last] - start > slab) --last;
                PLAIN_LOOP for (uint b = first / BLOCK_PIXELS; b <= last / BLOCK_PIXELS; ++b)
                    blocks |= (uint)(ends[(b + 1) * BLOCK_PIXELS - 1] != (b ? ends[b * BLOCK_PIXELS - 1] : 0)) << b;
                PLAIN_LOOP for (uint own = 0; own < STRIPS_A_LANE; ++own)
                    PLAIN_LOOP for (uint k = 0; k < STRIP; ++k) {
                        uint p = (own * LANES + lane) * STRIP + k, begin = p ? ends[p - 1] : 0;
                        SET_ELEMENT(uint, next[own], k, ends[p] != begin ? begin - start : slab);
                    }
            }
            emit_tile(batch, shading, tile, begin, blocks, z_far, &layout, next, fragments, colors, 0);

            uint sum = 0, most = 0, losing = 0;
            for (uint own = 0; own < STRIPS_A_LANE; ++own) {
                uint strip = own * LANES + lane, p = strip * STRIP;
                VECTOR(uint) pixel = (VECTOR(uint))(p) + (VECTOR(uint))(IOTA), begin, count;
                VECTOR(int) here = (VECTOR(int))(-1);
                if (lists) {
                    VECTOR(uint) end = *(local const VECTOR(uint) *)(ends + p);
                    PLAIN_LOOP for (int k = 0; k < STRIP; ++k)
                        SET_ELEMENT(uint, begin, k, p + k ? ends[p + k - 1] : 0);
                    here = pixel >= (VECTOR(uint))(first) && pixel <= (VECTOR(uint))(last) && end != begin;
                    count = here ? end - begin - LIST_GAP : (VECTOR(uint))(0);
                    begin -= start;
                } else {
                    begin = (VECTOR(uint))(strip * layout.strip_room) + (VECTOR(uint))(IOTA);
                    count = next[own] / (VECTOR(uint))(STRIP);
                    uint layers = largest(count);
                    STRIP_LOOP for (int k = 0; k < STRIP; ++k) sum += ((const uint *)&count)[k];
                    most = MAX(most, layers);
                    losing += POPCOUNT(BITS_OF(count > (VECTOR(uint))(CUT_AFTER)));
                    VECTOR(int) listed = count > (VECTOR(uint))(0) && (VECTOR(int))(layers > held ? -1 : 0);
                    // A strip with too many layers is left to the lists: the lengths of its lists are noted here, and
                    // summed below.
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
#elif PARAMETERS
                resolve_strip(fragments, scratch, begin, layout.step, count, own_colors, &resolved, parameters);
#elif PLACED
                VECTOR(uint) place = places_of(screen.first_tile + tile, screen.columns, pixel);
                resolve_strip(fragments, scratch, begin, layout.step, count, own_colors, &resolved, place);
#else
                resolve_strip(fragments, scratch, begin, layout.step, count, own_colors, &resolved);
#endif
#if LANES > 1 && MIXED
                Colors under = behind[strip];
                put_over(&resolved, &under);
#endif
                put_where(here, &resolved, layer + strip);
            }
            first = last + 1;
            if (!lists) {
                atomic_add(&total, sum);
                atomic_max(&deepest, most);
                if (losing) atomic_add(&cut, losing);
                BARRIER;
                if (deepest > held && deepest + LIST_GAP <= slab) first = 0, lists = true;
                if (lane == 0) {
                    tile_totals[tile] = (uint4)(total, deepest, solid, cut);
                    PLAIN_LOOP for (uint p = 1; lists && p < TILE_PIXELS; ++p) ends[p] += ends[p - 1];
                }
                BARRIER;
            }
        }
#if LANES == 1
        for (uint own = 0; MIXED && wanted && own < STRIPS_A_LANE; ++own) {
            Colors over = layer[own];
            put_over(&over, behind + own);
            layer[own] = over;
        }
#endif
        BARRIER;
        if (empty && lane == 0) tile_totals[tile] = (uint4)(0, 0, solid, 0);
        if (wanted && deepest + LIST_GAP <= slab) {
            uint beyond = composite_tile(layer, screen.first_tile + tile, screen.columns, side_bits, screen.width,
                                         screen.height, background, gradient, scales, image, color);
            if (beyond) atomic_add(clamped, beyond);
#if VALUES
            store_values(found, screen.first_tile + tile, screen.columns, side_bits, screen.width,
                         screen.height, values);
#endif
        }
        BARRIER;
    }
}

#endif
