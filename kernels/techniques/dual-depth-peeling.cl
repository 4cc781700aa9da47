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
#include "fragments/comparing.h"

#define PEELED 2

typedef struct {
    Fragments nearest, farthest, next_nearest, next_farthest;
    Colors front, back;  // back.alpha is what the back layers let through
} Buffers;

INLINE void clear_buffers(Buffers *b)
{
    // All fragments lie between.
    clear_to(&b->next_nearest, NEAREST_KEY);
    clear_to(&b->next_farthest, FARTHEST_KEY);
    clear_buffer(&b->front);
    clear_buffer(&b->back);
}

// Whether the pass before found a layer that is the back's: where both fronts meet, the fragment is the front's.
INLINE VECTOR(int) has_back(const Buffers *b)
{
    return is_there(&b->farthest) & (b->farthest.payload != b->nearest.payload);
}

// The fragments at the window's depths are there, as the pass before found them: they pass, and need not be looked for.
INLINE uint begin_pass(Buffers *b)
{
    b->nearest = b->next_nearest, b->farthest = b->next_farthest;
    clear_to(&b->next_nearest, FARTHEST_KEY);
    clear_to(&b->next_farthest, NEAREST_KEY);
    return POPCOUNT(BITS_OF(is_there(&b->nearest))) + POPCOUNT(BITS_OF(has_back(b)));
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, const Fragments *fragments)
{
    VECTOR(int) between = covered & is_behind(fragments, &b->nearest) & is_behind(&b->farthest, fragments);
    if (BITS_OF(between) == 0) return between;
    VECTOR(int) nearer = b->next_farthest.key > fragments->key, farther = fragments->key > b->next_farthest.key;
    if (!BY_DEPTH) farther = ~nearer;  // of one depth, the last to arrive
    replace(&b->next_nearest, between & (fragments->key < b->next_nearest.key), fragments);
    replace(&b->next_farthest, between & farther, fragments);
    return between;
}

INLINE VECTOR(int) peeled(const Buffers *b, int i)
{
    return i == 0 ? b->nearest.payload : has_back(b) ? b->farthest.payload : (VECTOR(int))(NO_PAYLOAD);
}

INLINE void blend_peeled(Buffers *b, int i, const Colors *colors)
{
    if (i) blend_over(&b->back, colors);
    else blend_under(&b->front, colors);
}

// What lies between is seen through the front, and changes what is seen of the back.
INLINE VECTOR(float) seen_through(const Buffers *b) { return read_channel(b->front.alpha); }

// Nothing more is to be peeled where nothing lies between, or too little behind the front could be seen.
INLINE VECTOR(int) end_pass(Buffers *b, float least_seen)
{
    VECTOR(int) more = is_there(&b->next_nearest) & (b->front.alpha > (VECTOR(float))(0.0f));
    VECTOR(int) left = more & (seen_through(b) > (VECTOR(float))(least_seen));
    Fragments none;
    clear_to(&none, FARTHEST_KEY);
    replace(&b->next_nearest, ~left, &none);
    clear_to(&none, NEAREST_KEY);
    replace(&b->next_farthest, ~left, &none);
    return more;
}

// The front under-blends the back, and both what is behind them.
INLINE void merge(const Buffers *b, Colors *merged)
{
    Colors front, back;
    read_color(&b->front, &front);
    read_color(&b->back, &back);
    put_over(&front, &back);
    put_over(&front, merged);
    *merged = front;
}

#include "frames/many_passes.h"
