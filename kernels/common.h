// What every kernel stands on: arithmetic that gives the same bits on every device, and the order of depths.
#ifndef COMMON_H
#define COMMON_H

// Contraction would let a compiler round a * b + c once or twice as it likes.
#pragma OPENCL FP_CONTRACT OFF

// --- vectors of STRIP pixels ------------------------------------------------------------------------------------
#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)
#define VECTOR(type) PASTE(type, STRIP)
#define CONVERT(type) PASTE(convert_, VECTOR(type))
#define VLOAD PASTE(vload, STRIP)
#define VSTORE PASTE(vstore, STRIP)
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
typedef struct { float high, low; } Pair;

static inline Pair pair_of(float high, float low) { Pair p = {high, low}; return p; }

// The exact sum of two floats (Knuth): no assumption on their sizes.
static inline Pair two_sum(float a, float b)
{
    float s = a + b, t = s - a;
    return pair_of(s, (a - (s - t)) + (b - t));
}

// The same where |a| >= |b|.
static inline Pair quick_two_sum(float a, float b)
{
    float s = a + b;
    return pair_of(s, b - (s - a));
}

static inline Pair pair_add(Pair a, Pair b)
{
    Pair s = two_sum(a.high, b.high);
    return quick_two_sum(s.high, s.low + (a.low + b.low));
}

static inline Pair pair_sub(Pair a, Pair b) { return pair_add(a, pair_of(-b.high, -b.low)); }

static inline Pair pair_mul(Pair a, Pair b)
{
    float p = a.high * b.high, e = fma(a.high, b.high, -p);
    return quick_two_sum(p, e + (a.high * b.low + a.low * b.high));
}

static inline Pair pair_div(Pair a, Pair b)
{
    float q = a.high / b.high;
    float r = fma(-q, b.high, a.high);  // exact
    return quick_two_sum(q, ((r + a.low) - q * b.low) / b.high);
}

// --- depth ----------------------------------------------------------------------------------------------------------
// Reversed depth (larger is nearer) to an unsigned key whose ascending order is front to back.
// The usual monotone map of floats, complemented: -0.0 and negative values keep their place.
static inline uint depth_key(float depth)
{
    uint bits = as_uint(depth);
    return bits & 0x80000000u ? bits : ~(bits | 0x80000000u);
}

// --- colour ---------------------------------------------------------------------------------------------------------
static inline float4 unpack_color(uint rgba) { return convert_float4(as_uchar4(rgba)) / 255.0f; }

// --- the sample grid, in subpixels from the image's centre ---------------------------------------------------------
static inline int sample_at(int pixel, int side) { return pixel * SUBPIXELS + SUBPIXELS / 2 - side * (SUBPIXELS / 2); }

// First pixel whose sample lies at or right of (below) the coordinate, and last one at or left of (above) it.
static inline int first_pixel(int coordinate, int side)
{
    return (coordinate + side * (SUBPIXELS / 2) + SUBPIXELS / 2 - 1) >> SUBPIXEL_BITS;
}
static inline int last_pixel(int coordinate, int side)
{
    return (coordinate + side * (SUBPIXELS / 2) - SUBPIXELS / 2) >> SUBPIXEL_BITS;
}

#endif
