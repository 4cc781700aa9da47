// Render targets for depths: the papers' depth buffers in global memory, into which fragments are blended by atomics, as
// hardware does for a float target with MIN or MAX blending.
//
// A target keeps one fragment of each pixel. Target i is a plane: its places are those from i * plane on, in the order
// of pixels (base/common.h). Keys are unsigned and in the order of depths (fragments/depth.h), so atomics on integers
// compare depths. The papers blend MAX of (-depth, depth). MAX of -depth is MIN of depth, and that is how it is kept
// here: a key needs no sign.
//
//   ATOMICS_64   a place is one integer, key << 32 | payload. atom_min and atom_max compare depth and submission in one
//                go. For this the device has cl_khr_int64_extended_atomics.
//   otherwise    keys are in the first TARGETS planes, and payloads in as many planes behind them. One launch blends the
//                keys. A second launch over the same fragments settles which one is kept of equal keys.
//
// The code of a technique is the same for both. It gets the `step` of the launch: which words this one blends.
//
// Before it includes this file, the technique may define
//   IS_MAX(i)   whether target i is blended by MAX, and not by MIN
// From the host come TARGETS, how many there are, and BOUNDS, how many of the last of these the next pass compares with.
#ifndef TARGETS_H
#define TARGETS_H

#include "fragments/comparing.h"

#if PASSES

#ifndef IS_MAX
#define IS_MAX(i) ((i) < 0)  // none
#endif

#if ATOMICS_64
#pragma OPENCL EXTENSION cl_khr_int64_base_atomics : enable
#pragma OPENCL EXTENSION cl_khr_int64_extended_atomics : enable
#endif
#define LONG_PLACES (ATOMICS_64 || RACING)  // plain writes of 64 bits need no atomics
#if LONG_PLACES
typedef ulong Place;
#else
typedef uint Place;
#endif

// Which words of a fragment a launch blends.
#define WHOLE 0
#define KEYS 1
#define PAYLOADS 2

// Reads a word that others write atomically meanwhile. On a CPU a load of an aligned word is atomic. Elsewhere an
// atomic operation that changes nothing is the only such read that OpenCL 1.2 has.
#if CPU_TARGET
#define READ(word) (*(word))
#define READ_LONG(word) (*(word))
#else
#define READ(word) atomic_or(word, 0u)
#define READ_LONG(word) atom_or(word, 0ul)
#endif

// Of equal keys the first submitted is kept, and of a MAX target the last one. BY_DEPTH keeps the first there, too, so
// payloads are written there in the reverse order.
INLINE VECTOR(int) as_written(int i, VECTOR(int) payload)
{
    if (!BY_DEPTH || !IS_MAX(i)) return payload;
    return SELECT(payload < (VECTOR(int))(0), payload, (VECTOR(int))(0x7FFFFFFF) - payload);
}

// --- rows of targets ------------------------------------------------------------------------------------------------
INLINE VECTOR(int) signed_key(VECTOR(uint) key) { return PASTE(as_, VECTOR(int))(key ^ (VECTOR(uint))(0x80000000u)); }
INLINE VECTOR(uint) unsigned_key(VECTOR(int) key) { return PASTE(as_, VECTOR(uint))(key) ^ (VECTOR(uint))(0x80000000u); }

// The fragments that target i of `count` has of a strip. from: the place of the strip's first pixel in plane 0.
INLINE void load_row(global const Place *from, uint plane, int count, int i, Row *row)
{
#if LONG_PLACES
    VECTOR(ulong) word = *(global const VECTOR(ulong) *)(from + (size_t)i * plane);
    VECTOR(uint) key = CONVERT(uint, STRIP, word >> (VECTOR(ulong))(32)), payload = CONVERT(uint, STRIP, word);
#else
    VECTOR(uint) key = *(global const VECTOR(uint) *)(from + (size_t)i * plane);
    VECTOR(uint) payload = *(global const VECTOR(uint) *)(from + (size_t)(count + i) * plane);
#endif
    row->key = signed_key(key);
    row->payload = as_written(TARGETS - count + i, PASTE(as_, VECTOR(int))(payload));
}

INLINE void store_row(global Place *to, uint plane, int count, int i, const Row *row)
{
    VECTOR(uint) key = unsigned_key(row->key);
    VECTOR(uint) payload = PASTE(as_, VECTOR(uint))(as_written(TARGETS - count + i, row->payload));
#if LONG_PLACES
    VECTOR(ulong) word = CONVERT(ulong, STRIP, key) << (VECTOR(ulong))(32) | CONVERT(ulong, STRIP, payload);
    *(global VECTOR(ulong) *)(to + (size_t)i * plane) = word;
#else
    *(global VECTOR(uint) *)(to + (size_t)i * plane) = key;
    *(global VECTOR(uint) *)(to + (size_t)(count + i) * plane) = payload;
#endif
}

// --- the same for pixels anywhere -------------------------------------------------------------------------------------
// Where STRIP fragments of the stream fall: neighbours of a large triangle often fall into consecutive pixels, so that
// words can be loaded side by side.
typedef struct {
    VECTOR(uint) pixel;
    VECTOR(int) present;
    bool consecutive;
} Places;

typedef VECTOR(uint) AnyWords __attribute__((aligned(4)));  // vectors usually begin at multiples of their own size
typedef VECTOR(ulong) AnyLongs __attribute__((aligned(4)));

// The words of these pixels: those at words[pixel * step]. Where a pixel is not present, any.
INLINE VECTOR(uint) words_at(global const uint *words, uint step, const Places *at)
{
#if CPU_TARGET
    if (at->consecutive) {
        global const uint *from = words + (size_t)at->pixel.s0 * step;
        if (step == 1) return *(global const AnyWords *)from;
#ifdef __ENDIAN_LITTLE__
        return CONVERT(uint, STRIP, *(global const AnyLongs *)from);  // the low word of each, which comes first
#endif
    }
#endif
    return gather(words, at->pixel * (VECTOR(uint))(step), at->present);
}

// Keys and payloads that target i of `count` has. Places are below 2^30.
#if LONG_PLACES
#ifdef __ENDIAN_LITTLE__
#define KEY_FIRST 0
#else
#define KEY_FIRST 1
#endif
INLINE VECTOR(uint) keys_at(global const Place *from, uint plane, int i, const Places *at)
{
    return words_at((global const uint *)(from + (size_t)i * plane) + (1 - KEY_FIRST), 2, at);
}
INLINE VECTOR(uint) payloads_at(global const Place *from, uint plane, int count, int i, const Places *at)
{
    return words_at((global const uint *)(from + (size_t)i * plane) + KEY_FIRST, 2, at);
}
#else
INLINE VECTOR(uint) keys_at(global const Place *from, uint plane, int i, const Places *at)
{
    return words_at(from + (size_t)i * plane, 1, at);
}
INLINE VECTOR(uint) payloads_at(global const Place *from, uint plane, int count, int i, const Places *at)
{
    return words_at(from + (size_t)(count + i) * plane, 1, at);
}
#endif

// Whether fragments may be stored in target i, as it is now: -1, or 0 if they cannot be. A target only ever gets nearer
// fragments (or farther ones, with MAX), so this may be asked while others write. It is asked on a CPU, for a strip at
// once. Elsewhere each fragment asks for itself.
INLINE VECTOR(int) may_be_stored(volatile global const Place *targets, uint plane, int i, const Places *at, VECTOR(uint) key)
{
#if CPU_TARGET
    VECTOR(uint) now = keys_at((global const Place *)targets, plane, i, at);
    return IS_MAX(i) ? key >= now : key <= now;
#else
    return (VECTOR(int))(-1);
#endif
}

// What target i of `count` has, to be compared with fragments of these keys. Payloads are compared only of equal keys, so
// only those are loaded.
INLINE void row_at(global const Place *from, uint plane, int count, int i, const Places *at, VECTOR(uint) key, Row *row)
{
    VECTOR(uint) held = keys_at(from, plane, i, at);
    Places same = *at;
    same.present &= held == key;
    row->key = signed_key(held);
    row->payload = (VECTOR(int))(0);
    if (BITS_OF(same.present))
        row->payload = as_written(TARGETS - count + i, PASTE(as_, VECTOR(int))(payloads_at(from, plane, count, i, &same)));
}

#if !RACING
// --- blending -------------------------------------------------------------------------------------------------------
// Blends one fragment into a place of target i. It goes on where the fragment may be stored (may_be_stored), which a CPU
// has asked for a whole strip before. plane: of the target's planes.
INLINE void blend_atomically(volatile global Place *place, uint plane, int i, uint key, uint payload, int step)
{
    if (BY_DEPTH && IS_MAX(i)) payload = 0x7FFFFFFF - payload;  // see as_written
#if ATOMICS_64
    ulong word = (ulong)key << 32 | payload;
    if (IS_MAX(i)) {
        if (CPU_TARGET || word > READ_LONG(place)) atom_max(place, word);
    } else {
        if (CPU_TARGET || word < READ_LONG(place)) atom_min(place, word);
    }
#else
    if (step == KEYS) {
        if (IS_MAX(i)) {
            if (CPU_TARGET || key > READ(place)) atomic_max(place, key);
        } else {
            if (CPU_TARGET || key < READ(place)) atomic_min(place, key);
        }
    } else if (key == *place) {
        // Payloads of MAX targets are signed, as NO_PAYLOAD is less than any of them.
        place += (size_t)TARGETS * plane;
        if (IS_MAX(i)) atomic_max((volatile global int *)place, (int)payload);
        else atomic_min(place, payload);
    }
#endif
}

// --- sorted slots ---------------------------------------------------------------------------------------------------
#if SLOTS
// Inserts a fragment into the sorted slots of its pixel: an insertion sort of which each exchange is atomic. It leaves
// the nearer one of two in a slot and carries the farther one on to the next. A slot only ever gets nearer ones. So one
// that is nearer already can be passed by, whatever others do meanwhile, and the order in which fragments come does not
// matter. Returns whether a fragment is left over behind the last slot.
INLINE bool insert_atomically(volatile global Place *slot, uint plane, uint key, uint payload, int step)
{
#if ATOMICS_64
    const ulong same_depth = BY_DEPTH ? 0xFFFFFFFFul : 0ul;  // the bits in which fragments that count as one may differ
    ulong carried = (ulong)key << 32 | payload, last = READ_LONG(slot + (size_t)(SLOTS - 1) * plane);
    if (carried >= last) return (carried | same_depth) != (last | same_depth);
    for (int i = 0; i < SLOTS; ++i, slot += plane) {
        ulong there = READ_LONG(slot);
        if (carried > there && (carried | same_depth) != (there | same_depth)) continue;
        there = atom_min(slot, carried);
        if (there == ABSENT || (there | same_depth) == (carried | same_depth)) return false;
        carried = MAX(there, carried);
    }
    return true;
#else
    if (step == KEYS) {
        uint carried = key, last = READ(slot + (size_t)(SLOTS - 1) * plane);
        if (carried >= last) return !BY_DEPTH || carried != last;
        for (int i = 0; i < SLOTS; ++i, slot += plane) {
            uint there = READ(slot);
            if (carried > there) continue;
            if (!BY_DEPTH && carried == there) continue;
            there = atomic_min(slot, carried);
            if (there == (uint)ABSENT) return false;
            if (BY_DEPTH && there == carried) return false;
            carried = MAX(there, carried);
        }
        return true;
    }
    // The slots of equal keys are one run. Their payloads are sorted in the same way.
    for (int i = 0; i < SLOTS; ++i, slot += plane) {
        if (*slot < key) continue;
        if (*slot > key) return false;
        uint there = atomic_min(slot + (size_t)TARGETS * plane, payload);
        if (there == (uint)ABSENT) return false;
        payload = MAX(there, payload);
    }
    return false;
#endif
}
#endif
#endif

#endif
#endif
