// multi-layer-peeling: peels the LAYERS_A_PASS nearest layers in each pass, by insertion sort. (Liu, Wei and Xu 2006,
// "Multi-layer depth peeling via fragment sort", Tables 1 and 2, store them in render targets. Bavoil and Myers call
// the sorted slots buckets.)
//
//   slot[i]   the i-th nearest fragment of this pass, behind all peeled ones: colour and depth in one MRT bucket
//   z_near    the last layer that was peeled: a fragment must be behind it
//
// One work-item owns a pixel, so a fragment is inserted before the next one comes. Nothing is lost to concurrent
// writes, and a pass is never repeated. With HAZARD_WINDOW, that number of concurrent writes is simulated instead
// (techniques/multi-layer-hazards.h).
//
// Loops over the slots are unrolled explicitly. Where PoCL 3.0's compiler may choose, it gets one of three slots wrong,
// with strips of fewer than 16 pixels.
#include "fragments/comparing.h"

#ifndef LAYERS_A_PASS
#define LAYERS_A_PASS 8
#endif
#define PEELED LAYERS_A_PASS

#ifdef HAZARD_WINDOW
#include "techniques/multi-layer-hazards.h"
#else
typedef struct {
    Row z_near, slot[LAYERS_A_PASS];
    VECTOR(int) more;
    Colors color;
} Buffers;

INLINE VECTOR(float) seen_through(const Buffers *b) { return read_channel(b->color.alpha); }

INLINE void clear_buffers(Buffers *b)
{
    clear_to(&b->z_near, NEAREST_KEY);
    clear_buffer(&b->color);
}

INLINE uint begin_pass(Buffers *b)
{
    UNROLL for (int i = 0; i < LAYERS_A_PASS; ++i) clear_to(b->slot + i, FARTHEST_KEY);
    b->more = (VECTOR(int))(0);
    return 0;
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, const Row *fragments)
{
    const Row *last = b->slot + LAYERS_A_PASS - 1;
    VECTOR(int) passed = covered & is_behind(fragments, &b->z_near);
    if (BY_DEPTH)
        UNROLL for (int i = 0; i < LAYERS_A_PASS; ++i)  // skip a depth that is in a slot already
            passed &= fragments->key != b->slot[i].key;
    b->more |= passed & is_there(last);  // this one or the last slot's is left over
    passed &= fragments->key < last->key;
    if (LAYERS_A_PASS > 2 && BITS_OF(passed) == 0) return passed;
    // From the last slot to the first, each slot takes one of three: the fragment of the slot before it, where the new
    // one is in front of that; the new one, where it is in front of this slot alone; else what it has. A new one that
    // has not passed gets the farthest key, so it changes nothing.
    VECTOR(int) key = SELECT(passed, fragments->key, (VECTOR(int))(FARTHEST_KEY));
    UNROLL for (int i = LAYERS_A_PASS - 1; i > 0; --i) {
        Row *slot = b->slot + i, *before = slot - 1;
        VECTOR(int) moved = SELECT(key < before->key, before->payload, fragments->payload);
        slot->payload = SELECT(key < slot->key, moved, slot->payload);
        slot->key = MIN(slot->key, MAX(before->key, key));
    }
    b->slot[0].payload = SELECT(key < b->slot[0].key, fragments->payload, b->slot[0].payload);
    b->slot[0].key = MIN(b->slot[0].key, key);
    return passed;
}

INLINE VECTOR(int) peeled(const Buffers *b, int i) { return b->slot[i].payload; }

// Nothing passes any more where the last slot is empty, or where too little behind it could be seen.
INLINE VECTOR(int) end_pass(Buffers *b, float least_seen)
{
    const Row *last = b->slot + LAYERS_A_PASS - 1;
    VECTOR(int) left = is_there(last) & (seen_through(b) > (VECTOR(float))(least_seen));
    clear_to(&b->z_near, FARTHEST_KEY);
    replace(&b->z_near, left, last);
    return b->more & is_there(last) & (b->color.alpha > (VECTOR(float))(0.0f));
}
#endif

INLINE void blend_peeled(Buffers *b, int i, const Colors *colors) { blend_under(&b->color, colors); }

INLINE void merge(const Buffers *b, Colors *merged)
{
    Colors front;
    read_color(&b->color, &front);
    put_over(&front, merged);
    *merged = front;
}

#include "frames/many_passes.h"
