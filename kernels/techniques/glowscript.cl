// glowscript: opaque surfaces, then at most four peels in front of them, which are merged at the end ("Details about
// handling transparency with depth peeling", GlowScript).
//
//   behind      C0 and D0: colour and depth of the opaque surfaces (stages/opaque.h)
//   slot        D1, D2, D1, ...: the depth of the nearest fragment between D0 and z_near, which is the peel before
//   peel[k]     C1 .. C4: colour and opacity of each peel
//
// The merge is
//   C1.rgb C1.a + (1 - C1.a) (C2.rgb C2.a + (1 - C2.a) (C3.rgb C3.a + (1 - C3.a) (C4.rgb C4.a + (1 - C4.a) C0))).
#define PEELED 1
#define SLOTS 1
#include "fragments/targets.h"

#define MOST_PEELS 4

typedef struct {
    Row z_near, slot;
    VECTOR(int) more;
    Colors peel[MOST_PEELS];
    uint pass, peels;  // the number of this pass; how many peels are stored
} Buffers;

// Whether only as many peels are gone through as are stored. Several lanes have peels in registers, which have no places,
// and by passes they are in memory: there the others count as clear.
#define COUNTED (LANES == 1 && !PASSES)
#define PEELS(b) (COUNTED ? (int)(b)->peels : MOST_PEELS)
#if COUNTED
#define PEEL_LOOP
#else
#define PEEL_LOOP UNROLL
#endif

INLINE void clear_buffers(Buffers *b)
{
    clear_to(&b->slot, NEAREST_KEY);  // all fragments lie behind this
    b->peels = 0;
    if (!COUNTED)
        UNROLL for (int k = 0; k < MOST_PEELS; ++k) clear_sums(b->peel + k);  // alpha 0: merging these changes nothing
}

INLINE uint begin_pass(Buffers *b, uint pass)
{
    b->z_near = b->slot;
    clear_to(&b->slot, FARTHEST_KEY);
    b->more = (VECTOR(int))(0);
    b->pass = pass;
    return 0;
}

INLINE VECTOR(int) passes(const Buffers *b, VECTOR(int) covered, const Row *fragments)
{
    return covered & is_behind(fragments, &b->z_near);
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, const Row *fragments)
{
    VECTOR(int) between = passes(b, covered, fragments);
    VECTOR(int) nearer = between & (fragments->key < b->slot.key);
    VECTOR(int) other = between & is_there(&b->slot);
    if (BY_DEPTH) other &= fragments->key != b->slot.key;
    b->more |= other;
    replace(&b->slot, nearer, fragments);
    return between;
}

INLINE VECTOR(int) peeled(const Buffers *b, int i) { return b->slot.payload; }

INLINE void blend_peeled(Buffers *b, int i, const Colors *colors)
{
#if LANES == 1
    store_color(b->peel + b->pass, colors);
    b->peels = b->pass + 1;
#else
    Colors stored;
    store_color(&stored, colors);
    UNROLL for (uint k = 0; k < MOST_PEELS; ++k) {
        Colors *peel = b->peel + k;
        peel->red = k == b->pass ? stored.red : peel->red, peel->green = k == b->pass ? stored.green : peel->green;
        peel->blue = k == b->pass ? stored.blue : peel->blue, peel->alpha = k == b->pass ? stored.alpha : peel->alpha;
    }
#endif
}

INLINE VECTOR(int) end_pass(Buffers *b, float least_seen)
{
    return b->more;  // where the slot is empty, its key lets nothing pass any more
}

INLINE VECTOR(float) seen_through(const Buffers *b)
{
    VECTOR(float) transmittance = (VECTOR(float))(1.0f);
    PEEL_LOOP for (int k = 0; k < PEELS(b); ++k) transmittance *= 1.0f - read_channel(b->peel[k].alpha);
    return transmittance;
}

INLINE void merge(const Buffers *b, Colors *merged)
{
    PEEL_LOOP for (int k = PEELS(b); k > 0; --k) {
        Colors peel;
        read_color(b->peel + k - 1, &peel);
        Colors front = {peel.alpha * peel.red, peel.alpha * peel.green, peel.alpha * peel.blue, 1.0f - peel.alpha};
        put_over(&front, merged);
        *merged = front;
    }
}

#if PASSES
INLINE Row *target(Buffers *b, int i) { return &b->slot; }
INLINE Row *bound(Buffers *b, int i) { return &b->z_near; }
INLINE Colors *color_target(Buffers *b, int i) { return b->peel + i; }

#endif

#include "frames/peeling.h"
