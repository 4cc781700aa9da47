// Thickness: how far a ray runs within the surfaces that it crosses, by one of three rules (VARIANT).
//
//   EXACT         sorts all of a pixel's fragments (fragments/sorting.h). A front-facing crossing adds one to a count,
//                 a back-facing one takes one off. Lengths count where the count is not zero (the nonzero rule).
//   TOTAL         MIN blending of (depth, 1 - depth): from the nearest crossing to the farthest (Oat and Scheuermann
//                 2008, "Computing Per-Pixel Object Thickness in a Single Render Pass", ShaderX6)
//   FIRST_SOLID   MIN blending of (depth, 1) where front-facing and (1, depth) where back-facing: from the nearest
//                 front-facing crossing to the nearest back-facing one
//
// The last two store no fragments and sort nothing. Depths are keys (fragments/depth.h), so 1 is ~0, and 1 - depth is
// ~depth.
//
// Coverage is exact. So each sample of a closed mesh has as many front-facing crossings as back-facing ones. A pixel is
// "unpaired" if its crossings do not pair up. With EXACT, its count does not end at zero. With FIRST_SOLID, one of its
// two crossings is missing, or the back-facing one is in front. TOTAL never marks a pixel. Where a pixel is unpaired,
// the mesh is open, or cut by a clipping plane.
//
//   parameters    what lengths are multiplied with; the scale of depths (fragments/depth.h); then the technique's own
//   found         thickness; 1 where unpaired; 1 where there is any fragment; 0
//
// Before it includes this file, the technique defines
//   shown(foremost, thickness, parameters, resolved)
// It gives a strip's premultiplied colours and transmittances, from the colours of the foremost fragments. Pixels
// without any fragment are cleared afterwards.
#ifndef THICKNESS_H
#define THICKNESS_H

#define EXACT 0
#define TOTAL 1
#define FIRST_SOLID 2

#define FACING 1
#define VALUES 1

// These includes stand here, outside of the conditions below. A file is put in only once, where it is first asked for.
// What frames/one_pass.h and frames/many_passes.h share must therefore not be put into one of the branches.
#include "stages/opaque.h"
#include "fragments/sorting.h"

#ifndef PERSPECTIVE
#define PERSPECTIVE 1
#endif

// The length between two crossings, before it is multiplied with parameters[0]. Window depths are linear in depth, and
// so are distances in parallel projection. The host then compiles without PERSPECTIVE. Else depth is near / distance:
//   near / b - near / a = near (a - b) / (a b).
// The difference of the depths is taken first, because it is exact where they lie within a factor of two (Sterbenz
// 1974).
INLINE VECTOR(float) length_between(VECTOR(float) nearer, VECTOR(float) farther)
{
#if PERSPECTIVE
    return (nearer - farther) / nearer / farther;
#else
    return nearer - farther;
#endif
}

INLINE VECTOR(int) is_back(VECTOR(uint) payload) { return (payload & (VECTOR(uint))(1)) != (VECTOR(uint))(0); }

// Turns a length into what is found and what is shown. Both ways to find it end here.
INLINE void measure(VECTOR(int) covered, VECTOR(float) length, VECTOR(int) unpaired, const Colors *foremost,
                    global const float *parameters, Colors *resolved, Colors *found)
{
    const VECTOR(float) zero = (VECTOR(float))(0.0f), one = (VECTOR(float))(1.0f);
    found->MEASURED = covered ? length * parameters[0] : zero;
    found->UNPAIRED = covered & unpaired ? one : zero;
    found->COVERED = covered ? one : zero;
    found->alpha = zero;
    shown(foremost, found->MEASURED, parameters + 2, resolved);
    resolved->red = covered ? resolved->red : zero;
    resolved->green = covered ? resolved->green : zero;
    resolved->blue = covered ? resolved->blue : zero;
    resolved->alpha = covered ? resolved->alpha : one;
}

#if VARIANT == EXACT

// --- by sorting -----------------------------------------------------------------------------------------------------
// Fragments without the facing in their payload, as colours are fetched by the payload alone.
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
    VECTOR(float) length = (VECTOR(float))(0.0f);
    Colors foremost;
    uint deepest = sort_deep(fragments, scratch, begin, step, count);
    if (deepest == 0) return;
#if LANES == 1
    VECTOR(float) before = (VECTOR(float))(1.0f);
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
#else
    // Pixel by pixel, which takes fewer registers. Element 0 stands for the pixel.
    PLAIN_LOOP for (int k = 0; k < STRIP; ++k) {
        global const ulong *fragment = fragments + ELEMENT(uint, begin, k);
        int within = 0;
        float sum = 0.0f, before = 1.0f;
        PLAIN_LOOP for (uint left = ELEMENT(uint, count, k); left > 0; --left, fragment += step) {
            float depth = depth_of((VECTOR(uint))((uint)(*fragment >> 32)), parameters[1]).s0;
            if (within != 0) sum += length_between((VECTOR(float))(before), (VECTOR(float))(depth)).s0;
            within += *fragment & 1 ? -1 : 1;
            before = depth;
        }
        SET_ELEMENT(int, winding, k, within), SET_ELEMENT(float, length, k, sum);
    }
    VECTOR(ulong) bare;
    load_rows(fragments, begin, step, count, 0, &bare);
    bare = without_facing(bare);
    fetch_colors(&bare, 1, colors, &foremost);
#endif
    measure(count > (VECTOR(uint))(0), length, winding != (VECTOR(int))(0), &foremost, parameters, resolved, found);
}

#include "frames/one_pass.h"

#else

#define PEELED 2
#define SLOTS 0
#include "fragments/targets.h"

// --- by MIN blending ------------------------------------------------------------------------------------------------
// The two channels of the article's render target, each with the fragment whose depth it is; and the foremost colour.
typedef struct {
    Row red, green;
    Colors color;
} Buffers;

INLINE void clear_buffers(Buffers *b)
{
    clear_to(&b->red, FARTHEST_KEY);
    clear_to(&b->green, FARTHEST_KEY);
    b->color.red = b->color.green = b->color.blue = b->color.alpha = (VECTOR(float))(0.0f);
}

INLINE uint begin_pass(Buffers *b, uint pass) { return 0; }

INLINE void blend_min(Row *channel, VECTOR(int) covered, const Row *source)
{
    replace(channel, covered & (source->key < channel->key), source);
}

INLINE VECTOR(int) passes(const Buffers *b, VECTOR(int) covered, const Row *fragments) { return covered; }

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, const Row *fragments)
{
#if VARIANT == TOTAL
    Row complement = {~fragments->key, fragments->payload};  // 1 - depth
    blend_min(&b->red, covered, fragments);
    blend_min(&b->green, covered, &complement);
#else
    VECTOR(int) back = is_back(PASTE(as_, VECTOR(uint))(fragments->payload));
    blend_min(&b->red, covered & ~back, fragments);
    blend_min(&b->green, covered & back, fragments);
#endif
    return covered;
}

// The nearer and the farther of the two fragments that are kept.
INLINE void kept(const Buffers *b, Row *nearer, Row *farther)
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
    Row nearer, farther;
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

INLINE VECTOR(float) depth_at(const Row *f, float scale)
{
    return depth_of(PASTE(as_, VECTOR(uint))(f->key) ^ (VECTOR(uint))(0x80000000u), scale);
}

INLINE void merge(const Buffers *b, Colors *merged, global const float *parameters, Colors *found)
{
    Row nearer, farther;
    kept(b, &nearer, &farther);
    VECTOR(int) covered = is_there(&nearer), paired = covered;
#if VARIANT == FIRST_SOLID
    paired = is_there(&b->red) & is_there(&b->green) & (b->red.key <= b->green.key);
#endif
    VECTOR(float) length = length_between(depth_at(&nearer, parameters[1]), depth_at(&farther, parameters[1]));
    length = paired ? length : (VECTOR(float))(0.0f);
    measure(covered, length, ~paired, &b->color, parameters, merged, found);
}

#if PASSES
INLINE Row *target(Buffers *b, int i) { return i == 0 ? &b->red : &b->green; }
INLINE Row *bound(Buffers *b, int i) { return 0; }
INLINE Colors *color_target(Buffers *b, int i) { return &b->color; }

// What a fragment writes to the two channels of the article's render target.
INLINE VECTOR(int) output(int i, VECTOR(int) passed, VECTOR(uint) payload, VECTOR(uint) *key)
{
#if VARIANT == TOTAL
    if (i == 1) *key = ~*key;  // 1 - depth
    return passed;
#else
    return passed & (i == 1 ? is_back(payload) : ~is_back(payload));
#endif
}
#endif

#include "frames/peeling.h"

#endif
#endif
