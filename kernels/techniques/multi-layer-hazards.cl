// multi-layer-hazards: multi-layer peeling as it goes where fragments read and write the same targets at once, deterministically
// (Liu, Wei and Xu 2006, "Multi-layer depth peeling via fragment sort", Figures 1 and 2, both loops of Table 1).
//
//   slot[i]   what stands in the i-th target: the fragments that have been written, nearest first
//   wave      HAZARD_WINDOW fragments of a pixel in the order of submission: all of them read what stood before the first
//
// A fragment that reads itself, or M nearer ones, writes nothing. Else it writes all that it has read and itself, in order. Of
// a wave's writes the last wins: so each wave adds one fragment, others are lost, and the inner loop goes over all fragments
// again until nothing is written. Writes land farthest first, so that the nearest wins and each pass has at least one more of
// the M layers right, as the paper has it; or, with HAZARD_ARRIVAL, in the order in which fragments arrive, where up to as many
// passes are needed as there are layers. With TORN_WRITES the last of a wave commits half of its targets, the odd ones, and the
// write before it the others; a fragment that is then there twice is cleaned out when it is read.
//
// That may go round in circles. What follows from a pixel's slots is always the same, so it does once they come back to what
// they were: `kept` are those of pass 1, 2, 4, 8, ... (Brent 1980).
#include "fragments/comparing.h"

#ifndef HAZARD_WINDOW
#define LAYERS_A_PASS 8
#define HAZARD_WINDOW 2
#define HAZARD_ARRIVAL 0
#define TORN_WRITES 0
#endif
#define PEELED LAYERS_A_PASS
#define REPEATS 1
#define SAME_DEPTH (BY_DEPTH ? 0xFFFFFFFFul : 0ul)  // as what fragments of one depth differ in

typedef struct {
    ulong z_near[STRIP], slot[STRIP][LAYERS_A_PASS], kept[STRIP][LAYERS_A_PASS];
    ulong last[STRIP], before[STRIP];  // writes of the wave: the one that lands last, and the one before it
    uint arrived[STRIP], passes, kept_at;
    VECTOR(int) written;  // in this pass
    Colors color;
} Buffers;

INLINE void clear_slots(Buffers *b)
{
    b->passes = 0, b->kept_at = 0;
    for (int k = 0; k < STRIP; ++k)
        for (int i = 0; i < LAYERS_A_PASS; ++i) b->slot[k][i] = ABSENT;
}

INLINE void clear_buffers(Buffers *b)
{
    for (int k = 0; k < STRIP; ++k) b->z_near[k] = 0;
    clear_slots(b);
    clear_buffer(&b->color);
}

INLINE uint begin_pass(Buffers *b)
{
    for (int k = 0; k < STRIP; ++k) b->arrived[k] = 0, b->last[k] = b->before[k] = ABSENT;
    b->written = (VECTOR(int))(0);
    return 0;
}

// The slots with one fragment more, in order; the last one drops out.
INLINE void insert(ulong *slot, ulong fragment)
{
    for (int i = 0; i < LAYERS_A_PASS; ++i) {
        ulong there = slot[i];
        slot[i] = MIN(there, fragment), fragment = MAX(there, fragment);
    }
}

// The wave's writes land.
INLINE void end_wave(Buffers *b, int k)
{
    ulong *slot = b->slot[k], other[LAYERS_A_PASS];
    if (b->last[k] != ABSENT) {
        for (int i = 0; i < LAYERS_A_PASS; ++i) other[i] = slot[i];
        insert(slot, b->last[k]);
        if (TORN_WRITES && b->before[k] != ABSENT) {
            insert(other, b->before[k]);
            // They are still in order, so that a fragment's second place is next to its first.
            for (int i = 0; i < LAYERS_A_PASS; i += 2) slot[i] = other[i];
            int clean = 1;
            for (int i = 1; i < LAYERS_A_PASS; ++i)
                if (slot[i] != slot[clean - 1]) slot[clean++] = slot[i];
            for (; clean < LAYERS_A_PASS; ++clean) slot[clean] = ABSENT;
        }
    }
    b->arrived[k] = 0, b->last[k] = b->before[k] = ABSENT;
}

// One fragment arrives at a pixel; returns whether it writes.
INLINE bool arrive(Buffers *b, int k, ulong fragment)
{
    if (b->arrived[k] == HAZARD_WINDOW) end_wave(b, k);
    ++b->arrived[k];
    if (fragment < b->z_near[k] || fragment >= b->slot[k][LAYERS_A_PASS - 1]) return false;
    for (int i = 0; i < LAYERS_A_PASS; ++i)
        if ((fragment | SAME_DEPTH) == (b->slot[k][i] | SAME_DEPTH)) return false;
    if (HAZARD_ARRIVAL || fragment < b->last[k]) b->before[k] = b->last[k], b->last[k] = fragment;
    else if (fragment < b->before[k]) b->before[k] = fragment;
    return true;
}

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, const Fragments *fragments)
{
    VECTOR(int) passed = (VECTOR(int))(0);
    for (int k = 0; k < STRIP; ++k) {
        ulong key = (uint)((const int *)&fragments->key)[k] ^ 0x80000000u;
        ulong fragment = key << 32 | (uint)((const int *)&fragments->payload)[k];
        if (((const int *)&covered)[k] && arrive(b, k, fragment)) ((int *)&passed)[k] = -1;
    }
    b->written |= passed;
    return passed;
}

// Ends a pass. A pixel that was written to and whose slots are what they were after an earlier one goes round.
INLINE uint goes_round(Buffers *b)
{
    uint pixel = 0;
    for (int k = 0; k < STRIP; ++k) {
        end_wave(b, k);
        bool same = b->passes > 0 && ((const int *)&b->written)[k];
        for (int i = 0; i < LAYERS_A_PASS; ++i) same &= b->slot[k][i] == b->kept[k][i];
        if (same) pixel = 1 + k;
    }
    if (++b->passes >= 2 * b->kept_at) {
        b->kept_at = b->passes;
        for (int k = 0; k < STRIP; ++k)
            for (int i = 0; i < LAYERS_A_PASS; ++i) b->kept[k][i] = b->slot[k][i];
    }
    return pixel;
}

INLINE VECTOR(int) peeled(const Buffers *b, int i)
{
    VECTOR(int) payload;
    for (int k = 0; k < STRIP; ++k) ((int *)&payload)[k] = (int)(uint)b->slot[k][i];  // NO_PAYLOAD of ABSENT
    return payload;
}

INLINE void blend_peeled(Buffers *b, int i, const Colors *colors) { blend_under(&b->color, colors); }

INLINE VECTOR(int) end_pass(Buffers *b, float least_seen)
{
    VECTOR(int) left = (VECTOR(int))(0);
    for (int k = 0; k < STRIP; ++k) {
        ulong last = b->slot[k][LAYERS_A_PASS - 1];
        bool more = last != ABSENT && ((const float *)&b->color.alpha)[k] > 0.0f;
        b->z_near[k] = more ? (last | SAME_DEPTH) + 1 : ABSENT;
        ((int *)&left)[k] = more ? -1 : 0;
    }
    clear_slots(b);
    return left;
}

INLINE VECTOR(float) seen_through(const Buffers *b) { return read_channel(b->color.alpha); }

INLINE void merge(const Buffers *b, Colors *merged)
{
    Colors front;
    read_color(&b->color, &front);
    put_over(&front, merged);
    *merged = front;
}

#include "frames/many_passes.h"
