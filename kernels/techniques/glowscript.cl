// glowscript: opaque surfaces, then at most four peels in front of them, merged at last ("Details about handling transparency
// with depth peeling", GlowScript).
//
//   behind      C0 and D0: the opaque surfaces' colour and depth (opaque.h)
//   slot        D1, D2, D1, ...: the depth of the nearest fragment between the peel before, z_near, and D0
//   peel[k]     C1 .. C4: the colour and opacity of each peel
//
// The merge: C1.rgb C1.a + (1 - C1.a) (C2.rgb C2.a + (1 - C2.a) (C3.rgb C3.a + (1 - C3.a) (C4.rgb C4.a + (1 - C4.a) C0)))
#include "shading.h"

#define PEELED 1
#define MOST_PEELS 4

typedef struct {
    VECTOR(ulong) z_near, slot;
    VECTOR(int) more;
    Colors peel[MOST_PEELS];
    uint peels;
} Buffers;

INLINE void clear_buffers(Buffers *b)
{
    b->z_near = (VECTOR(ulong))(0);
    b->peels = 0;
}

INLINE uint begin_pass(Buffers *b)
{
    b->slot = (VECTOR(ulong))(ABSENT);
    b->more = (VECTOR(int))(0);
    return 0;
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, VECTOR(ulong) fragment, ulong same_depth)
{
    VECTOR(int) between = covered & CONVERT(int, STRIP, fragment >= b->z_near);
    VECTOR(int) nearer = between & CONVERT(int, STRIP, fragment < b->slot);
    VECTOR(int) some = CONVERT(int, STRIP, b->slot != (VECTOR(ulong))(ABSENT));
    VECTOR(int) same = CONVERT(int, STRIP, (fragment ^ b->slot) >> (VECTOR(ulong))(32) == (VECTOR(ulong))(0));
    VECTOR(int) one = (VECTOR(int))(same_depth ? -1 : 0) & same;  // of equal depths, which are then one fragment
    b->more |= between & some & ~one;
    b->slot = CONVERT(long, STRIP, nearer & ~(one & some)) ? fragment : b->slot;
    return nearer;
}

INLINE VECTOR(ulong) peeled(const Buffers *b, int i) { return b->slot; }

INLINE void blend_peeled(Buffers *b, int i, const Colors *colors) { b->peel[b->peels++] = *colors; }

INLINE VECTOR(int) end_pass(Buffers *b, ulong same_depth)
{
    VECTOR(long) found = b->slot != (VECTOR(ulong))(ABSENT);
    b->z_near = found ? (b->slot | (VECTOR(ulong))(same_depth)) + (VECTOR(ulong))(1) : (VECTOR(ulong))(ABSENT);
    return b->more;
}

INLINE VECTOR(float) seen_through(const Buffers *b)
{
    VECTOR(float) transmittance = (VECTOR(float))(1.0f);
    for (uint k = 0; k < b->peels; ++k) transmittance *= 1.0f - b->peel[k].alpha;
    return transmittance;
}

INLINE void merge(const Buffers *b, Colors *merged)
{
    for (uint k = b->peels; k > 0; --k) blend_over(merged, b->peel + k - 1);
}

#include "peel.h"
