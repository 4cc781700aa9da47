// Vectors of WIDE vertices or triangles, which one work-item computes side by side. A CPU's compiler is given whole
// vectors, because it may not find them itself. A GPU has its lanes, and WIDE is 1 there. Then Floats, Ints, ... are
// plain types, and the code is the same.
#ifndef WIDE_H
#define WIDE_H

#include "base/common.h"

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
#define AS_FLOATS(value) as_float(value)
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
#define AS_FLOATS(value) as_float16(value)
#define FMA_(k) FMA1(a.s##k, b.s##k, c.s##k)
INLINE Floats FMA(Floats a, Floats b, Floats c)
{
    return (Floats)(FMA_(0), FMA_(1), FMA_(2), FMA_(3), FMA_(4), FMA_(5), FMA_(6), FMA_(7), FMA_(8), FMA_(9), FMA_(a),
                    FMA_(b), FMA_(c), FMA_(d), FMA_(e), FMA_(f));
}
#endif

// Loads the 32-bit words at from[step * at]. `at` is below 2^31, and step is 1 or 2.
#if WIDE == 1
#define GATHER(from, step, at) ((global const uint *)(from))[(size_t)(step) * (at)]
#elif defined(__AVX512F__) && __has_builtin(__builtin_ia32_gathersiv16si)
#define GATHER(from, step, at)                                                                                  \
    as_uint16(__builtin_ia32_gathersiv16si((int16)(0), (const void *)(size_t)(from), as_int16(at), (ushort)0xFFFF, 4 * (step)))
#else
#define GATHER(from, step, at) gather_wide((global const uint *)(from), step, at)
INLINE Uints gather_wide(global const uint *from, uint step, Uints at)
{
    Uints found;
    for (int k = 0; k < WIDE; ++k) ((uint *)&found)[k] = from[(size_t)step * ((const uint *)&at)[k]];
    return found;
}
#endif

// The numbers of the WIDE items from `first` on, of `count` items. Elements past the last item repeat it.
INLINE Uints items_from(uint first, uint count)
{
#if WIDE == 1
    return first;
#else
    return MIN((Uints)(first) + (Uints)(IOTA), (Uints)(count - 1));
#endif
}

// --- records, to and from vectors of their fields -------------------------------------------------------------------
// Transposes WIDE records of 16 words into 16 vectors of WIDE words, or back: in four steps, by halves, quarters, pairs
// and single ones. Where WIDE is 1 nothing has to be done.
#define RECORD_FIELDS 16
INLINE void turn(Uints *m)
{
#if WIDE == RECORD_FIELDS
#define TURN(step, lows, highs)                                                                                 \
    UNROLL for (int k = 0; k < 16; ++k) if (!(k & step)) {                                                      \
        Uints a = m[k], b = m[k + step];                                                                        \
        m[k] = (Uints)lows, m[k + step] = (Uints)highs;                                                         \
    }
    TURN(8, (a.lo, b.lo), (a.hi, b.hi))
    TURN(4, (a.s0123, b.s0123, a.s89ab, b.s89ab), (a.s4567, b.s4567, a.scdef, b.scdef))
    TURN(2, (a.s01, b.s01, a.s45, b.s45, a.s89, b.s89, a.scd, b.scd), (a.s23, b.s23, a.s67, b.s67, a.sab, b.sab, a.sef, b.sef))
    TURN(1, (a.s0, b.s0, a.s2, b.s2, a.s4, b.s4, a.s6, b.s6, a.s8, b.s8, a.sa, b.sa, a.sc, b.sc, a.se, b.se),
         (a.s1, b.s1, a.s3, b.s3, a.s5, b.s5, a.s7, b.s7, a.s9, b.s9, a.sb, b.sb, a.sd, b.sd, a.sf, b.sf))
#undef TURN
#endif
}

// Loads the records list[at], list[at + 1], ... as one vector for each of their fields. Elements past `last` repeat
// that one.
INLINE void load_records(global const Triangle *records, global const uint *list, uint at, uint last, Uints *field)
{
#if WIDE == RECORD_FIELDS
    UNROLL for (int k = 0; k < WIDE; ++k) field[k] = *(global const Uints *)(records + list[MIN(at + k, last)]);
#else
    UNROLL for (int k = 0; k < RECORD_FIELDS; ++k) field[k] = ((global const uint *)(records + list[at]))[k];
#endif
    turn(field);
}

// Writes WIDE records, which are given as one vector for each field. It overwrites `field`.
INLINE void store_records(global Triangle *to, Uints *field)
{
    turn(field);
#if WIDE == RECORD_FIELDS
    UNROLL for (int k = 0; k < WIDE; ++k) STORE_LINE((global Uints *)(to + k), field[k]);
#else
    UNROLL for (int k = 0; k < RECORD_FIELDS; ++k) ((global uint *)to)[k] = field[k];
#endif
}

// Loops over the elements k, for data that is not stored as vectors. FLOAT_OF and INT_OF are element k of a vector.
#define FOR_EACH_ELEMENT for (int k = 0; k < WIDE; ++k)
#define FLOAT_OF(vector) (((float *)&(vector))[k])
#define INT_OF(vector) (((int *)&(vector))[k])

#define IS_FINITE(value) ((AS_UINTS(value) & (Uints)(0x7F800000u)) != (Uints)(0x7F800000u))

// The nearest whole number, halves towards zero. |value| < 2^31.
INLINE Ints nearest(Floats value)
{
    Ints whole = TO(Ints, value);
    Floats rest = value - TO(Floats, whole);
    return whole + (rest > 0.5f ? (Ints)(1) : (Ints)(0)) - (rest < -0.5f ? (Ints)(1) : (Ints)(0));
}

// --- pairs of floats: an unevaluated sum of about 48 bits ----------------------------------------------------------
// Dekker, "A floating-point technique for extending the available precision" (1971), with fma for the exact product.
// Results are returned through a pointer: a struct as return value is passed by a hidden one, which some tools and
// compilers handle badly.
typedef struct { Floats hi, lo; } Pair;

// The exact sum of two floats, whichever is larger (Knuth).
INLINE void two_sum(Floats a, Floats b, Pair *sum)
{
    Floats s = a + b, t = s - a;
    sum->lo = (a - (s - t)) + (b - t);
    sum->hi = s;
}

// The exact sum of two floats, where |a| >= |b|.
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
