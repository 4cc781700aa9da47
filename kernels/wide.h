// Vectors of WIDE vertices or triangles: what one work-item computes side by side. A CPU's compiler is given whole
// vectors, as it may not find them itself; a GPU has its lanes. The code is the same: Floats, Ints, ... are plain types
// where WIDE is 1.
#ifndef WIDE_H
#define WIDE_H

#include "common.h"

#if (defined(FP_FAST_FMAF) || defined(__FMA__)) && __has_builtin(__builtin_fmaf)
#define FMA1(a, b, c) __builtin_fmaf(a, b, c)
#else
#define FMA1(a, b, c) fma(a, b, c)
#endif

#if WIDE == 1
typedef float Floats;
typedef int Ints;
typedef uint Uints;
typedef long Longs;
#define TO(type, value) ((type)(value))
#define FMA(a, b, c) FMA1(a, b, c)
#define AS_UINTS(value) as_uint(value)
#define AS_INTS(value) as_int(value)
#else
typedef float16 Floats;
typedef int16 Ints;
typedef uint16 Uints;
typedef long16 Longs;
#if __has_builtin(__builtin_convertvector)
#define TO(type, value) __builtin_convertvector(value, type)
#else
#define TO_Floats convert_float16
#define TO_Ints convert_int16
#define TO_Uints convert_uint16
#define TO_Longs convert_long16
#define TO(type, value) PASTE(TO_, type)(value)
#endif
#define AS_UINTS(value) as_uint16(value)
#define AS_INTS(value) as_int16(value)
#define FMA_(k) FMA1(a.s##k, b.s##k, c.s##k)
INLINE Floats FMA(Floats a, Floats b, Floats c)
{
    return (Floats)(FMA_(0), FMA_(1), FMA_(2), FMA_(3), FMA_(4), FMA_(5), FMA_(6), FMA_(7), FMA_(8), FMA_(9), FMA_(a),
                    FMA_(b), FMA_(c), FMA_(d), FMA_(e), FMA_(f));
}
#endif

// Elements one by one, where memory has them so.
#define FOR_EACH_ELEMENT for (int k = 0; k < WIDE; ++k)
#define FLOAT_OF(vector) (((float *)&(vector))[k])
#define INT_OF(vector) (((int *)&(vector))[k])

#define IS_FINITE(value) ((AS_UINTS(value) & (Uints)(0x7F800000u)) != (Uints)(0x7F800000u))

// Nearest whole number, halves towards zero, |value| < 2^31.
INLINE Ints nearest(Floats value)
{
    Ints whole = TO(Ints, value);
    Floats rest = value - TO(Floats, whole);
    return whole + (rest > 0.5f ? (Ints)(1) : (Ints)(0)) - (rest < -0.5f ? (Ints)(1) : (Ints)(0));
}

// --- pairs of floats: an unevaluated sum of about 48 bits ----------------------------------------------------------
// Dekker, "A floating-point technique for extending the available precision" (1971), with fma for the exact product.
// (Results go through a pointer: a returned struct is a hidden one, which some tools and compilers handle badly.)
typedef struct { Floats hi, lo; } Pair;

// The exact sum of two floats (Knuth): no assumption on their sizes.
INLINE void two_sum(Floats a, Floats b, Pair *sum)
{
    Floats s = a + b, t = s - a;
    sum->lo = (a - (s - t)) + (b - t);
    sum->hi = s;
}

// The same where |a| >= |b|.
INLINE void quick_two_sum(Floats a, Floats b, Pair *sum)
{
    Floats s = a + b;
    sum->lo = b - (s - a);
    sum->hi = s;
}

INLINE void pair_add(const Pair *a, const Pair *b, Pair *sum)
{
    Pair s;
    two_sum(a->hi, b->hi, &s);
    quick_two_sum(s.hi, s.lo + (a->lo + b->lo), sum);
}

INLINE void pair_sub(const Pair *a, const Pair *b, Pair *difference)
{
    Pair negative = {-b->hi, -b->lo};
    pair_add(a, &negative, difference);
}

INLINE void pair_mul(const Pair *a, const Pair *b, Pair *product)
{
    Floats p = a->hi * b->hi, e = FMA(a->hi, b->hi, -p);
    quick_two_sum(p, e + (a->hi * b->lo + a->lo * b->hi), product);
}

INLINE void pair_div(const Pair *a, const Pair *b, Pair *quotient)
{
    Floats q = a->hi / b->hi;
    Floats r = FMA(-q, b->hi, a->hi);  // exact
    quick_two_sum(q, ((r + a->lo) - q * b->lo) / b->hi, quotient);
}

#endif
