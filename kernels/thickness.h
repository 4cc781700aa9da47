// Thickness: how far a ray runs through what a pixel's crossings bound, by any of three rules, and what light leaves of it.
//
//   EXACT         all of a pixel's fragments sorted (sorting.h): a front-facing crossing adds one to a count, a back-facing
//                 one takes one off, and lengths count where it is not zero (the nonzero rule)
//   TOTAL         MIN blending of (depth, 1 - depth): from the nearest crossing to the farthest (Oat and Scheuermann 2008,
//                 "Computing Per-Pixel Object Thickness in a Single Render Pass", ShaderX6)
//   FIRST_SOLID   MIN blending of (depth, 1) where front-facing and (1, depth) where not: from the nearest front-facing
//                 crossing to the nearest back-facing one
//
// The last two store no fragments and sort nothing. Depths are keys (common.h), so that 1 is ~0 and 1 - depth is ~depth.
// Coverage is exact, so that every sample of a closed mesh has as many front-facing as back-facing crossings. Where a pixel's
// crossings do not pair up (the count does not end at zero; no back-facing one behind the first front-facing one) it is
// unpaired: the mesh is open there, or cut by a clipping plane.
//
// parameters: what a length is multiplied with, then those of the technique.
// found: thickness, 1 where unpaired, 1 where there is any fragment, 0.
//
// The technique defines, before it includes this,
//   shown(foremost, thickness, parameters, resolved)   a strip's premultiplied colours and transmittances, from the colours of
//                                                      the foremost fragments; those without any are made clear afterwards
#ifndef THICKNESS_H
#define THICKNESS_H

#define EXACT 0
#define TOTAL 1
#define FIRST_SOLID 2

#define FACING 1
#define VALUES 1

// Here, as each file is put in once, where it is first asked for, and what draw.h and peel.h share must not stand in either.
#include "opaque.h"
#include "sorting.h"

// The depth of a key, or of a fragment's.
INLINE VECTOR(float) depth_of(VECTOR(ulong) fragment)
{
    VECTOR(uint) key = CONVERT(uint, STRIP, fragment >> (VECTOR(ulong))(32));
    VECTOR(int) negative = (key & (VECTOR(uint))(0x80000000u)) != (VECTOR(uint))(0u);
    return PASTE(as_, VECTOR(float))(negative ? key : ~key & (VECTOR(uint))(0x7FFFFFFFu));
}

// The length between two crossings, before it is multiplied with what the host says. Window depths, and distances in parallel
// projection, are linear in depth: the host then says that there is no PERSPECTIVE. Else depth is near / distance, and  near / b - near / a = near (a - b) / (a b): the
// difference is taken of depths, as it is exact where they lie within a factor of two (Sterbenz 1974).
INLINE VECTOR(float) length_between(VECTOR(float) nearer, VECTOR(float) farther)
{
#if PERSPECTIVE
    return (nearer - farther) / nearer / farther;
#else
    return nearer - farther;
#endif
}

// A fragment whose payload tells no facing any more: for its colour.
INLINE VECTOR(ulong) without_facing(VECTOR(ulong) fragment)
{
    const VECTOR(ulong) payload = (VECTOR(ulong))(0xFFFFFFFFul);
    VECTOR(ulong) bare = (fragment & ~payload) | (fragment & payload) >> (VECTOR(ulong))(1);
    return fragment == (VECTOR(ulong))(ABSENT) ? fragment : bare;
}

INLINE VECTOR(int) is_present(VECTOR(ulong) fragment) { return CONVERT(int, STRIP, fragment != (VECTOR(ulong))(ABSENT)); }

INLINE VECTOR(int) is_back(VECTOR(ulong) fragment)
{
    return CONVERT(int, STRIP, (fragment & (VECTOR(ulong))(1)) != (VECTOR(ulong))(0));
}

// What both ways of finding it end with.
INLINE void measure(VECTOR(int) covered, VECTOR(float) length, VECTOR(int) unpaired, const Colors *foremost,
                    global const float *parameters, Colors *resolved, Colors *found)
{
    const VECTOR(float) zero = (VECTOR(float))(0.0f), one = (VECTOR(float))(1.0f);
    found->red = covered ? length * parameters[0] : zero;
    found->green = covered & unpaired ? one : zero;
    found->blue = covered ? one : zero;
    found->alpha = zero;
    shown(foremost, found->red, parameters + 1, resolved);
    resolved->red = covered ? resolved->red : zero;
    resolved->green = covered ? resolved->green : zero;
    resolved->blue = covered ? resolved->blue : zero;
    resolved->alpha = covered ? resolved->alpha : one;
}

#if VARIANT == EXACT

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved, global const float *parameters,
                          Colors *found)
{
    VECTOR(int) winding = (VECTOR(int))(0);
    VECTOR(float) length = (VECTOR(float))(0.0f), before = (VECTOR(float))(1.0f);
    Colors foremost;
    uint deepest = sort_deep(fragments, scratch, begin, count);
    if (deepest == 0) return;
    for (uint first = 0; first < deepest; first += RUN_MAX) {
        VECTOR(ulong) all[RUN_MAX];
        load_sorted(fragments, begin, step, count, first, deepest, all);
        if (first == 0) {
            VECTOR(ulong) bare = without_facing(all[0]);
            fetch_colors(&bare, 1, colors, &foremost);
        }
        for (uint k = 0; k < MIN(deepest - first, (uint)RUN_MAX); ++k) {
            VECTOR(int) present = is_present(all[k]), within = present & (winding != (VECTOR(int))(0));
            VECTOR(float) depth = depth_of(all[k]), passed = length_between(before, depth);
            length += within ? passed : (VECTOR(float))(0.0f);
            winding += present & (is_back(all[k]) ? (VECTOR(int))(-1) : (VECTOR(int))(1));
            before = present ? depth : before;
        }
    }
    measure(count > (VECTOR(uint))(0), length, winding != (VECTOR(int))(0), &foremost, parameters, resolved, found);
}

#include "draw.h"

#else

#define PEELED 2

// The two channels of the article's render target, and the colour of what is foremost.
typedef struct {
    VECTOR(ulong) red, green;
    Colors color;
} Buffers;

INLINE void clear_buffers(Buffers *b)
{
    b->red = b->green = (VECTOR(ulong))(ABSENT);
    b->color.red = b->color.green = b->color.blue = b->color.alpha = (VECTOR(float))(0.0f);
}

INLINE uint begin_pass(Buffers *b) { return 0; }

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, VECTOR(ulong) fragment, ulong same_depth)
{
    const VECTOR(ulong) one = (VECTOR(ulong))(ABSENT);
    VECTOR(ulong) red, green;
#if VARIANT == TOTAL
    VECTOR(long) here = CONVERT(long, STRIP, covered);
    red = here ? fragment : one, green = here ? ~fragment : one;
#else
    VECTOR(int) back = is_back(fragment);
    red = CONVERT(long, STRIP, covered & ~back) ? fragment : one;
    green = CONVERT(long, STRIP, covered & back) ? fragment : one;
#endif
    b->red = MIN(b->red, red), b->green = MIN(b->green, green);
    return covered;
}

// The nearer and the farther of the two that are kept.
INLINE VECTOR(ulong) kept(const Buffers *b, int farther)
{
#if VARIANT == TOTAL
    VECTOR(ulong) last = b->red == (VECTOR(ulong))(ABSENT) ? b->red : ~b->green;
    return farther ? last : b->red;
#else
    return farther ? MAX(b->red, b->green) : MIN(b->red, b->green);
#endif
}

INLINE VECTOR(ulong) peeled(const Buffers *b, int i)
{
    VECTOR(ulong) first = kept(b, 0), second = kept(b, 1);
    return without_facing(i == 0 ? first : second == first ? (VECTOR(ulong))(ABSENT) : second);
}

INLINE void blend_peeled(Buffers *b, int i, const Colors *colors)
{
    if (i == 0) b->color = *colors;
}

INLINE VECTOR(int) end_pass(Buffers *b, ulong same_depth) { return (VECTOR(int))(0); }

INLINE VECTOR(float) seen_through(const Buffers *b) { return (VECTOR(float))(0.0f); }

INLINE void merge(const Buffers *b, Colors *merged, global const float *parameters, Colors *found)
{
    VECTOR(int) covered = is_present(kept(b, 0)), paired = covered;
#if VARIANT == FIRST_SOLID
    paired = is_present(b->red) & is_present(b->green) & (depth_of(b->red) >= depth_of(b->green));
#endif
    VECTOR(float) length = length_between(depth_of(kept(b, 0)), depth_of(kept(b, 1)));
    length = paired ? length : (VECTOR(float))(0.0f);
    measure(covered, length, ~paired, &b->color, parameters, merged, found);
}

#include "peel.h"

#endif
#endif
