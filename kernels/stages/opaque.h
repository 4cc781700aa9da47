// Opaque surfaces: a tile's colour and z-far, drawn before anything transparent. No transparent fragment behind them is
// ever emitted (GlowScript's C0 and D0; Liu, Wei and Xu 2006, Table 1: "render all opaque objects into color and z-far
// buffers").
//
// The list of a tile has its opaque records first. z_far is the nearest of their fragments, as integers whose order is
// that of (depth, submission index) (stages/walk.h). A transparent fragment is in front if its integer is less,
// whichever was submitted first.
#ifndef OPAQUE_H
#define OPAQUE_H

#include "stages/composite.h"
#include "stages/walk.h"

// BY_DEPTH: see fragments/comparing.h.
#ifndef BY_DEPTH
#define BY_DEPTH 0
#endif

// Whether the nearest opaque fragment is found by its record's place in `pairs`, and not by its face. Records that hide are
// listed behind opaque ones. So where there are any, places are not in the order of submission.
#define BY_PLACE (FRAGMENT_COLOR & !HIDING)

// Whether fragments lie in front of the opaque surface: -1, or 0 where not. With BY_DEPTH those that lie exactly on it do
// not. source: their face.
INLINE VECTOR(int) is_in_front(VECTOR(uint) key, uint source, VECTOR(ulong) z_far)
{
    VECTOR(ulong) submitted = CONVERT(ulong, STRIP, key) << (VECTOR(ulong))(32);
    submitted |= (VECTOR(ulong))((ulong)(BY_DEPTH ? 0xFFFFFFFFu : source));
    return CONVERT(int, STRIP, submitted < z_far);
}

// The place in `pairs` where a tile's transparent records begin: a binary search.
INLINE uint transparent_from(global const Triangle *triangles, global const uint *pairs, uint begin, uint end)
{
    while (begin < end) {
        uint middle = begin + (end - begin) / 2;
        if (triangles[pairs[middle]].flags & OPAQUE) begin = middle + 1;
        else end = middle;
    }
    return begin;
}

// Draws the tile's opaque records, which are those of its list before `until`, and what hides among the others, for each of the lane's strips. Pixels
// with one get it as z_far, and its colour and transmittance 0 as `behind`. Others get ABSENT, colour 0 and
// transmittance 1. Returns how many samples have an opaque surface. z_far, behind: KEPT_STRIPS of each (base/common.h).
OUTLINE uint draw_opaque(const Batch *records, const Shading *shading, uint tile, uint until,
                         KEPT_MEMORY VECTOR(ulong) *z_far, KEPT_MEMORY Colors *behind)
{
    const Batch own_batch = *records, *batch = &own_batch;  // a copy that nothing else can change
    ENTER_TILE
    if (!HIDING) list_end = until;
    uint samples = 0;
#if LANES == 1
    VECTOR(ulong) *nearest = z_far;
#else
    VECTOR(ulong) nearest[STRIPS_A_LANE];  // copied below: registers are faster than local memory
#endif
    for (int own = 0; own < STRIPS_A_LANE; ++own) nearest[own] = (VECTOR(ulong))(ABSENT);
#if HIDING
    VECTOR(uint) places[STRIPS_A_LANE];  // in `pairs`, of the records of `nearest`
#endif
    VISITS((1u << TILE_BLOCKS) - 1)
    ROUTE(true)
    VECTOR(ulong) fragment = CONVERT(ulong, STRIP, keys_of(t, weight, batch->screen.depth_scale)) << (VECTOR(ulong))(32);
    fragment |= (VECTOR(ulong))((ulong)(BY_PLACE ? place : t->source));
    fragment = WIDER(covered) ? fragment : (VECTOR(ulong))(ABSENT);
#if HIDING
    VECTOR(int) nearer = CONVERT(int, STRIP, fragment < nearest[OWN(block)]);
    places[OWN(block)] = nearer ? (VECTOR(uint))(place) : places[OWN(block)];
#endif
    nearest[OWN(block)] = MIN(nearest[OWN(block)], fragment);
    END_VISITS
    for (int own = 0; own < STRIPS_A_LANE; ++own) {
        VECTOR(int) found = CONVERT(int, STRIP, nearest[own] != (VECTOR(ulong))(ABSENT));
        samples += POPCOUNT(BITS_OF(found));
#if LANES == 1
        Colors *color = behind + own;
#else
        Colors there, *color = &there;
#endif
        color->red = color->green = color->blue = (VECTOR(float))(0.0f);
        VECTOR(uint) payload = CONVERT(uint, STRIP, nearest[own]);
#if HIDING
        payload = found ? places[own] : (VECTOR(uint))((uint)ABSENT);
#endif
        if (BITS_OF(found))
            colors_of(payload, own * LANES + lane, tile_x, tile_y, batch, shading, color);
        store_color(color, color);
        read_color(color, color);
        color->alpha = found ? (VECTOR(float))(0.0f) : (VECTOR(float))(1.0f);
        // The payload: from a record's place to its submission index.
        STRIP_LOOP for (int k = 0; k < (BY_PLACE ? STRIP : 0); ++k)
            if (((const int *)&found)[k]) {
                ulong *first = (ulong *)(nearest + own) + k;
                *first = *first >> 32 << 32 | batch->triangles[batch->pairs[(uint)*first]].source;
            }
#if LANES > 1
        z_far[own * LANES + lane] = nearest[own];
        behind[own * LANES + lane] = there;
#endif
    }
    return samples;
}

#endif
