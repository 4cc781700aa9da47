// A strip's fragments as techniques that peel compare them.
//
// In the order of (depth, submission index), but as two numbers: within a pass a pixel's fragments arrive in submission order,
// so that of equal depths the one that was there first is the first, and payloads are only compared with those of other passes.
//
// BY_DEPTH: fragments of equal depth are one, the first submitted, as in the papers.
#ifndef PEELING_H
#define PEELING_H

#include "shading.h"

// key: that of the depth, less 2^31, as vectors compare signed numbers in one step. payload: as in raster.h.
typedef struct { VECTOR(int) key; VECTOR(uint) payload; } Fragments;

// Keys in front of and behind all there are.
#define NEAREST_KEY (-0x7FFFFFFF - 1)
#define FARTHEST_KEY 0x7FFFFFFF
#define NO_PAYLOAD 0xFFFFFFFFu

INLINE void clear_to(Fragments *f, int key)
{
    f->key = (VECTOR(int))(key);
    f->payload = (VECTOR(uint))(NO_PAYLOAD);
}

INLINE VECTOR(int) is_there(const Fragments *f) { return f->payload != (VECTOR(uint))(NO_PAYLOAD); }

INLINE void replace(Fragments *f, VECTOR(int) where, const Fragments *by)
{
    f->key = where ? by->key : f->key;
    f->payload = where ? by->payload : f->payload;
}

// Whether `a` lies behind `b`, and is not it.
INLINE VECTOR(int) is_behind(const Fragments *a, const Fragments *b)
{
    VECTOR(int) behind = a->key > b->key;
    if (!BY_DEPTH) behind |= (a->key == b->key) & (a->payload > b->payload);
    return behind;
}

#endif
