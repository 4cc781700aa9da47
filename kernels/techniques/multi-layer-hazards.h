// Multi-layer peeling where fragments read and write the same targets at the same time, simulated
// so that every run has the same result (Liu, Wei and Xu 2006, "Multi-layer depth peeling via fragment sort", Figures 1
// and 2, both loops of Table 1).
//
//   slot[i]   what the i-th target has: the fragments that have been written, nearest first
//   wave      HAZARD_WINDOW consecutive fragments of a pixel, in submission order; all of them read what the targets
//             had before the first of them wrote
//
// A fragment writes nothing if it reads itself, or M nearer ones in M targets. Else it writes all that it has read, and
// itself, in order. Of a wave's writes the last one wins. So each wave adds one fragment, and the others are lost. The
// inner loop therefore visits all fragments again until nothing is written.
//
// By default, writes land farthest first, so the nearest fragment wins. Then each pass gets at least one more of the M
// layers right, as in the paper. With HAZARD_ARRIVAL, writes land in the order in which fragments arrive. Then as many
// passes as layers may be needed. With TORN_WRITES, the last write of a wave reaches only half of its targets, the odd
// slots, and the write before it reaches the others. If a fragment is then there twice, its second place is cleared.
//
// With torn writes this may never end. What follows from the slots of a pixel is always the same. So there is no end
// once they come back to what they were. `kept` has the slots after pass 1, 2, 4, 8, ... to compare with (Brent 1980).
#ifndef HAZARDS_H
#define HAZARDS_H

#define REPEATS 1
#define SAME_DEPTH (BY_DEPTH ? 0xFFFFFFFFul : 0ul)  // the bits in which fragments that count as one may differ

typedef struct {
    ulong z_near[STRIP], slot[STRIP][LAYERS_A_PASS], kept[STRIP][LAYERS_A_PASS];
    ulong last[STRIP], before[STRIP];  // writes of the wave: the last one to land, and the one before it
    uint arrived[STRIP], passes, kept_at;
    VECTOR(int) written;  // where something was written in this pass
    Colors color;
} Buffers;

INLINE VECTOR(float) seen_through(const Buffers *b) { return read_channel(b->color.alpha); }

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

INLINE uint begin_pass(Buffers *b, uint pass)
{
    for (int k = 0; k < STRIP; ++k) b->arrived[k] = 0, b->last[k] = b->before[k] = ABSENT;
    b->written = (VECTOR(int))(0);
    return 0;
}

// Inserts a fragment into the slots, in order. The last one drops out.
INLINE void insert(ulong *slot, ulong fragment)
{
    for (int i = 0; i < LAYERS_A_PASS; ++i) {
        ulong there = slot[i];
        slot[i] = MIN(there, fragment), fragment = MAX(there, fragment);
    }
}

// Ends a wave of pixel k: its writes land.
INLINE void end_wave(Buffers *b, int k)
{
    ulong *slot = b->slot[k], other[LAYERS_A_PASS];
    if (b->last[k] != ABSENT) {
        for (int i = 0; i < LAYERS_A_PASS; ++i) other[i] = slot[i];
        insert(slot, b->last[k]);
        if (TORN_WRITES && b->before[k] != ABSENT) {
            insert(other, b->before[k]);
            // The slots are still in order, so a fragment that is there twice has its two places side by side.
            for (int i = 0; i < LAYERS_A_PASS; i += 2) slot[i] = other[i];
            int clean = 1;
            for (int i = 1; i < LAYERS_A_PASS; ++i)
                if (slot[i] != slot[clean - 1]) slot[clean++] = slot[i];
            for (; clean < LAYERS_A_PASS; ++clean) slot[clean] = ABSENT;
        }
    }
    b->arrived[k] = 0, b->last[k] = b->before[k] = ABSENT;
}

// A fragment arrives at pixel k. Returns whether it writes.
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

INLINE VECTOR(int) pass_samples(Buffers *b, VECTOR(int) covered, const Row *fragments)
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

// Ends a pass. If a pixel was written to, and its slots are as they were after an earlier pass, its passes have no end.
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

#endif
