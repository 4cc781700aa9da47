// SHADED consecutive pixels of a strip, which are shaded at once for one record. A lane that works alone has vectors, and
// computes all their elements, covered or not. Several lanes shade pixels one by one. The code is the same: conditions are
// chosen by `?:`, which takes vectors and numbers alike.
#ifndef REALS_H
#define REALS_H

#include "base/common.h"

#if LANES == 1
#define SHADED 8
typedef float8 Reals;
typedef int8 Wholes;
typedef uint8 Words;
#define TO_WHOLES(value) CONVERT(int, 8, value)
#define TO_REALS(value) CONVERT(float, 8, value)
#define AS_WHOLES(value) as_int8(value)
#define AS_WORDS(value) as_uint8(value)
#define AS_REALS(value) as_float8(value)
#define SAMPLES_OF(vector, first) (((const Reals *)&(vector))[(first) / SHADED])
#define LOWEST_SHADED(bits) LOWEST_BIT(bits)
#define SHADED_COLUMNS (int8)(0, 1, 2, 3, 0, 1, 2, 3)
#define SHADED_ROWS (int8)(0, 0, 0, 0, 1, 1, 1, 1)
#define SHADED_BITS_OF(truth) bits_of8(truth)
#else
#define SHADED 1
typedef float Reals;
typedef int Wholes;
typedef uint Words;
#define TO_WHOLES(value) ((int)(value))
#define TO_REALS(value) ((float)(value))
#define AS_WHOLES(value) as_int(value)
#define AS_WORDS(value) as_uint(value)
#define AS_REALS(value) as_float(value)
#define SAMPLES_OF(vector, first) ELEMENT(float, vector, first)
#define LOWEST_SHADED(bits) 0
#define SHADED_BITS_OF(truth) ((truth) ? 1u : 0u)
#endif
#define SHADED_BITS ((1u << SHADED) - 1)

// Colours, straight, 0 .. 1.
typedef struct { Reals red, green, blue, alpha; } Shades;

INLINE Reals square_root(Reals value)
{
    Reals root;
#if CPU_TARGET && __has_builtin(__builtin_sqrtf)
    UNROLL for (int k = 0; k < SHADED; ++k) ((float *)&root)[k] = __builtin_sqrtf(((const float *)&value)[k]);
#else
    UNROLL for (int k = 0; k < SHADED; ++k) ((float *)&root)[k] = sqrt(((const float *)&value)[k]);
#endif
    return root;
}

// The words at these places, which are below 2^31.
INLINE Words words_of(global const uint *from, Words at)
{
#if SHADED == 1
    return from[at];
#elif AVX2_GATHER
    return as_uint8(__builtin_ia32_gatherd_d256((int8)(0), (const int *)(size_t)from, as_int8(at), (int8)(-1), sizeof(uint)));
#else
    Words found;
    UNROLL for (int k = 0; k < SHADED; ++k) ((uint *)&found)[k] = from[((const uint *)&at)[k]];
    return found;
#endif
}

INLINE Wholes floor_of(Reals value)
{
    Wholes whole = TO_WHOLES(value);
    return whole - (value < TO_REALS(whole) ? (Wholes)(1) : (Wholes)(0));
}

// --- sRGB -----------------------------------------------------------------------------------------------------------
// Linear light 0 .. 1 as sRGB (IEC 61966-2-1). The power 5/12 is the cube root of x times its fourth root. The cube root
// begins with a third of the exponent, off by 4 % at most, and Halley's step then triples the digits twice.
INLINE Reals to_srgb(Reals value)
{
    Reals x = value > (Reals)(0.0031308f) ? value : (Reals)(0.0031308f);
    Reals p = x * square_root(square_root(x));
    Reals root = AS_REALS(TO_WHOLES(TO_REALS(AS_WHOLES(p)) * 0x1.555556p-2f) + (Wholes)(0x2A514067));
    UNROLL for (int k = 0; k < 2; ++k) {
        Reals cube = root * root * root;
        root = root * ((cube + 2.0f * p) / (2.0f * cube + p));
    }
    return value > (Reals)(0.0031308f) ? 1.055f * root - 0.055f : 12.92f * value;
}

#endif
