// Exact sums: of numbers from all fragments of a pixel, which come out the same in any order of them.
//
// A sum of floats depends on its order, as each addition rounds. So numbers are added as integers of 64 bits, in steps of
// 2^-s. s is as great as leaves room for all `count` fragments of a pixel, each with a number below 16: 57 less the whole
// part of log2 count. What a number has below a step is dropped. With 64 fragments a step is 2^-51, and no float32 of
// 2^-28 or more has anything below it.
#ifndef EXACT_SUMS_H
#define EXACT_SUMS_H

#include "base/common.h"

#define SUM_BITS 57

// How many steps a 1 is, 2^s, where so many fragments are added up.
INLINE VECTOR(float) steps_for(VECTOR(uint) count)
{
    VECTOR(float) some = CONVERT(float, STRIP, PASTE(as_, VECTOR(int))(MAX(count, (VECTOR(uint))(1))));
    VECTOR(int) exponent = PASTE(as_, VECTOR(int))(some) >> (VECTOR(int))(23);  // of a float: 127 more
    return PASTE(as_, VECTOR(float))(((VECTOR(int))(SUM_BITS + 2 * 127) - exponent) << (VECTOR(int))(23));
}

INLINE void add_exactly(VECTOR(long) *sum, VECTOR(float) number, VECTOR(float) steps)
{
    *sum += CONVERT(long, STRIP, number * steps);
}

INLINE VECTOR(float) sum_of(VECTOR(long) sum, VECTOR(float) steps) { return CONVERT(float, STRIP, sum) / steps; }

#endif
