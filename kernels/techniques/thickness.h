// Thickness: how far a ray runs through what a pixel's crossings bound, by any of three rules, and what light leaves of it.
//
//   EXACT         all of a pixel's fragments sorted (sorting.h): a front-facing crossing adds one to a count, a back-facing
//                 one takes one off, and lengths count where it is not zero (the nonzero rule)
//   TOTAL         MIN blending of (depth, 1 - depth): from the nearest crossing to the farthest (Oat and Scheuermann 2008,
//                 "Computing Per-Pixel Object Thickness in a Single Render Pass", ShaderX6)
//   FIRST_SOLID   MIN blending of (depth, 1) where front-facing and (1, depth) where not: from the nearest front-facing
//                 crossing to the nearest back-facing one
//
// The last two store no fragments and sort nothing. Depths are keys (depth.h), so that 1 is ~0 and 1 - depth is ~depth.
// Coverage is exact, so that every sample of a closed mesh has as many front-facing as back-facing crossings. Where a pixel's
// crossings do not pair up (the count does not end at zero; no back-facing one behind the first front-facing one) it is
// unpaired: the mesh is open there, or cut by a clipping plane.
//
// parameters: what a length is multiplied with, the scale of depths (depth.h), then those of the technique.
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
#include "stages/opaque.h"
#include "fragments/sorting.h"

// The length between two crossings, before it is multiplied with what the host says. Window depths, and distances in parallel
// projection, are linear in depth: the host then says that there is no PERSPECTIVE. Else depth is near / distance, and
// near / b - near / a = near (a - b) / (a b): the difference is taken of depths, as it is exact where they lie within a factor
// of two (Sterbenz 1974).
INLINE VECTOR(float) length_between(VECTOR(float) nearer, VECTOR(float) farther)
{
#if PERSPECTIVE
    return (nearer - farther) / nearer / farther;
#else
    return nearer - farther;
#endif
}

INLINE VECTOR(int) is_back(VECTOR(uint) payload) { return (payload & (VECTOR(uint))(1)) != (VECTOR(uint))(0); }

// What both ways of finding it end with.
INLINE void measure(VECTOR(int) covered, VECTOR(float) length, VECTOR(int) unpaired, const Colors *foremost,
                    global const float *parameters, Colors *resolved, Colors *found)
{
    const VECTOR(float) zero = (VECTOR(float))(0.0f), one = (VECTOR(float))(1.0f);
    found->red = covered ? length * parameters[0] : zero;
    found->green = covered & unpaired ? one : zero;
    found->blue = covered ? one : zero;
    found->alpha = zero;
    shown(foremost, found->red, parameters + 2, resolved);
    resolved->red = covered ? resolved->red : zero;
    resolved->green = covered ? resolved->green : zero;
    resolved->blue = covered ? resolved->blue : zero;
    resolved->alpha = covered ? resolved->alpha : one;
}

#if VARIANT == EXACT

// Fragments whose payload tells no facing any more: for their colours.
INLINE VECTOR(ulong) without_facing(VECTOR(ulong) fragment)
{
    const VECTOR(ulong) payload = (VECTOR(ulong))(0xFFFFFFFFul);
    VECTOR(ulong) bare = (fragment & ~payload) | (fragment & payload) >> (VECTOR(ulong))(1);
    return fragment == (VECTOR(ulong))(ABSENT) ? fragment : bare;
}

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
            VECTOR(int) present = CONVERT(int, STRIP, all[k] != (VECTOR(ulong))(ABSENT));
            VECTOR(int) within = present & (winding != (VECTOR(int))(0));
            VECTOR(float) depth = depth_of(CONVERT(uint, STRIP, all[k] >> (VECTOR(ulong))(32)), parameters[1]);
            VECTOR(float) passed = length_between(before, depth);
            length += within ? passed : (VECTOR(float))(0.0f);
            winding += present & (is_back(CONVERT(uint, STRIP, all[k])) ? (VECTOR(int))(-1) : (VECTOR(int))(1));
            before = present ? depth : before;
        }
    }
    measure(count > (VECTOR(uint))(0), length, winding != (VECTOR(int))(0), &foremost, parameters, resolved, found);
}

#include "frames/one_pass.h"

#else

#include "fragments/comparing.h"

#define PEELED 2

// The two channels of the article's render target, each with what it is the depth of, and the colour of what is foremost.
typedef struct {
    Fragments red, green;
    Colors color;
} Buffers;

INLINE void clear_buffers(Buffers *b)
{
    clear_to(&b->red, FARTHEST_KEY);
    clear_to(&b->green, FARTHEST_KEY);
    b->color.red = b->color.green = b->color.blue = b->color.alpha = (VECTOR(float))(0.0f);
}

INLINE uint begin_pass(Buffers *b) { return 0; }

INLINE void blend_min(Fragments *channel, VECTOR(int) covered, const Fragments *source)
{
    replace(channel, covered & (source->key < channel->key), source);
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, const Fragments *fragments)
{
#if VARIANT == TOTAL
    Fragments complement = {~fragments->key, fragments->payload};  // 1 - depth
    blend_min(&b->red, covered, fragments);
    blend_min(&b->green, covered, &complement);
#else
    VECTOR(int) back = is_back(PASTE(as_, VECTOR(uint))(fragments->payload));
    blend_min(&b->red, covered & ~back, fragments);
    blend_min(&b->green, covered & back, fragments);
#endif
    return covered;
}

// The nearer and the farther of the two that are kept.
INLINE void kept(const Buffers *b, Fragments *nearer, Fragments *farther)
{
    *nearer = b->red, *farther = b->green;
#if VARIANT == TOTAL
    farther->key = ~farther->key;
#else
    VECTOR(int) turned = is_behind(&b->red, &b->green);
    replace(nearer, turned, &b->green);
    replace(farther, turned, &b->red);
#endif
}

INLINE VECTOR(int) peeled(const Buffers *b, int i)
{
    Fragments nearer, farther;
    kept(b, &nearer, &farther);
    VECTOR(int) payload = nearer.payload;
    if (i > 0) payload = farther.payload == nearer.payload ? (VECTOR(int))(NO_PAYLOAD) : farther.payload;
    return payload >> (VECTOR(int))(1);  // NO_PAYLOAD, being -1, stays what it is
}

INLINE void blend_peeled(Buffers *b, int i, const Colors *colors)
{
    if (i == 0) b->color = *colors;
}

INLINE VECTOR(int) end_pass(Buffers *b, float least_seen) { return (VECTOR(int))(0); }

INLINE VECTOR(float) seen_through(const Buffers *b) { return (VECTOR(float))(0.0f); }

INLINE VECTOR(float) depth_at(const Fragments *f, float scale)
{
    return depth_of(PASTE(as_, VECTOR(uint))(f->key) ^ (VECTOR(uint))(0x80000000u), scale);
}

INLINE void merge(const Buffers *b, Colors *merged, global const float *parameters, Colors *found)
{
    Fragments nearer, farther;
    kept(b, &nearer, &farther);
    VECTOR(int) covered = is_there(&nearer), paired = covered;
#if VARIANT == FIRST_SOLID
    paired = is_there(&b->red) & is_there(&b->green) & (b->red.key <= b->green.key);
#endif
    VECTOR(float) length = length_between(depth_at(&nearer, parameters[1]), depth_at(&farther, parameters[1]));
    length = paired ? length : (VECTOR(float))(0.0f);
    measure(covered, length, ~paired, &b->color, parameters, merged, found);
}

#include "frames/many_passes.h"

#endif
#endif
