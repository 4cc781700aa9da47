// What every kernel stands on: arithmetic that gives the same bits on every device, and the order of depths.
#ifndef COMMON_H
#define COMMON_H

// Contraction would let a compiler round a * b + c once or twice as it likes.
#pragma OPENCL FP_CONTRACT OFF

// --- what every compiler inlines --------------------------------------------------------------------------------
// A CPU driver's builtins may be calls that are never inlined (PoCL's from PyPI are) and that keep loops from being
// vectorized. Plain operators and, where the compiler has them, its own intrinsics give the same bits.
#ifndef __has_builtin
#define __has_builtin(name) 0
#endif
#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)
#if defined(__x86_64__) || defined(__aarch64__)
#define CPU_TARGET 1
#define INLINE static inline __attribute__((always_inline))
#else
#define CPU_TARGET 0
#define INLINE static inline
#endif
#define MIN(a, b) ((a) < (b) ? (a) : (b))
#define MAX(a, b) ((a) > (b) ? (a) : (b))
#if (defined(FP_FAST_FMAF) || defined(__FMA__)) && __has_builtin(__builtin_fmaf)
#define FMA(a, b, c) __builtin_fmaf(a, b, c)
#else
#define FMA(a, b, c) fma(a, b, c)
#endif
#if __has_builtin(__builtin_convertvector)
#define CONVERT(type, count, value) __builtin_convertvector(value, PASTE(type, count))
#else
#define CONVERT(type, count, value) PASTE(convert_, PASTE(type, count))(value)
#endif

// A list names records that lie far apart: asks for one some places ahead, so that it is there in time. Worth it where a
// lane works alone; a GPU has other lanes to turn to.
#if LANES == 1 && CPU_TARGET && __has_builtin(__builtin_prefetch)
#define PREFETCH(address) __builtin_prefetch((const void *)(size_t)(address))
#else
#define PREFETCH(address)
#endif
#define PREFETCH_DISTANCE 8

// Nearest whole number, halves towards zero, |value| < 2^31.
INLINE int nearest(float value)
{
    int whole = (int)value;
    float rest = value - (float)whole;
    return whole + (rest > 0.5f) - (rest < -0.5f);
}

INLINE float3 load3(global const float *array, uint index)
{
    return (float3)(array[3 * index], array[3 * index + 1], array[3 * index + 2]);
}

INLINE uint3 load_face(global const uint *faces, uint index)
{
    return (uint3)(faces[3 * index], faces[3 * index + 1], faces[3 * index + 2]);
}

INLINE bool is_finite(float value) { return (as_uint(value) & 0x7F800000u) != 0x7F800000u; }

// --- vectors of STRIP pixels ------------------------------------------------------------------------------------
#define VECTOR(type) PASTE(type, STRIP)
#if STRIP == 16
#define IOTA 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15
#elif STRIP == 8
#define IOTA 0, 1, 2, 3, 4, 5, 6, 7
#elif STRIP == 4
#define IOTA 0, 1, 2, 3
#elif STRIP == 2
#define IOTA 0, 1
#endif

// --- pairs of floats: an unevaluated sum of about 48 bits ----------------------------------------------------------
// Dekker, "A floating-point technique for extending the available precision" (1971), with fma for the exact product.
// Its halves are .hi and .lo. (Functions here return vectors and scalars only: a returned struct is a hidden pointer, which
// some tools and compilers handle badly.)
typedef float2 Pair;

INLINE Pair pair_of(float high, float low) { return (float2)(low, high); }

// The exact sum of two floats (Knuth): no assumption on their sizes.
INLINE Pair two_sum(float a, float b)
{
    float s = a + b, t = s - a;
    return pair_of(s, (a - (s - t)) + (b - t));
}

// The same where |a| >= |b|.
INLINE Pair quick_two_sum(float a, float b)
{
    float s = a + b;
    return pair_of(s, b - (s - a));
}

INLINE Pair pair_add(Pair a, Pair b)
{
    Pair s = two_sum(a.hi, b.hi);
    return quick_two_sum(s.hi, s.lo + (a.lo + b.lo));
}

INLINE Pair pair_sub(Pair a, Pair b) { return pair_add(a, pair_of(-b.hi, -b.lo)); }

INLINE Pair pair_mul(Pair a, Pair b)
{
    float p = a.hi * b.hi, e = FMA(a.hi, b.hi, -p);
    return quick_two_sum(p, e + (a.hi * b.lo + a.lo * b.hi));
}

INLINE Pair pair_div(Pair a, Pair b)
{
    float q = a.hi / b.hi;
    float r = FMA(-q, b.hi, a.hi);  // exact
    return quick_two_sum(q, ((r + a.lo) - q * b.lo) / b.hi);
}

// --- depth ----------------------------------------------------------------------------------------------------------
// Reversed depth (larger is nearer) to an unsigned key whose ascending order is front to back.
// The usual monotone map of floats, complemented: -0.0 and negative values keep their place.
// For vectors of any length: `uints` is the type of the keys.
#define DEPTH_KEY(uints, depth)                                                                                 \
    ((PASTE(as_, uints)(depth) & (uints)(0x80000000u)) != (uints)(0u) ? PASTE(as_, uints)(depth)                      \
                                                                   : ~(PASTE(as_, uints)(depth) | (uints)(0x80000000u)))
// --- colour ---------------------------------------------------------------------------------------------------------
INLINE float4 unpack_color(uint rgba) { return CONVERT(float, 4, as_uchar4(rgba)) / 255.0f; }

// --- the sample grid, in subpixels from the image's centre ---------------------------------------------------------
INLINE int sample_at(int pixel, int side) { return pixel * SUBPIXELS + SUBPIXELS / 2 - side * (SUBPIXELS / 2); }

// First pixel whose sample lies at or right of (below) the coordinate, and last one at or left of (above) it.
INLINE int first_pixel(int coordinate, int side)
{
    return (coordinate + side * (SUBPIXELS / 2) + SUBPIXELS / 2 - 1) >> SUBPIXEL_BITS;
}
INLINE int last_pixel(int coordinate, int side)
{
    return (coordinate + side * (SUBPIXELS / 2) - SUBPIXELS / 2) >> SUBPIXEL_BITS;
}

#endif
