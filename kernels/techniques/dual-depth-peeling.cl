// dual-depth-peeling: the nearest and the farthest layer in each pass (Bavoil and Myers 2008, "Dual Depth Peeling").
//
//   nearest, farthest              the min-max depth buffer of the pass before: the layers to be peeled in this one
//   next_nearest, next_farthest    that of this pass, of the fragments between those: MAX blending of float2(-depth, depth)
//   front                          colour blended under, and with it 1 - alpha, in the same pass
//   back                           colour blended over what lies behind it
//
// The first pass peels nothing: it finds the outermost layers. From then on two layers are peeled while the next two are
// found, so that N layers take N / 2 + 1 passes, and (N + 1) / 2 + 1 where N is odd. Where both fronts meet, the fragment is
// the front's. Depths are compared with those of coincident fragments told apart (raster.h), or alone, as in the paper.
#include "shading.h"

#define PEELED 2

typedef struct {
    VECTOR(ulong) nearest, farthest, next_nearest, next_farthest, front_fragment, back_fragment;
    Colors front, back;  // back.alpha is what the back layers let through
} Buffers;

INLINE void clear_buffers(Buffers *b)
{
    // All fragments lie between: none is 0 or the last number below ABSENT, as faces number fewer than 2^32 - 2.
    b->next_nearest = (VECTOR(ulong))(0), b->next_farthest = (VECTOR(ulong))(ABSENT);
    b->front.red = b->front.green = b->front.blue = (VECTOR(float))(0.0f);
    b->front.alpha = (VECTOR(float))(1.0f);
    b->back = b->front;
}

INLINE void begin_pass(Buffers *b)
{
    b->nearest = b->next_nearest, b->farthest = b->next_farthest;
    b->next_nearest = (VECTOR(ulong))(ABSENT), b->next_farthest = (VECTOR(ulong))(0);
    b->front_fragment = b->back_fragment = (VECTOR(ulong))(ABSENT);
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, VECTOR(ulong) fragment, ulong same_depth)
{
    VECTOR(ulong) least = b->nearest | (VECTOR(ulong))(same_depth), most = b->farthest & (VECTOR(ulong))(~same_depth);
    VECTOR(int) front = covered & CONVERT(int, STRIP, (fragment | (VECTOR(ulong))(same_depth)) == least);
    VECTOR(int) back = covered & ~front & CONVERT(int, STRIP, (fragment & (VECTOR(ulong))(~same_depth)) == most);
    VECTOR(int) between = covered & CONVERT(int, STRIP, (fragment > least) & (fragment < most));
    VECTOR(ulong) front_one = CONVERT(long, STRIP, front) ? fragment : (VECTOR(ulong))(ABSENT);
    VECTOR(ulong) back_one = CONVERT(long, STRIP, back) ? fragment : (VECTOR(ulong))(ABSENT);
    b->front_fragment = MIN(b->front_fragment, front_one), b->back_fragment = MIN(b->back_fragment, back_one);
    VECTOR(ulong) nearer = CONVERT(long, STRIP, between) ? fragment : (VECTOR(ulong))(ABSENT);
    VECTOR(ulong) farther = CONVERT(long, STRIP, between) ? fragment : (VECTOR(ulong))(0);
    b->next_nearest = MIN(b->next_nearest, nearer), b->next_farthest = MAX(b->next_farthest, farther);
    return front | back | between;
}

INLINE VECTOR(ulong) peeled(const Buffers *b, int i) { return i ? b->back_fragment : b->front_fragment; }

INLINE void blend_peeled(Buffers *b, int i, const Colors *colors)
{
    if (i) blend_over(&b->back, colors);
    else blend_under(&b->front, colors);
}

// Nothing more is to be peeled where nothing lies between, or nothing behind the front could be seen.
INLINE VECTOR(int) end_pass(Buffers *b, ulong same_depth)
{
    VECTOR(long) seen = CONVERT(long, STRIP, b->front.alpha > (VECTOR(float))(0.0f));
    VECTOR(long) left = (b->next_nearest != (VECTOR(ulong))(ABSENT)) & seen;
    b->next_nearest = left ? b->next_nearest : (VECTOR(ulong))(ABSENT);
    b->next_farthest = left ? b->next_farthest : (VECTOR(ulong))(0);
    return CONVERT(int, STRIP, left);
}

// What lies between is seen through the front, and changes what is seen of the back.
INLINE VECTOR(float) seen_through(const Buffers *b) { return b->front.alpha; }

// The front under-blends the back.
INLINE void merge(const Buffers *b, Colors *merged)
{
    merged->red = b->front.red + b->front.alpha * b->back.red;
    merged->green = b->front.green + b->front.alpha * b->back.green;
    merged->blue = b->front.blue + b->front.alpha * b->back.blue;
    merged->alpha = b->front.alpha * b->back.alpha;
}

#include "peel.h"
