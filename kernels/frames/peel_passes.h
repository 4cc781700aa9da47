// Peeling as the papers' hardware does it: a launch for each step of a pass, buffers in the device's memory, and atomics
// in place of the fixed function that blends into depth targets.
//
//   begin_picture    over pixels: the buffers before the first pass
//   clear_targets    over pixels: the depth targets before each pass
//   peel_fragments   over fragments: those that pass the comparison are blended into the depth targets
//   settle           over fragments, only without ATOMICS_64: which of equal depths is kept (fragments/targets.h)
//   blend_layers     over pixels: blends the layers that the pass has found, and prepares the next pass
//   merge_layers     over tiles, at last: merges the buffers and composites the picture
//
// The rasterizer has emitted all fragments before (stages/stream.cl). Work-items take neighbours in memory, whatever
// pixels these fall into. So several of them may blend into the same place at the same time.
//
//   targets   the depth targets of this pass, TARGETS planes
//   bounds    what the passes before have found, BOUNDS planes, which this one compares with. If BOUNDS is TARGETS, both
//             take turns ("ping pong"). Else the last targets are copied to it.
//   colors    the colour targets, COLOR_TARGETS for each strip
//   more      where a fragment was left over behind the last slot; all ones, or 0
//   left      for each pixel, whether layers are left unpeeled: LEFT, and STOPPED if too little of them would be seen
//   query     the occlusion query, PASSED and LEFT_OVER. It has several cache lines, so that work-items seldom wait for
//             each other. The host adds them up. turn: the place of this pass in it.
//
// The technique has the text that both executions share (frames/many_passes.h). For this one it also defines
//   SLOTS                        how many of its targets are sorted slots; 0 if none
//   target(buffers, i)           where it keeps what target i has
//   bound(buffers, i)            where it keeps what it compares with
//   color_target(buffers, i)     its colour buffers
//   output(i, passed, payload, key)
//                                where it has no slots: which of the fragments that pass write to target i, and what:
//                                `key` comes as that of the depth
//   ON_THE_FLY                   1 if the first of the peeled layers is blended by its own fragment, in
//   blend_on_the_fly(buffers, there, fragments, pixel, palette, colors)
#ifndef PEEL_PASSES_H
#define PEEL_PASSES_H

#include "stages/opaque.h"
#include "fragments/targets.h"
#include "frames/merging.h"

#ifndef ON_THE_FLY
#define ON_THE_FLY 0
#endif

#define LEFT 1
#define STOPPED 2

typedef VECTOR(uint) Numbers;  // one for each pixel of a strip

INLINE void add_to_query(volatile global uint *query, uint turn, int what, uint count)
{
    if (count) atomic_add(query + (turn * QUERY_LINES + get_group_id(0) % QUERY_LINES) * PADDING + what, count);
}

// Which pixels of a strip are drawn in this run: -1, or 0 where not. A tile with too many fragments for the memory is
// drawn in runs of its pixels, from first_pixel to last_pixel.
INLINE VECTOR(int) in_run(uint strip, uint first_pixel, uint last_pixel)
{
    int first = strip * STRIP % TILE_PIXELS;
    return MASK_OF(bits_between((int)first_pixel - first, (int)last_pixel - first));
}

INLINE void put_where(VECTOR(int) here, const Colors *strip, global Colors *place)
{
    place->red = here ? strip->red : place->red;
    place->green = here ? strip->green : place->green;
    place->blue = here ? strip->blue : place->blue;
    place->alpha = here ? strip->alpha : place->alpha;
}

// --- over pixels: clear ---------------------------------------------------------------------------------------------
// first_run: whether no pixels of these tiles were drawn before.
kernel void begin_picture(uint strips, uint plane, int first_run, global Place *bounds, global Colors *colors,
                          global Numbers *layers, global Numbers *left)
{
    uint strip = get_global_id(0);
    if (strip >= strips) return;
    Buffers buffers, *b = &buffers;
    clear_buffers(b);
    for (int i = 0; i < BOUNDS; ++i) store_row(bounds + strip * STRIP, plane, BOUNDS, i, target(b, TARGETS - BOUNDS + i));
    if (!first_run) return;
    for (int i = 0; i < COLOR_TARGETS; ++i) colors[(size_t)i * strips + strip] = *color_target(b, i);
    layers[strip] = left[strip] = (VECTOR(uint))(0);
}

// Without bounds there is one pass. The targets of all runs are then merged together at last, so they are cleared once.
kernel void clear_targets(uint strips, uint plane, global Place *targets, global Numbers *more)
{
    uint strip = get_global_id(0);
    if (strip >= strips) return;
    Buffers buffers, *b = &buffers;
    clear_buffers(b);
    begin_pass(b, 0);
    for (int i = 0; i < TARGETS; ++i) store_row(targets + strip * STRIP, plane, TARGETS, i, target(b, i));
    if (SLOTS) more[strip] = (VECTOR(uint))(0);
}

// --- over fragments: peel -------------------------------------------------------------------------------------------
// Marks the pixels of these fragments (a bit each) as having one left over.
INLINE void mark(volatile global uint *more, const Places *at, uint bits)
{
    for (; bits; bits &= bits - 1) {
        volatile global uint *place = more + ELEMENT(uint, at->pixel, LOWEST_BIT(bits));
        if (!READ(place)) atomic_or(place, ~0u);
    }
}

// Goes over STRIP neighbours of the stream. colors_of_fragments: their own colours, or the palette.
INLINE void pass_fragments(uint count, global const ulong *fragments, global const uint *pixels, uint plane,
                           global const Place *bounds, volatile global Place *targets, volatile global uint *more,
                           global const void *colors_of_fragments, global Colors *colors, volatile global uint *query,
                           uint turn, int step)
{
    uint first = get_global_id(0) * STRIP;
    if (first >= count) return;
    VECTOR(int) there = MASK_OF(bits_between(0, (int)(count - 1 - first)));
    VECTOR(ulong) some = *(global const VECTOR(ulong) *)(fragments + first);
    VECTOR(uint) pixel = *(global const VECTOR(uint) *)(pixels + first);
    Places places = {pixel, there, false}, *at = &places;
    if (CPU_TARGET) {
        VECTOR(int) consecutive = there & (pixel == (VECTOR(uint))(pixel.s0) + (VECTOR(uint))(IOTA));
        places.consecutive = BITS_OF(consecutive) == (1u << STRIP) - 1;
    }
    VECTOR(uint) key = CONVERT(uint, STRIP, some >> (VECTOR(ulong))(32)), payload = CONVERT(uint, STRIP, some);
    Row arriving = {signed_key(key), PASTE(as_, VECTOR(int))(payload)};
    Buffers buffers, *b = &buffers;
    for (int i = 0; i < BOUNDS; ++i) row_at(bounds, plane, BOUNDS, i, at, key, bound(b, i));
#if ON_THE_FLY
    if (step != PAYLOADS) blend_on_the_fly(b, there, &arriving, pixel, colors_of_fragments, colors);
#endif
    VECTOR(int) passed = passes(b, there, &arriving);
    if (BITS_OF(passed) == 0) return;
#if RACING
    uint written = 0;
    for (uint left = BITS_OF(passed); left; left &= left - 1) {
        int k = LOWEST_BIT(left);
        bool left_over;
        written += write_racing(targets + ELEMENT(uint, pixel, k), plane, ELEMENT(ulong, some, k), &left_over);
        if (left_over) mark(more, at, 1u << k);
    }
    add_to_query(query, turn, PASSED, written);
#else
    if (step != PAYLOADS) add_to_query(query, turn, PASSED, POPCOUNT(BITS_OF(passed)));
#if SLOTS
    VECTOR(int) stored = passed & may_be_stored(targets, plane, SLOTS - 1, at, key);
    if (step != PAYLOADS) {
        VECTOR(int) behind_slots = passed & ~stored;
        if (CPU_TARGET && BITS_OF(behind_slots))
            behind_slots &= words_at((global const uint *)more, 1, at) == (VECTOR(uint))(0);
        mark(more, at, BITS_OF(behind_slots));
    }
    for (uint left = BITS_OF(stored); left; left &= left - 1) {
        int k = LOWEST_BIT(left);
        volatile global Place *place = targets + ELEMENT(uint, pixel, k);
        if (insert_atomically(place, plane, ELEMENT(uint, key, k), ELEMENT(uint, payload, k), step))
            mark(more, at, 1u << k);
    }
#else
    for (int i = 0; i < TARGETS; ++i) {
        VECTOR(uint) written = key;
        VECTOR(int) stored = output(i, passed, payload, &written);
        stored &= may_be_stored(targets, plane, i, at, written);
        for (uint left = BITS_OF(stored); left; left &= left - 1) {
            int k = LOWEST_BIT(left);
            volatile global Place *place = targets + (size_t)i * plane + ELEMENT(uint, pixel, k);
            blend_atomically(place, plane, i, ELEMENT(uint, written, k), ELEMENT(uint, payload, k), step);
        }
    }
#endif
#endif
}

kernel void peel_fragments(uint count, global const ulong *fragments, global const uint *pixels, uint plane,
                           global const Place *bounds, volatile global Place *targets, volatile global uint *more,
                           global const void *colors_of_fragments, global Colors *colors, volatile global uint *query, uint turn)
{
    pass_fragments(count, fragments, pixels, plane, bounds, targets, more, colors_of_fragments, colors, query,
                   turn, ATOMICS_64 || RACING ? WHOLE : KEYS);
}

#if !ATOMICS_64 && !RACING
kernel void settle(uint count, global const ulong *fragments, global const uint *pixels, uint plane,
                   global const Place *bounds, volatile global Place *targets, volatile global uint *more,
                   global const void *colors_of_fragments, global Colors *colors, volatile global uint *query, uint turn)
{
    pass_fragments(count, fragments, pixels, plane, bounds, targets, more, colors_of_fragments, colors, query, turn,
                   PAYLOADS);
}
#endif

// --- over pixels: blend ---------------------------------------------------------------------------------------------
// next: the bounds of the next pass. These are the targets themselves if both take turns, else `bounds`.
kernel void blend_layers(uint strips, uint plane, uint pass, uint first_pixel, uint last_pixel, global const Place *bounds,
                         global const Place *targets, global Place *next, global const Numbers *more,
                         global const void *colors_of_fragments, global Colors *colors, global Numbers *layers,
                         global Numbers *left, global const float *parameters, volatile global uint *query, uint turn)
{
    uint strip = get_global_id(0);
    if (strip >= strips) return;
    const float least_seen = BOUNDED ? parameters[0] : 0.0f;
    VECTOR(int) here = in_run(strip, first_pixel, last_pixel);
    Buffers buffers, *b = &buffers;
    clear_buffers(b);
    for (int i = 0; i < COLOR_TARGETS; ++i) *color_target(b, i) = colors[(size_t)i * strips + strip];
    for (int i = 0; i < BOUNDS; ++i) load_row(bounds + strip * STRIP, plane, BOUNDS, i, target(b, TARGETS - BOUNDS + i));
    uint passed = begin_pass(b, pass);
    for (int i = 0; i < TARGETS; ++i) load_row(targets + strip * STRIP, plane, TARGETS, i, target(b, i));
#if SLOTS
    b->more = PASTE(as_, VECTOR(int))(more[strip]);
#endif
    VECTOR(uint) peeled_before = layers[strip], blended = peeled_before;
    for (int i = 0; i < PEELED; ++i) {
        VECTOR(int) payload = peeled(b, i), present = here & (payload >= (VECTOR(int))(0));
        if (BITS_OF(present) == 0) continue;
        count_up(&blended, present);
        if (i < ON_THE_FLY) continue;
        VECTOR(ulong) fragment = CONVERT(ulong, STRIP, PASTE(as_, VECTOR(uint))(present ? payload : (VECTOR(int))(NO_PAYLOAD)));
        Colors source;
        fetch_colors(&fragment, 1, colors_of_fragments, &source);
        blend_peeled(b, i, &source);
    }
    VECTOR(int) more_left = end_pass(b, least_seen);
    VECTOR(uint) state = left[strip], now = state & (VECTOR(uint))(STOPPED);
#if BOUNDED
    VECTOR(int) hidden = more_left & ~(seen_through(b) > (VECTOR(float))(least_seen));
    now |= PASTE(as_, VECTOR(uint))(hidden) & (VECTOR(uint))(STOPPED);
    more_left &= ~hidden;
#endif
    now |= PASTE(as_, VECTOR(uint))(more_left) & (VECTOR(uint))(LEFT);
    layers[strip] = blended;
    left[strip] = here ? now : state;
    for (int i = 0; i < COLOR_TARGETS; ++i) put_where(here, color_target(b, i), colors + (size_t)i * strips + strip);
    for (int i = 0; i < BOUNDS; ++i) store_row(next + strip * STRIP, plane, BOUNDS, i, target(b, TARGETS - BOUNDS + i));
    add_to_query(query, turn, PASSED, passed);
    add_to_query(query, turn, LEFT_OVER, POPCOUNT(BITS_OF(more_left)));
}

// --- over tiles: merge and composite --------------------------------------------------------------------------------
// first_tile: of the window, in the batch. behind: the opaque surfaces of the batch's strips (stages/stream.cl); NULL if
// there are none. tile_totals: of the window's tiles, as in
// frames/many_passes.h.
kernel void merge_layers(Screen screen, uint first_tile, uint strips, uint plane, global const Place *targets, global const Colors *colors,
                         global const Numbers *layers, global const Numbers *left,
                         global const Colors *behind, global uint *tile_totals, int side_bits,
                         global const float4 *background, int gradient, global const uint *scales,
                         volatile global uint *clamped, global uint *image, global float4 *color,
                         global const float *parameters, global float *values)
{
    local Colors layer[TILE_PIXELS / STRIP];
#if VALUES
    local Found found[TILE_PIXELS / STRIP];
#endif
    local uint totals[PEEL_TOTALS];
    Colors clear;
    clear_layer(&clear);
    uint tile = get_group_id(0);
    if (LANE == 0)
        for (int k = 0; k < PEEL_TOTALS; ++k) totals[k] = 0;
    BARRIER;
    Ends ends = {0, 0, 0};
    for (int own = 0; own < STRIPS_A_LANE; ++own) {
        uint place = own * LANES + LANE, strip = tile * (TILE_PIXELS / STRIP) + place;
        Buffers buffers, *b = &buffers;
        clear_buffers(b);
        for (int i = 0; i < COLOR_TARGETS; ++i) *color_target(b, i) = colors[(size_t)i * strips + strip];
        for (int i = 0; !BOUNDS && i < TARGETS; ++i) load_row(targets + strip * STRIP, plane, TARGETS, i, target(b, i));
        VECTOR(int) more = left[strip] != (VECTOR(uint))(0);
        Colors merged = MIXED ? behind[first_tile * (TILE_PIXELS / STRIP) + strip] : clear;
#if VALUES
        Found measured;
        merge_strip(b, more, layers[strip], &merged, &ends, parameters, &measured);
        found[place] = measured;
#else
        merge_strip(b, more, layers[strip], &merged, &ends);
#endif
        layer[place] = merged;
    }
    atomic_max(totals + PEEL_LAYERS, ends.deepest);
    atomic_add(totals + PEEL_TRUNCATED, ends.truncated);
    atomic_max(totals + PEEL_HIDDEN, ends.hidden);
    BARRIER;
    for (int k = LANE; k < PEEL_TOTALS; k += LANES) tile_totals[PEEL_TOTALS * tile + k] = totals[k];
    uint beyond_one = composite_tile(layer, screen.first_tile + first_tile + tile, screen.columns, side_bits,
                                     screen.width, screen.height, background, gradient, scales,
                                     image, color);
    if (beyond_one) atomic_add(clamped, beyond_one);
#if VALUES
    store_values(found, screen.first_tile + first_tile + tile, screen.columns, side_bits, screen.width,
                 screen.height, values);
#endif
}

#endif
