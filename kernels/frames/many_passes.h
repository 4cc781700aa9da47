// Many passes: the kernel of techniques that peel layers in several geometry passes.
//
//   peel    a work-group takes tile after tile: pass after pass over the tile's records, then it composites the picture
//
// A pass visits all records, as on hardware that knows nothing of their order. It is made tile by tile, so the buffers
// of a tile's pixels stay in the lane's private memory. A tile is done when none of its samples would pass any more.
// This is what an occlusion query says of a whole picture. The last pass, whose query finds nothing, is counted but not
// made, because the buffers already tell that it would find nothing. Groups take the next tile from a shared counter.
//
// Before it includes this file, the technique includes fragments/comparing.h and defines
//   PEELED                                  how many layers of a pixel one pass peels
//   Buffers                                 what it keeps of a strip's pixels
//   clear_buffers(buffers)
//   begin_pass(buffers, pass)               what the pass before found becomes what this one compares with; returns
//                                           how many samples are known to pass, without being visited
//   passes(buffers, covered, fragments)     which fragments of a strip's covered samples pass these comparisons
//   pass_samples(buffers, covered, fragments)   blends the fragments that pass into the depth buffers; returns which
//                                           these are
//   peeled(buffers, i)                      payloads of the i-th layer that the pass has peeled, or NO_PAYLOAD
//   blend_peeled(buffers, i, colors)        blends that layer into the colour buffers
//   end_pass(buffers, least_seen)           returns where there is more to peel; where the transmittance in front of
//                                           that is least_seen or less, it sees to it that nothing passes any more
//   seen_through(buffers)                   the transmittance of the peeled layers in front of those not yet peeled
//   merge(buffers, merged)                  puts the colour buffers over `merged` (premultiplied, and transmittance)
// With VALUES, but not with BOUNDED, the last is merge(buffers, merged, parameters, found). It also gives what the
// technique finds besides colours (stages/composite.h).
//
// Concurrent writes may spoil a pass. A technique that simulates this defines REPEATS. Then a pass is repeated until
// nothing passes any more, and only then are its layers blended. Such a technique also defines
//   goes_round(buffers)                     ends one such pass; returns 0, or 1 + the number in the strip of a pixel
//                                           whose passes would be repeated without end
#ifndef PEEL_H
#define PEEL_H

#include "stages/opaque.h"
#include "frames/merging.h"

#ifndef REPEATS
#define REPEATS 0
#endif

// Totals are words of 32 bits.
//   pass_totals    4 for each pass: samples that passed (low word, high word), ticks that it took (low, high); at last,
//                  behind those of most_passes passes, the ticks of the whole (low, high)
//   tile_totals    PEEL_TOTALS for each tile: its fragments; the layers peeled of its deepest pixel; its passes; its
//                  truncated pixels; the greatest transmittance of those, as the bits of a float; its samples with an
//                  opaque surface
//
// With REPEATS, each peel has room for `most_repeats` passes in pass_totals, however many it takes: those of peel n
// begin at n * most_repeats. The word for passes is then 0, or 1 + the number of a pixel whose passes would be repeated
// without end.
kernel void peel(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs, Screen screen,
                 volatile global uint *next_tile, uint to_tile, global const uint *faces, global const void *palette,
                 global const float *weights, global const float *normals, global const float *uv,
                 global const int *material_of, global const Material *materials, global const uint *textures,
                 global const Lighting *lighting, global const Wiring *wiring,
                 global const uint *wire_lists, global const Wire *wires,
                 uint most_passes, uint most_repeats,
                 int occlusion_query, volatile global uint *pass_totals, global uint *tile_totals, int side_bits,
                 global const float4 *background, int gradient, global const uint *scales,
                 volatile global uint *clamped, global uint *image, global float4 *color,
                 global const float *parameters, global float *values)
{
    const Batch records = {triangles, pair_start, pairs, screen}, *batch = &records;
    const Shading colored = GIVEN_SHADING, *shading = &colored;
    local Colors layer[TILE_PIXELS / STRIP];
#if VALUES
    local Found found[TILE_PIXELS / STRIP];
#endif
    local uint taken, totals[PEEL_TOTALS];
#if LANES > 1
    local VECTOR(ulong) z_far[KEPT_STRIPS];
    local Colors *behind = layer;
#endif
    const float least_seen = BOUNDED ? parameters[0] : 0.0f;
    Colors clear;
    clear_layer(&clear);
    for (;;) {
        if (LANE == 0) {
            taken = atomic_inc(next_tile);
            for (int k = 0; k < PEEL_TOTALS; ++k) totals[k] = 0;
        }
        BARRIER;
        uint tile = UNIFORM(taken);
        if (tile >= to_tile) break;
        ulong entered = TICKS();
        ENTER_TILE
#if LANES == 1
        VECTOR(ulong) z_far[KEPT_STRIPS];
        Colors behind[KEPT_STRIPS];
#endif
        uint solid = 0;
        if (MIXED) {
            list_begin = transparent_from(triangles, pairs, list_begin, list_end);
            solid = draw_opaque(batch, shading, tile, list_begin, z_far, behind);
        }
        Buffers buffers[STRIPS_A_LANE];
        VECTOR(int) more[STRIPS_A_LANE], stopped[STRIPS_A_LANE];  // stopped: where least_seen left layers unpeeled
        VECTOR(uint) layers[STRIPS_A_LANE];
        for (int own = 0; own < STRIPS_A_LANE; ++own) {
            clear_buffers(buffers + own);
            more[own] = stopped[own] = (VECTOR(int))(0), layers[own] = (VECTOR(uint))(0);
        }
        uint fragments = 0, pass = 0, passed = 0, endless = 0;
        // --- the passes ---------------------------------------------------------------------------------------------
        bool left_over = true;
        while (pass < most_passes && (left_over || !occlusion_query)) {
            ulong begun = TICKS();
            passed = 0, left_over = false;
            for (int own = 0; own < STRIPS_A_LANE; ++own) passed += begin_pass(buffers + own, pass);
            VISITS((1u << TILE_BLOCKS) - 1)
            VECTOR(uint) key = keys_of(t, weight, screen.depth_scale);
            if (MIXED) covered &= is_in_front(key, t->source, z_far[OWN(block) * LANES + lane]);
            ROUTE(false)
            // The key as a signed number (fragments/comparing.h).
            Row arriving = {PASTE(as_, VECTOR(int))(key ^ (VECTOR(uint))(0x80000000u)),
                                  (VECTOR(int))((int)PAYLOAD(FRAGMENT_COLOR ? place : t->source, t))};
            if (pass == 0) fragments += POPCOUNT(BITS_OF(covered));
            passed += POPCOUNT(BITS_OF(pass_samples(buffers + OWN(block), covered, &arriving)));
            END_VISITS
            volatile global uint *totals_of_pass = pass_totals + 4 * pass++;
            if (passed) add_long(totals_of_pass, passed);
#if REPEATS
            for (int own = 0; own < STRIPS_A_LANE; ++own) {
                uint pixel = goes_round(buffers + own);
                if (pixel) endless = pixel + (own * LANES + lane) * STRIP;
            }
            if (lane == 0) add_long(totals_of_pass + 2, TICKS() - begun);
            // A peel that has used all its passes, and still finds something, counts as one without end.
            if (passed && !endless && pass % most_repeats == 0) endless = 1 + lane * STRIP;
            if (endless) break;
            // The pass is repeated until nothing passes any more.
            if (passed) {
                left_over = true;
                continue;
            }
            passed = pass % most_repeats > 1;  // at least two passes, so the first of them found something
            // The passes of the next peel begin at the next multiple of most_repeats.
            pass += most_repeats - pass % most_repeats;
            for (int own = 0; own < STRIPS_A_LANE && !passed; ++own) more[own] = (VECTOR(int))(0);
#endif
            for (int own = 0; own < STRIPS_A_LANE && passed; ++own) {
                for (int i = 0; i < PEELED; ++i) {
                    Colors colors;
                    VECTOR(int) payload = peeled(buffers + own, i), present = payload >= (VECTOR(int))(0);
                    if (BITS_OF(present) == 0) continue;
                    count_up(layers + own, present);
                    colors_of(PASTE(as_, VECTOR(uint))(payload), own * LANES + lane, tile_x, tile_y, batch, shading,
                              &colors);
                    blend_peeled(buffers + own, i, &colors);
                }
                more[own] = end_pass(buffers + own, least_seen);
#if BOUNDED
                // Pixels where too little could be seen are not peeled further. They move from `more` to `stopped`.
                VECTOR(int) hidden = more[own] & ~(seen_through(buffers + own) > (VECTOR(float))(least_seen));
                stopped[own] |= hidden, more[own] &= ~hidden;
#endif
                left_over |= BITS_OF(more[own]) != 0;
            }
            if (!REPEATS && lane == 0) add_long(totals_of_pass + 2, TICKS() - begun);
        }
        // --- merging the buffers, and totals ------------------------------------------------------------------------
        Ends ends = {0, 0, 0};
        for (int own = 0; own < STRIPS_A_LANE; ++own) {
            Colors merged = MIXED ? behind[own * LANES + lane] : clear;
#if VALUES
            Found measured;
            merge_strip(buffers + own, more[own] | stopped[own], layers[own], &merged, &ends, parameters, &measured);
            found[own * LANES + lane] = measured;
#else
            merge_strip(buffers + own, more[own] | stopped[own], layers[own], &merged, &ends);
#endif
            layer[own * LANES + lane] = merged;
        }
        atomic_add(totals + PEEL_FRAGMENTS, fragments);
        atomic_max(totals + PEEL_LAYERS, ends.deepest);
        atomic_max(totals + PEEL_PASSES, REPEATS ? endless : pass + (uint)(passed && !left_over && pass < most_passes));
        atomic_add(totals + PEEL_TRUNCATED, ends.truncated);
        atomic_max(totals + PEEL_HIDDEN, ends.hidden);
        atomic_add(totals + PEEL_OPAQUE, solid);
        BARRIER;
        for (int k = lane; k < PEEL_TOTALS; k += LANES) tile_totals[PEEL_TOTALS * tile + k] = totals[k];
        uint beyond_one = composite_tile(layer, screen.first_tile + tile, screen.columns, side_bits, screen.width,
                                         screen.height, background, gradient, scales, image, color);
        if (beyond_one) atomic_add(clamped, beyond_one);
#if VALUES
        store_values(found, screen.first_tile + tile, screen.columns, side_bits, screen.width,
                         screen.height, values);
#endif
        if (lane == 0) add_long(pass_totals + 4 * most_passes, TICKS() - entered);
        BARRIER;
    }
}

#endif
