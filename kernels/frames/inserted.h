// Inserted: the types of frames/inserting.h, where what a technique keeps is of a strip, or of one pixel.
//
//   Number, Whole, Truth    float, uint, and -1 or 0 of a strip; float, uint, and 1 or 0 of a pixel
//   Fragment                the fragments themselves (stages/walk.h)
//   Paint                   their colours: red, green, blue, alpha
//   STORED(value)           KEPT of a number (fragments/blending.h)
//   DEPTH_KEY(fragment)     the upper half of a fragment: its depth (fragments/depth.h)
//   IS_BEFORE(a, b)         whether fragment a is in front of b, as a Truth; of equal depths the one submitted first is
//   choose(truth, a, b)     a where the Truth is, else b; choose_fragment is the same of fragments. Both numbers are read
//                           first: of `?:` a compiler may make a choice of addresses, and registers have none.
#ifndef INSERTED_H
#define INSERTED_H

#include "fragments/colors.h"

#if LANES == 1
typedef VECTOR(float) Number;
typedef VECTOR(uint) Whole;
typedef VECTOR(int) Truth;
typedef VECTOR(ulong) Fragment;
typedef Colors Paint;
#define STORED(value) KEPT(value)
#define DEPTH_KEY(fragment) CONVERT(uint, STRIP, (fragment) >> (VECTOR(ulong))(32))
#define IS_BEFORE(a, b) CONVERT(int, STRIP, (a) < (b))
#define LONGER(truth) WIDER(truth)
#else
typedef float Number;
typedef uint Whole;
typedef int Truth;
typedef ulong Fragment;
typedef struct { float red, green, blue, alpha; } Paint;
#define STORED(value) KEPT((VECTOR(float))(value)).s0
#define DEPTH_KEY(fragment) (uint)((fragment) >> 32)
#define IS_BEFORE(a, b) ((a) < (b))
#define LONGER(truth) (truth)

INLINE Paint paint_of(float4 color)
{
    Paint paint = {color.x, color.y, color.z, color.w};
    return paint;
}
#endif

INLINE Number choose(Truth truth, Number a, Number b) { return truth ? a : b; }
INLINE Fragment choose_fragment(Truth truth, Fragment a, Fragment b) { return LONGER(truth) ? a : b; }

// One channel of a buffer as a number 0..1.
INLINE Number as_number(Number kept) { return PRECISION == 2 ? UNIT_OF(kept) : kept; }

#endif
