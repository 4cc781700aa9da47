// Counting: finds how many fragments each pixel has, and how much work a walk over its tile is. No fragment is kept,
// sorted or shaded.
//
//   count_layers    a work-group takes tile after tile: z-far of opaque records, then one walk over transparent ones
//
// ALL_OPAQUE: the scene has nothing transparent. Then all records are opaque, and their flags do not say so.
#include "stages/opaque.h"

#ifndef ALL_OPAQUE
#define ALL_OPAQUE 0
#endif

//   chosen         the tiles to examine, or NULL for all of the batch; tile_totals is in their order
//   layers         for each pixel of the image, rows from the top: how many fragments lie in front of the opaque
//                  surface, plus IS_OPAQUE where there is one; NULL if nobody wants them
//   tile_totals    COUNT_TOTALS words for each tile: fragments in front of opaque surfaces, and those of the deepest
//                  pixel; samples with an opaque surface; fragments of all surfaces, whatever lies in front, and those
//                  of the deepest pixel; strips visited for transparent records, and for opaque ones; opaque records
kernel void count_layers(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                         Screen screen, volatile global uint *next_tile, uint to_tile, global const uint *faces,
                         global const void *palette, global const float *weights, global const float *normals,
                         global const float *uv, global const int *material_of, global const Material *materials,
                         global const uint *textures,
                        global const Lighting *lighting, global const Wiring *wiring,
                 global const uint *wire_lists, global const Wire *wires, global const uint *chosen,
                         global uint *layers, global uint *tile_totals)
{
    const Batch records = {triangles, pair_start, pairs, screen}, *batch = &records;
    const Shading colored = GIVEN_SHADING, *shading = &colored;
    local uint taken, totals[COUNT_TOTALS];
    for (;;) {
        if (LANE == 0) {
            taken = atomic_inc(next_tile);
            for (int k = 0; k < COUNT_TOTALS; ++k) totals[k] = 0;
        }
        BARRIER;
        uint number = UNIFORM(taken);
        if (number >= to_tile) break;
        uint tile = chosen ? chosen[number] : number;
        ENTER_TILE
        uint begin = list_begin, end = list_end, middle = begin, visits = 0, opaque_visits = 0;
        VECTOR(ulong) z_far[STRIPS_A_LANE];
        VECTOR(uint) front[STRIPS_A_LANE], all[STRIPS_A_LANE];
        for (int own = 0; own < STRIPS_A_LANE; ++own) {
            z_far[own] = (VECTOR(ulong))(ABSENT);
            front[own] = all[own] = (VECTOR(uint))(0);
        }
        if (MIXED || ALL_OPAQUE) {
            middle = ALL_OPAQUE ? end : transparent_from(triangles, pairs, begin, end);
            list_end = HIDING ? end : middle;
            VISITS((1u << TILE_BLOCKS) - 1)
            ROUTE(true)
            opaque_visits += place < middle;
            if (!HIDING || place < middle) all[OWN(block)] -= PASTE(as_, VECTOR(uint))(covered);
            VECTOR(ulong) fragment = CONVERT(ulong, STRIP, keys_of(t, weight, screen.depth_scale)) << (VECTOR(ulong))(32);
            fragment |= (VECTOR(ulong))((ulong)t->source);
            fragment = WIDER(covered) ? fragment : (VECTOR(ulong))(ABSENT);
            z_far[OWN(block)] = MIN(z_far[OWN(block)], fragment);
            END_VISITS
            list_begin = middle, list_end = end;
        }
        if (!ALL_OPAQUE) {
            VISITS((1u << TILE_BLOCKS) - 1)
            ++visits;
            ROUTE(false)
            if (MIXED) {
                all[OWN(block)] -= PASTE(as_, VECTOR(uint))(covered);
                VECTOR(ulong) fragment = CONVERT(ulong, STRIP, keys_of(t, weight, screen.depth_scale)) << (VECTOR(ulong))(32);
                covered &= CONVERT(int, STRIP, (fragment | (VECTOR(ulong))((ulong)t->source)) < z_far[OWN(block)]);
            }
            front[OWN(block)] -= PASTE(as_, VECTOR(uint))(covered);
            END_VISITS
        }
        uint fragments = 0, deepest = 0, solid = 0, all_fragments = 0, all_deepest = 0;
        for (int own = 0; own < STRIPS_A_LANE; ++own)
            STRIP_LOOP for (int k = 0; k < STRIP; ++k) {
                int pixel = (own * LANES + lane) * STRIP + k, block = pixel / BLOCK_PIXELS, in_block = pixel % BLOCK_PIXELS;
                int column = tile_x + block % BLOCKS_A_ROW * BLOCK + in_block % BLOCK;
                int row = tile_y + block / BLOCKS_A_ROW * BLOCK + in_block / BLOCK;
                uint count = ((const uint *)(front + own))[k];
                uint any = MIXED || ALL_OPAQUE ? ((const uint *)(all + own))[k] : count;
                bool opaque = ((const ulong *)(z_far + own))[k] != ABSENT;
                fragments += count, deepest = MAX(deepest, count);
                all_fragments += any, all_deepest = MAX(all_deepest, any);
                solid += opaque;
                if (layers && column < width && row < height) layers[(size_t)row * width + column] = count | (opaque ? IS_OPAQUE : 0);
            }
        atomic_add(totals + COUNT_FRAGMENTS, fragments);
        atomic_max(totals + COUNT_LAYERS, deepest);
        atomic_add(totals + COUNT_OPAQUE, solid);
        atomic_add(totals + COUNT_ALL_FRAGMENTS, all_fragments);
        atomic_max(totals + COUNT_ALL_LAYERS, all_deepest);
        atomic_add(totals + COUNT_VISITS, visits);
        atomic_add(totals + COUNT_OPAQUE_VISITS, opaque_visits);
        if (lane == 0) totals[COUNT_OPAQUE_RECORDS] = middle - begin;
        BARRIER;
        for (int k = lane; k < COUNT_TOTALS; k += LANES) tile_totals[COUNT_TOTALS * number + k] = totals[k];
        BARRIER;
    }
}
