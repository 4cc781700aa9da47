// multi-layer-peeling: peels the LAYERS_A_PASS nearest layers in each pass, by insertion sort. (Liu, Wei and Xu 2006,
// "Multi-layer depth peeling via fragment sort", Tables 1 and 2, store them in render targets. Bavoil and Myers call
// the sorted slots buckets.)
//
//   slot[i]   the i-th nearest fragment of this pass, behind all peeled ones: colour and depth in one MRT bucket
//   z_near    the last layer that was peeled: a fragment must be behind it
//
// One work-item owns a pixel, so a fragment is inserted before the next one comes. Nothing is lost to concurrent
// writes, and a pass is never repeated. With HAZARD_WINDOW, that number of concurrent writes is simulated instead
// (techniques/multi-layer-hazards.h). With PASSES, work-items share the pixels: the insertion is then a cascade of atomic
// exchanges (insert_atomically, fragments/targets.h), or with RACING the paper's plain reads and writes (multi-layer-races.h).
//
// Loops over the slots are unrolled explicitly. Where PoCL 3.0's compiler may choose, it gets one of three slots wrong,
// with strips of fewer than 16 pixels.
#ifndef LAYERS_A_PASS
#define LAYERS_A_PASS 8
#endif
#define PEELED LAYERS_A_PASS
#define SLOTS LAYERS_A_PASS
#include "fragments/targets.h"

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
    clear_to(b->slot + LAYERS_A_PASS - 1, NEAREST_KEY);  // all fragments lie behind this
    clear_buffer(&b->color);
}

// The z-near buffer gets the depths of the last target (Table 1).
INLINE uint begin_pass(Buffers *b, uint pass)
{
    b->z_near = b->slot[LAYERS_A_PASS - 1];
    UNROLL for (int i = 0; i < LAYERS_A_PASS; ++i) clear_to(b->slot + i, FARTHEST_KEY);
    b->more = (VECTOR(int))(0);
    return 0;
}

INLINE VECTOR(int) passes(const Buffers *b, VECTOR(int) covered, const Row *fragments)
{
    return covered & is_behind(fragments, &b->z_near);
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, const Row *fragments)
{
    const Row *last = b->slot + LAYERS_A_PASS - 1;
    VECTOR(int) behind = passes(b, covered, fragments), stored = behind;
    if (BY_DEPTH)
        UNROLL for (int i = 0; i < LAYERS_A_PASS; ++i)  // skip a depth that is in a slot already
            stored &= fragments->key != b->slot[i].key;
    b->more |= stored & is_there(last);  // this one or the last slot's is left over
    stored &= fragments->key < last->key;
    if (LAYERS_A_PASS > 2 && BITS_OF(stored) == 0) return behind;
    // From the last slot to the first, each slot takes one of three: the fragment of the slot before it, where the new
    // one is in front of that; the new one, where it is in front of this slot alone; else what it has. A new one that
    // is not stored gets the farthest key, so it changes nothing.
    VECTOR(int) key = SELECT(stored, fragments->key, (VECTOR(int))(FARTHEST_KEY));
    UNROLL for (int i = LAYERS_A_PASS - 1; i > 0; --i) {
        Row *slot = b->slot + i, *before = slot - 1;
        VECTOR(int) moved = SELECT(key < before->key, before->payload, fragments->payload);
        slot->payload = SELECT(key < slot->key, moved, slot->payload);
        slot->key = MIN(slot->key, MAX(before->key, key));
    }
    b->slot[0].payload = SELECT(key < b->slot[0].key, fragments->payload, b->slot[0].payload);
    b->slot[0].key = MIN(b->slot[0].key, key);
    return behind;
}

INLINE VECTOR(int) peeled(const Buffers *b, int i)
{
#if LANES == 1
    return b->slot[i].payload;
#else
    VECTOR(int) payload = b->slot[0].payload;  // registers have no places, so i chooses
    UNROLL for (int k = 1; k < LAYERS_A_PASS; ++k) payload = i == k ? b->slot[k].payload : payload;
    return payload;
#endif
}

// Nothing passes any more where the last slot is empty, or where too little behind it could be seen.
INLINE VECTOR(int) end_pass(Buffers *b, float least_seen)
{
    Row *last = b->slot + LAYERS_A_PASS - 1, none;
    VECTOR(int) there = is_there(last), left = there & (seen_through(b) > (VECTOR(float))(least_seen));
    clear_to(&none, FARTHEST_KEY);
    replace(last, ~left, &none);
    return b->more & there & (b->color.alpha > (VECTOR(float))(0.0f));
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

#if PASSES
INLINE Row *target(Buffers *b, int i) { return b->slot + i; }
INLINE Row *bound(Buffers *b, int i) { return &b->z_near; }
INLINE Colors *color_target(Buffers *b, int i) { return &b->color; }

#if RACING
#include "techniques/multi-layer-races.h"
#endif
#endif

#include "frames/peeling.h"
