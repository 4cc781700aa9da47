// Peeling: what a technique of several geometry passes is built into.
//
//   peel    a work-group takes tile after tile: pass after pass over the tile's records, and then composites the picture
//
// A pass goes over all triangles, as hardware does that knows nothing of their order. It is taken tile by tile: the buffers of
// a tile's pixels stay in the lane's own memory, and a tile is done when none of its samples would pass any more, which is
// what an occlusion query tells of the whole picture. The last pass, whose query finds nothing, is counted but not walked: the
// buffers tell as much. Groups take the tiles as they come to them.
//
// The technique defines, before it includes this,
//   PEELED                                  how many layers of a pixel a pass peels
//   Buffers                                 what it keeps of a strip's pixels
//   clear_buffers(buffers)
//   begin_pass(buffers)                     returns how many samples pass that need not be looked for
//   pass_samples(buffers, covered, fragments)   blends the fragments of a strip's covered samples into the depth buffers;
//                                           returns those that passed
//   peeled(buffers, i)                      payloads of the i-th layer that the pass has peeled, NO_PAYLOAD where there is none
//   blend_peeled(buffers, i, colors)        blends it into the colour buffers
//   end_pass(buffers, least_seen)           returns where there is more to peel; it is peeled no further where no more than
//                                           least_seen of it could be seen
//   seen_through(buffers)                   the transmittance of what is peeled and lies in front of what is not
//   merge(buffers, merged)                  puts the colour buffers over premultiplied colour and transmittance
//                                           with VALUES (buffers, merged, parameters, found): and what it finds besides, unless
//                                           that is what BOUNDED asks for (composite.h)
//
// and, where concurrent writes may spoil a pass, REPEATS, so that it is repeated until nothing passes any more, before its layers
// are blended:
//   goes_round(buffers)                     ends one of these; returns 1 + the number of a pixel for which there is no end to
//                                           them, or 0
//
// It includes peeling.h first, for what all of them do with fragments.
#ifndef PEEL_H
#define PEEL_H

#include "stages/opaque.h"
#include "fragments/comparing.h"

#ifndef REPEATS
#define REPEATS 0
#endif

// pass_totals: of each pass the samples that passed and the ticks it took, two words each; at last, the ticks of it all. With
// REPEATS, a peel may take `most_repeats` passes, and those of the n-th begin at n times that, however many it takes.
// tile_totals: of each tile, its fragments, the layers peeled of its deepest pixel, its passes (with REPEATS, 1 + the number
// of a pixel for which there is no end to them), its truncated pixels, the greatest transmittance of those (a float's bits),
// and samples with an opaque surface.
kernel void peel(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                 uint first_tile, volatile global uint *next_tile, uint to_tile, int columns, int width, int height,
                 float depth_scale, global const uint *faces, global const void *palette, global const float *weights,
                 global const float *normals, float view_x, float view_y, float view_z, uint most_passes,
                 uint most_repeats, int occlusion_query, volatile global uint *pass_totals, global uint *tile_totals,
                 int side_bits, int picture_width, int picture_height, float red, float green,
                 float blue, int has_background, int keep_color, volatile global uint *clamped, global uint *image,
                 global float4 *color, global const float *parameters, global float *values)
{
    local Colors layer[TILE_PIXELS / STRIP];
#if VALUES
    local Found found[TILE_PIXELS / STRIP];
#endif
    local uint taken, totals[PEEL_TOTALS];
    const float3 view = (float3)(view_x, view_y, view_z);
    const float least_seen = BOUNDED ? parameters[0] : 0.0f;
    const Colors clear = {(VECTOR(float))(0.0f), (VECTOR(float))(0.0f), (VECTOR(float))(0.0f), (VECTOR(float))(1.0f)};
    for (;;) {
        if (get_local_id(0) == 0) {
            taken = atomic_inc(next_tile);
            for (int k = 0; k < PEEL_TOTALS; ++k) totals[k] = 0;
        }
        barrier(CLK_LOCAL_MEM_FENCE);
        uint tile = taken;
        if (tile >= to_tile) break;
        ulong entered = TICKS();
        ENTER_TILE
        VECTOR(ulong) z_far[STRIPS_A_LANE];
        Colors behind[STRIPS_A_LANE];
        uint solid = 0;
        if (MIXED) {
            list_begin = transparent_from(triangles, pairs, list_begin, list_end);
            solid = draw_opaque(triangles, pair_start, pairs, tile, list_begin, first_tile, columns, width, height, depth_scale,
                                faces, palette, weights, normals, view, z_far, behind);
        }
        Buffers buffers[STRIPS_A_LANE];
        VECTOR(int) more[STRIPS_A_LANE], stopped[STRIPS_A_LANE];  // stopped: where least_seen has left some out
        VECTOR(uint) layers[STRIPS_A_LANE];
        for (int own = 0; own < STRIPS_A_LANE; ++own) {
            clear_buffers(buffers + own);
            more[own] = stopped[own] = (VECTOR(int))(0), layers[own] = (VECTOR(uint))(0);
        }
        uint fragments = 0, pass = 0, passed = 0, endless = 0;
        bool left_over = true;
        while (pass < most_passes && (left_over || !occlusion_query)) {
            ulong begun = TICKS();
            passed = 0, left_over = false;
            for (int own = 0; own < STRIPS_A_LANE; ++own) passed += begin_pass(buffers + own);
            VISITS((1u << TILE_BLOCKS) - 1)
            VECTOR(uint) key = keys_of(t, weight, depth_scale);
            if (MIXED) {
                VECTOR(ulong) submitted = CONVERT(ulong, STRIP, key) << (VECTOR(ulong))(32);
                submitted |= (VECTOR(ulong))((ulong)(BY_DEPTH ? 0xFFFFFFFFu : t->source));
                covered &= CONVERT(int, STRIP, submitted < z_far[OWN(block)]);
            }
            Fragments arriving = {PASTE(as_, VECTOR(int))(key ^ (VECTOR(uint))(0x80000000u)),
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
            if (passed && !endless && pass % most_repeats == 0) endless = 1 + lane * STRIP;
            if (endless) break;
            if (passed) {
                left_over = true;
                continue;
            }
            passed = pass % most_repeats > 1;  // whether the first of these passes found something
            pass += most_repeats - pass % most_repeats;
            for (int own = 0; own < STRIPS_A_LANE && !passed; ++own) more[own] = (VECTOR(int))(0);
#endif
            for (int own = 0; own < STRIPS_A_LANE && passed; ++own) {
                for (int i = 0; i < PEELED; ++i) {
                    Colors colors;
                    VECTOR(int) payload = peeled(buffers + own, i), present = payload >= (VECTOR(int))(0);
                    if (BITS_OF(present) == 0) continue;
                    layers[own] -= PASTE(as_, VECTOR(uint))(present);
                    colors_of(PASTE(as_, VECTOR(uint))(payload), own * LANES + lane, tile_x, tile_y, width, height, triangles,
                              pairs, faces, palette, weights, normals, view, &colors);
                    blend_peeled(buffers + own, i, &colors);
                }
                more[own] = end_pass(buffers + own, least_seen);
#if BOUNDED
                VECTOR(int) hidden = more[own] & ~(seen_through(buffers + own) > (VECTOR(float))(least_seen));
                stopped[own] |= hidden, more[own] &= ~hidden;
#endif
                left_over |= BITS_OF(more[own]) != 0;
            }
            if (!REPEATS && lane == 0) add_long(totals_of_pass + 2, TICKS() - begun);
        }
        uint truncated = 0, deepest = 0, hidden = 0;
        for (int own = 0; own < STRIPS_A_LANE; ++own) {
            Colors merged = MIXED ? behind[own] : clear;
            VECTOR(float) seen = seen_through(buffers + own);
            more[own] |= stopped[own];
#if VALUES
            Found measured;
#if BOUNDED
            measured = PASTE(as_, VECTOR(float))(PASTE(as_, VECTOR(int))(seen) & more[own]);
            merge(buffers + own, &merged);
#else
            merge(buffers + own, &merged, parameters, &measured);
#endif
            found[own * LANES + lane] = measured;
#else
            merge(buffers + own, &merged);
#endif
            for (int k = 0; k < STRIP; ++k) {
                float through = ((const float *)&seen)[k];
                deepest = MAX(deepest, ((const uint *)(layers + own))[k]);
                if (!((const int *)(more + own))[k] || !(through > 0.0f)) continue;
                ++truncated;
                hidden = MAX(hidden, as_uint(through));
            }
            layer[own * LANES + lane] = merged;
        }
        atomic_add(totals + PEEL_FRAGMENTS, fragments);
        atomic_max(totals + PEEL_LAYERS, deepest);
        atomic_max(totals + PEEL_PASSES, REPEATS ? endless : pass + (uint)(passed && !left_over && pass < most_passes));
        atomic_add(totals + PEEL_TRUNCATED, truncated);
        atomic_max(totals + PEEL_HIDDEN, hidden);
        atomic_add(totals + PEEL_OPAQUE, solid);
        barrier(CLK_LOCAL_MEM_FENCE);
        for (int k = lane; k < PEEL_TOTALS; k += LANES) tile_totals[PEEL_TOTALS * tile + k] = totals[k];
        uint beyond_one = composite_tile(layer, first_tile + tile, columns, side_bits, picture_width, picture_height, red, green,
                                         blue, has_background, keep_color, image, color);
        if (beyond_one) atomic_add(clamped, beyond_one);
#if VALUES
        store_values(found, first_tile + tile, columns, side_bits, picture_width, picture_height, values);
#endif
        if (lane == 0) add_long(pass_totals + 4 * most_passes, TICKS() - entered);
        barrier(CLK_LOCAL_MEM_FENCE);
    }
}

#endif
