// A strip's fragments as the peeling techniques compare them.
//
// The order is that of (depth, submission index), but in two numbers, key and payload. Within a pass the fragments of a
// pixel arrive in submission order. So of equal depths the first to arrive is the first, and keys alone are compared.
// Payloads are compared only with those of an earlier pass.
//
// BY_DEPTH: fragments of equal depth count as one, the first submitted, as in the papers.
#ifndef PEELING_H
#define PEELING_H

#include "fragments/colors.h"

#ifndef BY_DEPTH
#define BY_DEPTH 0
#endif

// One fragment of each of a strip's pixels. key: that of the depth, less 2^31, because vectors compare signed numbers in
// one step. payload: as in stages/walk.h, below 2^31, or NO_PAYLOAD.
typedef struct { VECTOR(int) key, payload; } Row;

// Keys in front of all fragments and behind all of them.
#define NEAREST_KEY (-0x7FFFFFFF - 1)
#define FARTHEST_KEY 0x7FFFFFFF
#define NO_PAYLOAD (-1)  // the payload of ABSENT, as an int

INLINE void clear_to(Row *f, int key)
{
    f->key = (VECTOR(int))(key);
    f->payload = (VECTOR(int))(NO_PAYLOAD);
}

INLINE VECTOR(int) is_there(const Row *f) { return f->payload >= (VECTOR(int))(0); }

INLINE void replace(Row *f, VECTOR(int) where, const Row *by)
{
    f->key = SELECT(where, by->key, f->key);
    f->payload = SELECT(where, by->payload, f->payload);
}

// Whether `a` lies behind `b` and is not the same fragment: -1, or 0 where not.
INLINE VECTOR(int) is_behind(const Row *a, const Row *b)
{
    // Where `a` is the later one by submission, its key counts one more, so that it is behind also at equal depth. Keys
    // are far enough from the greatest integer for that.
    VECTOR(int) key = a->key;
    if (!BY_DEPTH) key -= a->payload > b->payload;
    return key > b->key;
}

#endif
