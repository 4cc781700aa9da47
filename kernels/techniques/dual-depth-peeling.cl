// dual-depth-peeling: peels the nearest and the farthest layer in each pass (Bavoil and Myers 2008, "Dual Depth
// Peeling").
//
//   nearest, farthest              the min-max depth buffer of the pass before: the two layers that this pass peels
//   next_nearest, next_farthest    the one of this pass, of the fragments between those two: MAX blending of
//                                  float2(-depth, depth)
//   front                          colour that is blended under, and 1 - alpha with it, in the same pass
//   back                           colour that is blended over what lies behind it
//
// The first pass peels nothing: it finds the outermost layers. Each later pass peels two layers and finds the next two.
// So N layers take N / 2 + 1 passes, and (N + 1) / 2 + 1 where N is odd. Where both fronts meet at one fragment, it
// belongs to the front.
#define PEELED 2
#define SLOTS 0
#define IS_MAX(i) ((i) == 1)
#include "fragments/targets.h"

typedef struct {
    Row nearest, farthest, next_nearest, next_farthest;
    Colors front, back;  // back.alpha: the transmittance of the back layers
} Buffers;

INLINE void clear_buffers(Buffers *b)
{
    // All fragments lie between these two.
    clear_to(&b->next_nearest, NEAREST_KEY);
    clear_to(&b->next_farthest, FARTHEST_KEY);
    clear_buffer(&b->front);
    clear_buffer(&b->back);
}

// Where the pass before found a layer for the back. Where both fronts meet at one fragment, it belongs to the front.
INLINE VECTOR(int) has_back(const Buffers *b)
{
    return is_there(&b->farthest) & (b->farthest.payload != b->nearest.payload);
}

// The pass before found the fragments at the two depths. So they pass, without being visited again.
INLINE uint begin_pass(Buffers *b, uint pass)
{
    b->nearest = b->next_nearest, b->farthest = b->next_farthest;
    clear_to(&b->next_nearest, FARTHEST_KEY);
    clear_to(&b->next_farthest, NEAREST_KEY);
    return POPCOUNT(BITS_OF(is_there(&b->nearest))) + POPCOUNT(BITS_OF(has_back(b)));
}

INLINE VECTOR(int) passes(const Buffers *b, VECTOR(int) covered, const Row *fragments)
{
    return covered & is_behind(fragments, &b->nearest) & is_behind(&b->farthest, fragments);
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, const Row *fragments)
{
    VECTOR(int) between = passes(b, covered, fragments);
    if (BITS_OF(between) == 0) return between;
    VECTOR(int) nearer = b->next_farthest.key > fragments->key, farther = fragments->key > b->next_farthest.key;
    if (!BY_DEPTH) farther = ~nearer;  // of equal depths, the last to arrive is the farthest
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

// The layers between are seen through the front. They also change what is seen of the back.
INLINE VECTOR(float) seen_through(const Buffers *b) { return read_channel(b->front.alpha); }

// Nothing more is peeled where nothing lies between, or where too little would be seen through the front.
INLINE VECTOR(int) end_pass(Buffers *b, float least_seen)
{
    VECTOR(int) more = is_there(&b->next_nearest) & (b->front.alpha > (VECTOR(float))(0.0f));
    VECTOR(int) left = more & (seen_through(b) > (VECTOR(float))(least_seen));
    Row none;
    clear_to(&none, FARTHEST_KEY);
    replace(&b->next_nearest, ~left, &none);
    clear_to(&none, NEAREST_KEY);
    replace(&b->next_farthest, ~left, &none);
    return more;
}

// Puts the front over the back, and both over what is behind them.
INLINE void merge(const Buffers *b, Colors *merged)
{
    Colors front, back;
    read_color(&b->front, &front);
    read_color(&b->back, &back);
    put_over(&front, &back);
    put_over(&front, merged);
    *merged = front;
}

#if PASSES
INLINE Row *target(Buffers *b, int i) { return i == 0 ? &b->next_nearest : &b->next_farthest; }
INLINE Row *bound(Buffers *b, int i) { return i == 0 ? &b->nearest : &b->farthest; }
INLINE Colors *color_target(Buffers *b, int i) { return i == 0 ? &b->front : &b->back; }

// float2(-depth, depth): both targets get the depth, as MAX of -depth is MIN of depth.
INLINE VECTOR(int) output(int i, VECTOR(int) passed, VECTOR(uint) payload, VECTOR(uint) *key) { return passed; }

// "Blending on the Fly": the fragment at the nearest depth blends itself under the front. It is the only one of its
// pixel and pass. So MAX blending of the colours, which only grow, is a plain write. 1 - Adst is the third component
// that MAX blending is applied to. MAX of 1 - Adst is MIN of Adst. Read as signed integers, floats that are not
// negative are in their order, and a negative one, which rounding may leave where alpha is 1, is below them. There is
// seldom more than one such fragment in a strip, so they are blended one by one.
#define ON_THE_FLY 1
INLINE void blend_on_the_fly(const Buffers *b, VECTOR(int) there, const Row *fragments, VECTOR(uint) pixel,
                             global const void *colors_of_fragments, global Colors *front)
{
    VECTOR(int) nearest = there & (fragments->key == b->nearest.key) & (fragments->payload == b->nearest.payload);
    for (uint bits = BITS_OF(nearest); bits; bits &= bits - 1) {
        int k = LOWEST_BIT(bits);
        uint place = ELEMENT(uint, pixel, k);
        global float *to = (global float *)(front + place / STRIP) + place % STRIP;
        float4 color = fragment_color(colors_of_fragments, (uint)ELEMENT(int, fragments->payload, k));
        Colors source = {(VECTOR(float))(color.x), (VECTOR(float))(color.y), (VECTOR(float))(color.z), (VECTOR(float))(color.w)};
        Colors blended = {(VECTOR(float))(to[0]), (VECTOR(float))(to[STRIP]), (VECTOR(float))(to[2 * STRIP]),
                          (VECTOR(float))(to[3 * STRIP])};
        blend_under(&blended, &source);
        to[0] = blended.red.s0, to[STRIP] = blended.green.s0, to[2 * STRIP] = blended.blue.s0;
        atomic_min((volatile global int *)(to + 3 * STRIP), as_int(blended.alpha.s0));
    }
}
#endif

#include "frames/peeling.h"
