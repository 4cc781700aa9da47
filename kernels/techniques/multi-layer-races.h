// Multi-layer peeling where fragments really read and write the same targets at the same time (Liu, Wei and Xu 2006,
// Tables 1 and 2, both loops): with plain reads and writes, and no atomics. multi-layer-hazards.h simulates this.
//
// A fragment reads all M targets of its pixel, inserts itself, and writes what has changed. Others may write meanwhile,
// so any of the targets may keep another fragment's write. Then a fragment can be lost, be there twice, or be out of
// order. Each target is written whole, as one integer of 64 bits. So what is read are fragments of this pixel, and the
// fragment program can put them in order and remove the second of two. It writes if anything has changed by this, even
// if it is not among the M nearest itself.
//
// The pass is repeated until nothing is written. Then every fragment has seen the same targets: they are in order, and
// the fragment is one of them or lies behind M others. So they are the M nearest, whatever the writes did before.
#ifndef RACES_H
#define RACES_H

// Inserts a fragment into `kept`, which has `count` in order. Of equal fragments, or BY_DEPTH of equal depths, the first
// submitted stays. Returns whether one is left over.
INLINE bool keep(ulong *kept, int *count, ulong fragment)
{
    const ulong same_depth = BY_DEPTH ? 0xFFFFFFFFul : 0ul;
    int at = *count;
    for (int i = 0; i < *count; ++i)
        if ((kept[i] | same_depth) == (fragment | same_depth)) {
            kept[i] = MIN(kept[i], fragment);
            return false;
        }
    if (at == SLOTS && fragment > kept[SLOTS - 1]) return true;
    bool full = at == SLOTS;
    if (full) --at;
    else ++*count;
    for (; at > 0 && kept[at - 1] > fragment; --at) kept[at] = kept[at - 1];
    kept[at] = fragment;
    return full;
}

// The fragment program. Returns whether it writes.
INLINE bool write_racing(volatile global ulong *target, uint plane, ulong fragment, bool *left_over)
{
    ulong held[SLOTS], kept[SLOTS];
    int count = 0;
    for (int i = 0; i < SLOTS; ++i) {
        held[i] = target[(size_t)i * plane];
        if (held[i] != ABSENT) keep(kept, &count, held[i]);
    }
    *left_over = keep(kept, &count, fragment);
    bool written = false;
    for (int i = 0; i < SLOTS; ++i) {
        ulong now = i < count ? kept[i] : ABSENT;
        if (now == held[i]) continue;
        target[(size_t)i * plane] = now;
        written = true;
    }
    return written;
}

#endif
