// Textures: what their texels are at SHADED pixels, in linear light (OpenGL 4.6, section 8.14; glTF 2.0, section 3.8.4).
//
//   textures   tables (shading/reals.h), then each texture: 16 words, where its levels begin behind these 16, counted in
//              texels; then the texels of its levels, row by row from the top. Behind each row lies once more the texel
//              that is to the right of its last one: the first, if it repeats, else the last. A texel is 4 floats, which
//              are linear (FLOAT_TEXELS). Of large textures it is 4 bytes, of which red, green and blue are sRGB.
//   level      number k of the mip map: the image halved k times
#ifndef TEXTURES_H
#define TEXTURES_H

#include "shading/reals.h"

// --- one level ------------------------------------------------------------------------------------------------------
// A coordinate within 0 .. 1 that shows the same, whatever is beyond. Outside of 2^23 float32 has no fractions.
INLINE Reals wrapped(Reals u, uint flags, uint mirror, uint clamp)
{
    if (flags & clamp) {
        u = u > (Reals)(0.0f) ? u : (Reals)(0.0f);
        return u < (Reals)(1.0f) ? u : (Reals)(1.0f);
    }
    u = u < (Reals)(0x1p23f) && u > (Reals)(-0x1p23f) ? u : (Reals)(0.0f);
    if (!(flags & mirror)) return u - floor_of(u);
    u -= 2.0f * floor_of(0.5f * u);
    return u > (Reals)(1.0f) ? 2.0f - u : u;
}

// The column or row of a texel that may lie beyond an edge by one.
INLINE Wholes at_edge(Wholes place, Wholes side, uint flags, uint mirror, uint clamp)
{
    bool repeat = !(flags & (mirror | clamp));
    place = place < (Wholes)(0) ? (repeat ? place + side : (Wholes)(0)) : place;
    return place >= side ? (repeat ? place - side : side - (Wholes)(1)) : place;
}

// Where SHADED pixels sample a level: the places of two texels, each with the one to its right; and how far the pixel is
// from the first two to the other two, and from left to right.
typedef struct { Words upper, lower; Reals down, right; } Taps;

// The four texels around (u, v) of each pixel's level, by distance. Where `linear` is 0, it is no way from the nearest one
// to the others, so that it is what their mean is.
INLINE void taps_of(global const Mapping *m, global const uint *starts, Reals u, Reals v, Wholes level, Wholes linear,
                    Taps *taps)
{
    uint flags = m->flags;
    Wholes width = (Wholes)(m->width) >> level, height = (Wholes)(m->height) >> level;
    width = MAX(width, (Wholes)(1)), height = MAX(height, (Wholes)(1));
    Words start = words_of_16(starts, AS_WORDS(level));
    const Reals zero = (Reals)(0.0f), half_texel = linear ? (Reals)(0.5f) : zero;
    Reals x = u * TO_REALS(width) - half_texel, y = v * TO_REALS(height) - half_texel;
    Reals first_x = floor_of(x), first_y = floor_of(y);
    Wholes left = TO_WHOLES(first_x), top = TO_WHOLES(first_y), one = linear ? (Wholes)(1) : (Wholes)(0);
    taps->right = linear ? x - first_x : zero, taps->down = linear ? y - first_y : zero;
    // Left of the first column lies that column again, unless it repeats.
    if (flags & (MIRROR_U | CLAMP_U)) taps->right = left < (Wholes)(0) ? zero : taps->right;
    Wholes stride = width + (Wholes)(1);
    Words column = start + AS_WORDS(at_edge(left, width, flags, MIRROR_U, CLAMP_U));
    taps->upper = column + AS_WORDS(at_edge(top, height, flags, MIRROR_V, CLAMP_V) * stride);
    taps->lower = column + AS_WORDS(at_edge(top + one, height, flags, MIRROR_V, CLAMP_V) * stride);
}

// A texel of bytes, linear.
INLINE float4 decoded(global const uint *textures, bool numbers, uint word)
{
    if (numbers) return UNIT_OF((float4)(word & 0xFF, word >> 8 & 0xFF, word >> 16 & 0xFF, word >> 24));
    global const float *linear = (global const float *)textures;
    return (float4)(linear[word & 0xFF], linear[word >> 8 & 0xFF], linear[word >> 16 & 0xFF], UNIT_OF((float)(word >> 24)));
}

// A texel and the one to its right. Vectors usually begin at multiples of their own size.
typedef float8 TwoTexels __attribute__((aligned(16)));
INLINE float8 texels_at(global const uint *textures, global const uint *texels, uint kind, uint place)
{
    bool numbers = MAPS && kind & NUMBERS;
    if (kind & FLOAT_TEXELS) return *(global const TwoTexels *)(texels + (size_t)4 * place);
    return (float8)(decoded(textures, numbers, texels[place]), decoded(textures, numbers, texels[place + 1]));
}

// The means of the four texels of pixel k and of those after it. Behind the last pixel it is repeated. a + t (b - a) is a
// where both are equal.
INLINE Part mean_of_taps(global const uint *textures, global const uint *texels, uint kind, const Taps *taps, int k, int last)
{
    float8 columns[PART_COLORS];
    UNROLL for (int j = 0; j < PART_COLORS; ++j) {
        int own = MIN(k + j, last);
        float8 upper = texels_at(textures, texels, kind, ONE_OF(uint, taps->upper, own));
        float8 lower = texels_at(textures, texels, kind, ONE_OF(uint, taps->lower, own));
        columns[j] = upper + ONE_OF(float, taps->down, own) * (lower - upper);
    }
    Part left = LEFT_PART(columns), right = RIGHT_PART(columns);
    return left + for_channels(taps->right, k) * (right - left);
}

// The first `count` pixels by their taps of one level; or of two levels, `rest` of the way to the coarser one.
INLINE void mix_taps(global const uint *textures, global const uint *texels, uint kind, const Taps *taps, int count,
                     Part found[PARTS])
{
    for (int k = 0; k < count; k += PART_COLORS) *found++ = mean_of_taps(textures, texels, kind, taps, k, count - 1);
}
INLINE void mix_levels(global const uint *textures, global const uint *texels, uint kind, const Taps *taps,
                       const Taps *coarser, Reals rest, int count, Part found[PARTS])
{
    for (int k = 0; k < count; k += PART_COLORS) {
        Part fine = mean_of_taps(textures, texels, kind, taps, k, count - 1);
        Part coarse = mean_of_taps(textures, texels, kind, coarser, k, count - 1);
        *found++ = fine + for_channels(rest, k) * (coarse - fine);
    }
}

// --- levels ---------------------------------------------------------------------------------------------------------
// log2 of a positive number, to 3e-6: its exponent, and a polynomial of its mantissa that is exact at 1 and 2.
INLINE Reals log2_of(Reals value)
{
    Wholes bits = AS_WHOLES(value);
    Reals exponent = TO_REALS((bits >> (Wholes)(23)) - (Wholes)(127));
    Reals f = AS_REALS((bits & (Wholes)(0x7FFFFF)) | (Wholes)(0x3F800000)) - 1.0f;
    Reals sum = -0.0258414f * f + 0.121797748f;
    sum = sum * f - 0.277905136f;
    sum = sum * f + 0.457549095f;
    sum = sum * f - 0.718145251f;
    sum = sum * f + 1.442544937f;
    return exponent + sum * f;
}

// The image at (u, v), by level of detail: level 0 where `detail` is 0 or less. count: how many pixels are wanted.
INLINE void sample_detail(global const uint *textures, global const Mapping *m, Reals u, Reals v, Reals detail, int count,
                          Part found[PARTS])
{
    const Reals zero = (Reals)(0.0f);
    global const uint *starts = textures + m->texture, *texels = starts + LEVEL_STARTS;
    uint kind = m->flags & (MAPS ? FLOAT_TEXELS | NUMBERS : FLOAT_TEXELS);
    u = wrapped(u, m->flags, MIRROR_U, CLAMP_U), v = wrapped(v, m->flags, MIRROR_V, CLAMP_V);
    Wholes magnify = m->flags & MAGNIFY_LINEAR ? (Wholes)(-1) : (Wholes)(0);
    Wholes minify = m->flags & MINIFY_LINEAR ? (Wholes)(-1) : (Wholes)(0);
    Wholes linear = detail > zero ? minify : magnify, level = (Wholes)(0);
    Taps taps;
#if LEVELS
    Reals last = (Reals)((float)m->last_level);
    detail = detail > zero ? detail : zero, detail = detail < last ? detail : last;
    level = TO_WHOLES(detail);
    Reals rest = detail - TO_REALS(level);
    if (!(m->flags & BETWEEN_LEVELS)) {  // the nearest level: of two equally near ones the finer
        level += rest > (Reals)(0.5f) ? (Wholes)(1) : (Wholes)(0);
        rest = zero;
    }
    uint both = SHADED_BITS_OF(rest > zero) & FIRST_BITS(count);
#endif
    taps_of(m, starts, u, v, level, linear, &taps);
#if LEVELS
    if (both) {
        Taps coarser;
        taps_of(m, starts, u, v, MIN(level + (Wholes)(1), (Wholes)(m->last_level)), linear, &coarser);
        if (kind & FLOAT_TEXELS) mix_levels(textures, texels, FLOAT_TEXELS, &taps, &coarser, rest, count, found);
        else mix_levels(textures, texels, kind, &taps, &coarser, rest, count, found);
        return;
    }
#endif
    if (kind & FLOAT_TEXELS) mix_taps(textures, texels, FLOAT_TEXELS, &taps, count, found);
    else mix_taps(textures, texels, kind, &taps, count, found);
}

// --- where a texture is sampled -------------------------------------------------------------------------------------
// u, v: coordinates. across2: the square of how far a pixel reaches over level 0, in texels. along_u, along_v: by how much
// u and v grow along a pixel's longer side, where so many `probes` lie (EXT_texture_filter_anisotropic).
typedef struct {
    Reals u, v;
#if LEVELS
    Reals across2;
#endif
#if PROBES > 1
    Reals along_u, along_v, probes;
#endif
} Spot;

#if LEVELS
// Finds how far a pixel reaches, and its probes. u_x, v_x: by how much u and v grow from pixel to pixel to the right; u_y,
// v_y: down.
INLINE void reach_of(global const Mapping *m, Reals u_x, Reals v_x, Reals u_y, Reals v_y, Spot *spot)
{
    float width = m->width, height = m->height;
    Reals across = u_x * width, down = v_x * height, x2 = across * across + down * down;
    across = u_y * width, down = v_y * height;
    Reals y2 = across * across + down * down, longest2 = MAX(x2, y2);
#if PROBES > 1
    Reals shortest2 = MIN(x2, y2), ratio2 = longest2 / shortest2, probes = (Reals)(1.0f);
    // The number of probes is the ratio, rounded up. Its square is compared, as that needs no root.
    for (int n = 1; n < PROBES; ++n) probes += ratio2 > (Reals)((float)(n * n)) ? (Reals)(1.0f) : (Reals)(0.0f);
    Wholes x_longer = x2 > y2 ? (Wholes)(-1) : (Wholes)(0);
    spot->along_u = x_longer ? u_x : u_y, spot->along_v = x_longer ? v_x : v_y, spot->probes = probes;
    longest2 /= probes * probes;
#endif
    spot->across2 = longest2;
}
#endif

// The texture of a material at the first `count` pixels. PROBES: the most probes of a pixel.
INLINE void sample_texture(global const uint *textures, global const Mapping *m, const Spot *spot, int count, Part found[PARTS])
{
#if LEVELS
    Reals detail = 0.5f * log2_of(spot->across2);
#else
    const Reals detail = (Reals)(0.0f);
#endif
#if PROBES > 1
    Part probe[PARTS];
    for (int n = 0; n < PROBES; ++n) {
        if (!(SHADED_BITS_OF(spot->probes > (Reals)((float)n)) & FIRST_BITS(count))) break;
        Reals step = ((float)n + 0.5f) / spot->probes - 0.5f;
        sample_detail(textures, m, spot->u + step * spot->along_u, spot->v + step * spot->along_v, detail, count,
                      n ? probe : found);
        for (int k = 0; n && k < count; ++k)
            if (ONE_OF(float, spot->probes, k) > (float)n) ((float4 *)found)[k] += ((const float4 *)probe)[k];
    }
    for (int k = 0; k < count; ++k)
        if (ONE_OF(float, spot->probes, k) > 1.0f) ((float4 *)found)[k] /= ONE_OF(float, spot->probes, k);
#else
    sample_detail(textures, m, spot->u, spot->v, detail, count, found);
#endif
}

#endif
