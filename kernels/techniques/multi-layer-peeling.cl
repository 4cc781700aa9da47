// multi-layer-peeling: the LAYERS_A_PASS nearest layers in each pass, by insertion sort (Bavoil and Myers call the sorted slots
// buckets; Liu, Wei and Xu 2006, "Multi-layer depth peeling via fragment sort", Tables 1 and 2, store them in render targets).
//
//   slot[i]   the i-th nearest fragment of this pass beyond all peeled ones: colour and depth in one MRT bucket
//   z_near    what a fragment must be at least: the one beyond the last layer peeled
//
// One work-item owns a pixel, so that a fragment is inserted before the next one comes: nothing is lost to concurrent writes,
// and a pass is never repeated. (Loops over the slots are unrolled by name: PoCL 3.0's compiler gets one of three slots wrong,
// with strips of fewer than 16 pixels, where it has the choice.)
#include "shading.h"

#ifndef LAYERS_A_PASS
#define LAYERS_A_PASS 8
#endif
#define PEELED LAYERS_A_PASS

typedef struct {
    VECTOR(ulong) z_near, slot[LAYERS_A_PASS];
    VECTOR(int) more;
    Colors color;
} Buffers;

INLINE void clear_buffers(Buffers *b)
{
    b->z_near = (VECTOR(ulong))(0);
    b->color.red = b->color.green = b->color.blue = (VECTOR(float))(0.0f);
    b->color.alpha = (VECTOR(float))(1.0f);
}

INLINE uint begin_pass(Buffers *b)
{
    UNROLL for (int i = 0; i < LAYERS_A_PASS; ++i) b->slot[i] = (VECTOR(ulong))(ABSENT);
    b->more = (VECTOR(int))(0);
    return 0;
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, VECTOR(ulong) fragment, ulong same_depth)
{
    VECTOR(int) passed = covered & CONVERT(int, STRIP, fragment >= b->z_near);
    if (same_depth)
        UNROLL for (int i = 0; i < LAYERS_A_PASS; ++i)  // the fragment's depth is in the buffer already
            passed &= CONVERT(int, STRIP, fragment >> (VECTOR(ulong))(32) != b->slot[i] >> (VECTOR(ulong))(32));
    VECTOR(ulong) inserted = CONVERT(long, STRIP, passed) ? fragment : (VECTOR(ulong))(ABSENT);
    VECTOR(int) behind = CONVERT(int, STRIP, fragment > b->slot[LAYERS_A_PASS - 1]);
    b->more |= passed & behind;
    passed &= ~behind;
    if (LAYERS_A_PASS > 2 && BITS_OF(passed) == 0) return passed;
    UNROLL for (int i = 0; i < LAYERS_A_PASS; ++i) {
        VECTOR(ulong) a = b->slot[i], nearer = MIN(a, inserted);
        b->slot[i] = nearer, inserted = a ^ inserted ^ nearer;
    }
    b->more |= CONVERT(int, STRIP, inserted != (VECTOR(ulong))(ABSENT));
    return passed;
}

INLINE VECTOR(ulong) peeled(const Buffers *b, int i) { return b->slot[i]; }

INLINE void blend_peeled(Buffers *b, int i, const Colors *colors) { blend_under(&b->color, colors); }

// Nothing passes any more where no layer was found for the last slot, or nothing behind could be seen.
INLINE VECTOR(int) end_pass(Buffers *b, ulong same_depth)
{
    VECTOR(ulong) last = b->slot[LAYERS_A_PASS - 1];
    VECTOR(long) left = (last != (VECTOR(ulong))(ABSENT)) & CONVERT(long, STRIP, b->color.alpha > (VECTOR(float))(0.0f));
    b->z_near = left ? (last | (VECTOR(ulong))(same_depth)) + (VECTOR(ulong))(1) : (VECTOR(ulong))(ABSENT);
    return b->more & CONVERT(int, STRIP, left);
}

INLINE VECTOR(float) seen_through(const Buffers *b) { return b->color.alpha; }

INLINE void merge(const Buffers *b, Colors *merged)
{
    Colors front = b->color;
    put_over(&front, merged);
    *merged = front;
}

#include "peel.h"
