// SHADED consecutive pixels of a strip, which are shaded at once for one record. A lane that works alone has vectors, and
// computes all their elements, covered or not. Several lanes shade pixels one by one. The code is the same: conditions are
// chosen by `?:`, which takes vectors and numbers alike. A colour is four floats. So what makes colours of texels or of
// corners goes pixel by pixel, over covered ones alone, and their colours are put side by side.
#ifndef REALS_H
#define REALS_H

#include "base/common.h"

#if LANES > 1
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
#define ONE_OF(type, reals, k) (reals)
#else
#ifdef __AVX512F__
#define SHADED 16
typedef float16 Reals;
typedef int16 Wholes;
typedef uint16 Words;
#else
#define SHADED 8
typedef float8 Reals;
typedef int8 Wholes;
typedef uint8 Words;
#endif
#define TO_WHOLES(value) CONVERT(int, SHADED, value)
#define TO_REALS(value) CONVERT(float, SHADED, value)
#define AS_WHOLES(value) PASTE(as_int, SHADED)(value)
#define AS_WORDS(value) PASTE(as_uint, SHADED)(value)
#define AS_REALS(value) PASTE(as_float, SHADED)(value)
#define SAMPLES_OF(vector, first) (((const Reals *)&(vector))[(first) / SHADED])
#define LOWEST_SHADED(bits) LOWEST_BIT(bits)
#define SHADED_BITS_OF(truth) PASTE(bits_of, SHADED)(truth)
#define ONE_OF(type, reals, k) (((const type *)&(reals))[k])
#endif
#define FIRST_BITS(count) ((1u << (count)) - 1)
#define SHADED_BITS FIRST_BITS(SHADED)

// Columns and rows of SHADED pixels, relative to the first. SHADED_X, SHADED_Y: how many steps their samples lie right
// of the first one's, and below it.
#if SHADED == 16
#define SHADED_COLUMNS (int16)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3)
#define SHADED_ROWS (int16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3)
#elif SHADED == 8
#define SHADED_COLUMNS (int8)(0, 1, 2, 3, 0, 1, 2, 3)
#define SHADED_ROWS (int8)(0, 0, 0, 0, 1, 1, 1, 1)
#endif
#if PATTERNED
#define SHADED_QUARTERS(quarters, numbers) ((Wholes)((quarters) & 255) >> (numbers) * 2 & (Wholes)(3))
#define SHADED_X (SHADED_COLUMNS * PIXEL_STEPS + SHADED_QUARTERS(PATTERN, SHADED_ROWS))
#define SHADED_Y                                                                                                \
    (SHADED_ROWS * PIXEL_STEPS + SHADED_QUARTERS(PATTERN >> 8, SHADED_COLUMNS) - QUARTERS_DOWN(PATTERN, 0))
#else
#define SHADED_X SHADED_COLUMNS
#define SHADED_Y SHADED_ROWS
#endif

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

INLINE Reals least_of(Reals a, Reals b)
{
#if SHADED == 16 && __has_builtin(__builtin_ia32_minps512)
    return __builtin_ia32_minps512(a, b, 4);
#elif SHADED == 8 && __has_builtin(__builtin_ia32_minps256)
    return __builtin_ia32_minps256(a, b);
#else
    return MIN(a, b);
#endif
}

// The words at these places, which are below 2^31.
INLINE Words words_of(global const uint *from, Words at)
{
#if SHADED == 1
    return from[at];
#elif SHADED == 16 && __has_builtin(__builtin_ia32_gathersiv16si)
    return as_uint16(__builtin_ia32_gathersiv16si((int16)(0), (const void *)(size_t)from, as_int16(at), (ushort)0xFFFF, 4));
#elif SHADED == 8 && AVX2_GATHER
    return as_uint8(__builtin_ia32_gatherd_d256((int8)(0), (const int *)(size_t)from, as_int8(at), (int8)(-1), 4));
#else
    Words found;
    UNROLL for (int k = 0; k < SHADED; ++k) ((uint *)&found)[k] = from[((const uint *)&at)[k]];
    return found;
#endif
}

// Of 16 words, which begin at a multiple of 4, those at these places: the low four bits of each count.
INLINE Words words_of_16(global const uint *from, Words at)
{
#if SHADED == 16 && __has_builtin(__builtin_ia32_permvarsi512)
    typedef int16 Any __attribute__((aligned(16)));
    return as_uint16(__builtin_ia32_permvarsi512(*(global const Any *)from, as_int16(at)));
#else
    return words_of(from, at & (Words)(15u));
#endif
}

// The greatest whole number that is not above. It fits 24 bits.
INLINE Reals floor_of(Reals value)
{
#if SHADED == 16 && __has_builtin(__builtin_ia32_rndscaleps_mask)
    return __builtin_ia32_rndscaleps_mask(value, 1, value, (ushort)0xFFFF, 4);
#elif SHADED == 8 && __has_builtin(__builtin_ia32_roundps256)
    return __builtin_ia32_roundps256(value, 1);
#else
    Reals whole = TO_REALS(TO_WHOLES(value));
    return whole - (value < whole ? (Reals)(1.0f) : (Reals)(0.0f));
#endif
}

// --- sRGB -----------------------------------------------------------------------------------------------------------
// textures: begins with tables (clpeel/stages/shading.py): 256 floats, the linear light of each byte of sRGB; then 16
// floats, 1.055 times 2^(5/12 e) for e = -15 .. 0.

// Linear light 0 .. 1 as sRGB (IEC 61966-2-1). The power 5/12 is that of the exponent, from the second table, times that of
// the mantissa, a polynomial to 3e-8.
INLINE Reals srgb_by(global const uint *scales, Reals value)
{
    Words bits = AS_WORDS(value);
    Reals scale = AS_REALS(words_of_16(scales, bits >> (Words)(23u)));
    Reals f = AS_REALS((bits & (Words)(0x7FFFFFu)) | (Words)(0x3F800000u)) - 1.5f;
    Reals sum = 0.0015331956f * f - 0.0027445413f;
    sum = sum * f + 0.0045665833f;
    sum = sum * f - 0.0096255392f;
    sum = sum * f + 0.0225073248f;
    sum = sum * f - 0.0639567152f;
    sum = sum * f + 0.3289036453f;
    sum = sum * f + 1.1840536594f;
    Reals curve = least_of(scale * sum - 0.055f, (Reals)(1.0f));  // white may miss 1 by a rounding
    return value > (Reals)(0.0031308f) ? curve : 12.92f * value;
}
INLINE Reals to_srgb(global const uint *textures, Reals value) { return srgb_by(textures + SRGB_SCALES, value); }

// sRGB 0 .. 1 as linear light, to 2e-6 of what is shown. The power 2.4 is that of 2, times that of 0.4, a polynomial of the
// root.
INLINE Reals to_linear(Reals value)
{
    Reals base = (value + 0.055f) * 0x1.e54edcp-1f, root = square_root(base), f = root - 0.65f;
    Reals sum = 0.080373914f * f - 0.058175549f;
    sum = sum * f + 0.062352423f;
    sum = sum * f - 0.111554794f;
    sum = sum * f + 0.832914054f;
    Reals curve = base * base * (1.0f + (root - 1.0f) * sum);
    return value > (Reals)(0.04045f) ? curve : value * 0x1.3d0722p-4f;
}

// --- colours --------------------------------------------------------------------------------------------------------
// A part of SHADED colours: as many as a vector has room for, four floats each. Lanes that shade one by one have one.
// LEFT_PART, RIGHT_PART: the part of the first, and of the second halves of so many pairs of colours.
#if SHADED == 1
#define PART_COLORS 1
typedef float4 Part;
#define PART_CHANNELS (int4)(0, 1, 2, 3)
#define SAME_PART(color) (color)
#define LEFT_PART(pairs) (pairs)[0].lo
#define RIGHT_PART(pairs) (pairs)[0].hi
#elif SHADED == 16
#define PART_COLORS 4
typedef float16 Part;
#define PART_CHANNELS SHADED_COLUMNS
#define SAME_PART(color) (float16)(color, color, color, color)
#define LEFT_PART(pairs) (float16)((pairs)[0].lo, (pairs)[1].lo, (pairs)[2].lo, (pairs)[3].lo)
#define RIGHT_PART(pairs) (float16)((pairs)[0].hi, (pairs)[1].hi, (pairs)[2].hi, (pairs)[3].hi)
#else
#define PART_COLORS 2
typedef float8 Part;
#define PART_CHANNELS SHADED_COLUMNS
#define SAME_PART(color) (float8)(color, color)
#define LEFT_PART(pairs) (float8)((pairs)[0].lo, (pairs)[1].lo)
#define RIGHT_PART(pairs) (float8)((pairs)[0].hi, (pairs)[1].hi)
#endif
#define PARTS (SHADED / PART_COLORS)

// Numbers of pixel k and of those after it, each for all channels of its colour.
INLINE Part for_channels(Reals values, int k)
{
#if SHADED == 16 && __has_builtin(__builtin_ia32_permvarsf512)
    return __builtin_ia32_permvarsf512(values, (int16)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3) + (int16)(k));
#elif SHADED == 8 && defined(__AVX2__) && __has_builtin(__builtin_ia32_permvarsf256)
    return __builtin_ia32_permvarsf256(values, (int8)(0, 0, 0, 0, 1, 1, 1, 1) + (int8)(k));
#else
    Part found;
    UNROLL for (int j = 0; j < PART_COLORS; ++j) ((float4 *)&found)[j] = (float4)(ONE_OF(float, values, k + j));
    return found;
#endif
}

// Where the alphas are: -1, else 0.
#define ALPHAS (PART_CHANNELS == 3)

// Linear colours as sRGB. Their alphas mean nothing then.
INLINE Part part_to_srgb(global const uint *textures, Part color)
{
#if SHADED == 1
    return (float4)(to_srgb(textures, color.x), to_srgb(textures, color.y), to_srgb(textures, color.z), color.w);
#else
    return to_srgb(textures, color);
#endif
}

// Colours in sRGB as linear ones: a part, whose alphas mean nothing then, and one, whose alpha stays.
INLINE Part part_to_linear(Part color)
{
#if SHADED == 1
    return (float4)(to_linear(color.x), to_linear(color.y), to_linear(color.z), color.w);
#else
    return to_linear(color);
#endif
}
INLINE float4 linear_color(float4 color)
{
    Part found = (Part)(0.0f);
    *(float4 *)&found = color;
    found = part_to_linear(found);
    return (float4)(((const float4 *)&found)->xyz, color.w);
}

// SHADED colours as numbers of each channel, and the reverse.
INLINE void to_channels(const float4 *colors, Reals channels[4])
{
#if SHADED == 1
    UNROLL for (int c = 0; c < 4; ++c) channels[c] = ((const float *)colors)[c];
#else
    UNROLL for (int k = 0; k < SHADED / 4; ++k) {
        float4 a = colors[4 * k], b = colors[4 * k + 1], c = colors[4 * k + 2], d = colors[4 * k + 3];
        TRANSPOSE(a, b, c, d)
        ((float4 *)channels)[k] = a, ((float4 *)(channels + 1))[k] = b;
        ((float4 *)(channels + 2))[k] = c, ((float4 *)(channels + 3))[k] = d;
    }
#endif
}
INLINE void of_channels(const Reals channels[4], float4 *colors)
{
#if SHADED == 1
    UNROLL for (int c = 0; c < 4; ++c) ((float *)colors)[c] = channels[c];
#else
    UNROLL for (int k = 0; k < SHADED / 4; ++k) {
        float4 a = ((const float4 *)channels)[k], b = ((const float4 *)(channels + 1))[k];
        float4 c = ((const float4 *)(channels + 2))[k], d = ((const float4 *)(channels + 3))[k];
        TRANSPOSE(a, b, c, d)
        colors[4 * k] = a, colors[4 * k + 1] = b, colors[4 * k + 2] = c, colors[4 * k + 3] = d;
    }
#endif
}

#endif
