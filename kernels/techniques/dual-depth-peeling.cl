// dual-depth-peeling: the nearest and the farthest layer in each pass (Bavoil and Myers 2008, "Dual Depth Peeling").
//
//   nearest, farthest              the min-max depth buffer of the pass before: the layers to be peeled in this one
//   next_nearest, next_farthest    that of this pass, of the fragments between those: MAX blending of float2(-depth, depth)
//   front                          colour blended under, and with it 1 - alpha, in the same pass
//   back                           colour blended over what lies behind it
//
// The first pass peels nothing: it finds the outermost layers. From then on two layers are peeled while the next two are
// found, so that N layers take N / 2 + 1 passes, and (N + 1) / 2 + 1 where N is odd. Where both fronts meet, the fragment is
// the front's.
#include "shading.h"

#define PEELED 2

typedef struct {
    VECTOR(ulong) nearest, farthest, next_nearest, next_farthest;
    Colors front, back;  // back.alpha is what the back layers let through
} Buffers;

INLINE void clear_buffers(Buffers *b)
{
    // All fragments lie between: none is 0 or ABSENT.
    b->next_nearest = (VECTOR(ulong))(0), b->next_farthest = (VECTOR(ulong))(ABSENT);
    b->front.red = b->front.green = b->front.blue = (VECTOR(float))(0.0f);
    b->front.alpha = (VECTOR(float))(1.0f);
    b->back = b->front;
}

// Whether the pass before found a layer; else, and before the first, nearest is a number that no fragment is.
INLINE VECTOR(int) has_front(const Buffers *b)
{
    return CONVERT(int, STRIP, (b->nearest != (VECTOR(ulong))(0)) & (b->nearest != (VECTOR(ulong))(ABSENT)));
}
INLINE VECTOR(int) has_back(const Buffers *b) { return has_front(b) & CONVERT(int, STRIP, b->nearest != b->farthest); }

// The fragments at the window's depths are there, as the pass before found them: they pass, and need not be looked for.
INLINE uint begin_pass(Buffers *b)
{
    b->nearest = b->next_nearest, b->farthest = b->next_farthest;
    b->next_nearest = (VECTOR(ulong))(ABSENT), b->next_farthest = (VECTOR(ulong))(0);
    return POPCOUNT(BITS_OF(has_front(b))) + POPCOUNT(BITS_OF(has_back(b)));
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, VECTOR(ulong) fragment, ulong same_depth)
{
    VECTOR(ulong) least = b->nearest | (VECTOR(ulong))(same_depth), most = b->farthest & (VECTOR(ulong))(~same_depth);
    VECTOR(long) between = CONVERT(long, STRIP, covered) & (fragment > least) & (fragment < most);
    // Of one depth the first submitted is the least; with the faces turned round it is the greatest.
    VECTOR(ulong) turned = fragment ^ (VECTOR(ulong))(same_depth);
    b->next_nearest = MIN(b->next_nearest, between ? fragment : (VECTOR(ulong))(ABSENT));
    b->next_farthest = MAX(b->next_farthest, between ? turned : (VECTOR(ulong))(0));
    return CONVERT(int, STRIP, between);
}

INLINE VECTOR(ulong) peeled(const Buffers *b, int i)
{
    VECTOR(long) found = CONVERT(long, STRIP, i ? has_back(b) : has_front(b));
    return found ? i ? b->farthest : b->nearest : (VECTOR(ulong))(ABSENT);
}

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
    b->next_farthest = left ? b->next_farthest ^ (VECTOR(ulong))(same_depth) : (VECTOR(ulong))(0);
    return CONVERT(int, STRIP, left);
}

// What lies between is seen through the front, and changes what is seen of the back.
INLINE VECTOR(float) seen_through(const Buffers *b) { return b->front.alpha; }

// The front under-blends the back, and both what is behind them.
INLINE void merge(const Buffers *b, Colors *merged)
{
    Colors front = b->front;
    put_over(&front, &b->back);
    put_over(&front, merged);
    *merged = front;
}

#include "peel.h"
