// A strip's fragments as techniques that peel compare them.
//
// In the order of (depth, submission index), but as two numbers: within a pass a pixel's fragments arrive in submission order,
// so that of equal depths the one that was there first is the first, and payloads are only compared with those of other passes.
//
// BY_DEPTH: fragments of equal depth are one, the first submitted, as in the papers.
#ifndef PEELING_H
#define PEELING_H

#include "fragments/colors.h"

#ifndef BY_DEPTH
#define BY_DEPTH 0
#endif

// key: that of the depth, less 2^31, as vectors compare signed numbers in one step. payload: as in raster.h, below 2^31.
typedef struct { VECTOR(int) key, payload; } Fragments;

// Keys in front of and behind all there are.
#define NEAREST_KEY (-0x7FFFFFFF - 1)
#define FARTHEST_KEY 0x7FFFFFFF
#define NO_PAYLOAD (-1)  // as a uint that of ABSENT

INLINE void clear_to(Fragments *f, int key)
{
    f->key = (VECTOR(int))(key);
    f->payload = (VECTOR(int))(NO_PAYLOAD);
}

INLINE VECTOR(int) is_there(const Fragments *f) { return f->payload >= (VECTOR(int))(0); }

INLINE void replace(Fragments *f, VECTOR(int) where, const Fragments *by)
{
    f->key = SELECT(where, by->key, f->key);
    f->payload = SELECT(where, by->payload, f->payload);
}

// Whether `a` lies behind `b`, and is not it.
INLINE VECTOR(int) is_behind(const Fragments *a, const Fragments *b)
{
    // One more than its key, where of equal depths it would be the later one; no key is so near the greatest integer.
    VECTOR(int) key = a->key;
    if (!BY_DEPTH) key -= a->payload > b->payload;
    return key > b->key;
}

#endif
