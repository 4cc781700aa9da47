// Textures: what their texels are at SHADED pixels, in linear light (OpenGL 4.6, section 8.14; glTF 2.0, section 3.8.4).
//
//   textures   256 floats: the linear light of each byte of sRGB. Then each texture: 16 words, where its levels begin
//              behind these 16, counted in texels; then the texels of its levels, row by row from the top. A texel is 4
//              bytes, of which red, green and blue are sRGB, or 4 floats, which are linear (FLOAT_TEXELS).
//   level      number k of the mip map: the image halved k times
#ifndef TEXTURES_H
#define TEXTURES_H

#include "shading/reals.h"

#define LEVEL_STARTS 16

// What is sampled. u, v: coordinates; u_x, v_x: by how much they grow from pixel to pixel to the right; u_y, v_y: down.
typedef struct { Reals u, v, u_x, v_x, u_y, v_y; } Spot;

// --- one level ------------------------------------------------------------------------------------------------------
// A coordinate within 0 .. 1 that shows the same, whatever is beyond. Outside of 2^23 float32 has no fractions.
INLINE Reals wrapped(Reals u, uint flags, uint mirror, uint clamp)
{
    if (flags & clamp) {
        u = u > (Reals)(0.0f) ? u : (Reals)(0.0f);
        return u < (Reals)(1.0f) ? u : (Reals)(1.0f);
    }
    u = u < (Reals)(0x1p23f) && u > (Reals)(-0x1p23f) ? u : (Reals)(0.0f);
    if (!(flags & mirror)) return u - TO_REALS(floor_of(u));
    u -= 2.0f * TO_REALS(floor_of(0.5f * u));
    return u > (Reals)(1.0f) ? 2.0f - u : u;
}

// The column or row of a texel that may lie beyond an edge by one.
INLINE Wholes at_edge(Wholes place, Wholes side, uint flags, uint mirror, uint clamp)
{
    bool repeat = !(flags & (mirror | clamp));
    place = place < (Wholes)(0) ? (repeat ? place + side : (Wholes)(0)) : place;
    return place >= side ? (repeat ? place - side : side - (Wholes)(1)) : place;
}

// Texels at these places of a texture. colors: whether red, green and blue are wanted, besides alpha.
INLINE void texels_at(global const uint *textures, global const uint *texels, uint flags, Words at, bool colors, Shades *found)
{
    if (flags & FLOAT_TEXELS) {
        at *= (Words)(4u);
        if (colors) {
            found->red = AS_REALS(words_of(texels, at));
            found->green = AS_REALS(words_of(texels + 1, at));
            found->blue = AS_REALS(words_of(texels + 2, at));
        }
        found->alpha = AS_REALS(words_of(texels + 3, at));
        return;
    }
    Words word = words_of(texels, at);
    if (colors) {
        found->red = AS_REALS(words_of(textures, word & (Words)(0xFFu)));
        found->green = AS_REALS(words_of(textures, word >> (Words)(8u) & (Words)(0xFFu)));
        found->blue = AS_REALS(words_of(textures, word >> (Words)(16u) & (Words)(0xFFu)));
    }
    found->alpha = UNIT_OF(TO_REALS(AS_WHOLES(word >> (Words)(24u))));
}

// a + t (b - a), which is a where both are equal.
INLINE void between(Shades *a, const Shades *b, Reals t, bool colors)
{
    if (colors) {
        a->red += t * (b->red - a->red);
        a->green += t * (b->green - a->green);
        a->blue += t * (b->blue - a->blue);
    }
    a->alpha += t * (b->alpha - a->alpha);
}

// The texel nearest to (u, v) of each pixel's level, or the mean of the four around it by distance (`linear`).
INLINE void sample_level(global const uint *textures, global const Material *m, Reals u, Reals v, Wholes level, bool linear,
                         bool colors, Shades *found)
{
    global const uint *starts = textures + m->texture, *texels = starts + LEVEL_STARTS;
    uint flags = m->flags;
    Wholes width = (Wholes)(m->width) >> level, height = (Wholes)(m->height) >> level;
    width = MAX(width, (Wholes)(1)), height = MAX(height, (Wholes)(1));
    Words start = words_of(starts, AS_WORDS(level));
    Reals x = u * TO_REALS(width), y = v * TO_REALS(height);
    if (linear) x -= 0.5f, y -= 0.5f;
    Wholes left = floor_of(x), top = floor_of(y);
    Reals right_share = x - TO_REALS(left), lower_share = y - TO_REALS(top);
    Wholes column = at_edge(left, width, flags, MIRROR_U, CLAMP_U), row = at_edge(top, height, flags, MIRROR_V, CLAMP_V);
    Words upper = start + AS_WORDS(row * width);
    texels_at(textures, texels, flags, upper + AS_WORDS(column), colors, found);
    if (!linear) return;
    Wholes next_column = at_edge(left + (Wholes)(1), width, flags, MIRROR_U, CLAMP_U);
    Wholes next_row = at_edge(top + (Wholes)(1), height, flags, MIRROR_V, CLAMP_V);
    Words lower = start + AS_WORDS(next_row * width);
    Shades other, below, beside;
    texels_at(textures, texels, flags, upper + AS_WORDS(next_column), colors, &other);
    between(found, &other, right_share, colors);
    texels_at(textures, texels, flags, lower + AS_WORDS(column), colors, &below);
    texels_at(textures, texels, flags, lower + AS_WORDS(next_column), colors, &beside);
    between(&below, &beside, right_share, colors);
    between(found, &below, lower_share, colors);
}

INLINE void choose_shades(Wholes which, const Shades *there, Shades *chosen, bool colors)
{
    if (colors) {
        chosen->red = which ? there->red : chosen->red;
        chosen->green = which ? there->green : chosen->green;
        chosen->blue = which ? there->blue : chosen->blue;
    }
    chosen->alpha = which ? there->alpha : chosen->alpha;
}

// A level by the filter within levels: that for larger texels than pixels where `magnified`, else that for smaller ones.
INLINE void filter_level(global const uint *textures, global const Material *m, Reals u, Reals v, Wholes level,
                         Wholes magnified, bool colors, Shades *found)
{
    bool magnify = m->flags & MAGNIFY_LINEAR, minify = m->flags & MINIFY_LINEAR;
    sample_level(textures, m, u, v, level, minify, colors, found);
    if (magnify == minify) return;
    Shades other;
    sample_level(textures, m, u, v, level, magnify, colors, &other);
    choose_shades(magnified, &other, found, colors);
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

// The image at a spot, by level of detail: level 0 where `detail` is 0 or less.
INLINE void sample_detail(global const uint *textures, global const Material *m, Reals u, Reals v, Reals detail, bool colors,
                          Shades *found)
{
    const Reals zero = (Reals)(0.0f);
    u = wrapped(u, m->flags, MIRROR_U, CLAMP_U), v = wrapped(v, m->flags, MIRROR_V, CLAMP_V);
    Wholes magnified = detail > zero ? (Wholes)(0) : (Wholes)(-1);
    Reals last = (Reals)((float)m->last_level);
    detail = detail > zero ? detail : zero, detail = detail < last ? detail : last;
    Wholes level = TO_WHOLES(detail);
    Reals rest = detail - TO_REALS(level);
    if (!(m->flags & BETWEEN_LEVELS)) {  // the nearest level: of two equally near ones the finer
        level += rest > (Reals)(0.5f) ? (Wholes)(1) : (Wholes)(0);
        rest = zero;
    }
    filter_level(textures, m, u, v, level, magnified, colors, found);
    if (!SHADED_BITS_OF(rest > zero)) return;
    Wholes next = level + (Wholes)(1);
    Shades coarser;
    filter_level(textures, m, u, v, MIN(next, (Wholes)(m->last_level)), magnified, colors, &coarser);
    between(found, &coarser, rest, colors);
}

// The texture of a material at a spot. PROBES: the most probes along a pixel's longer side (EXT_texture_filter_anisotropic).
INLINE void sample_texture(global const uint *textures, global const Material *m, const Spot *spot, bool colors, Shades *found)
{
#if LEVELS
    float width = m->width, height = m->height;
    Reals across = spot->u_x * width, down = spot->v_x * height, x2 = across * across + down * down;
    across = spot->u_y * width, down = spot->v_y * height;
    Reals y2 = across * across + down * down, longest2 = MAX(x2, y2);
#if PROBES > 1
    Reals shortest2 = MIN(x2, y2), ratio2 = longest2 / shortest2;
    // The number of probes is the ratio, rounded up: compared by its square, which needs no root.
    Wholes probes = (Wholes)(1);
    for (int n = 1; n < PROBES; ++n) probes += ratio2 > (Reals)((float)(n * n)) ? (Wholes)(1) : (Wholes)(0);
    Reals count = TO_REALS(probes), detail = 0.5f * log2_of(longest2 / (count * count));
    Wholes x_longer = x2 > y2 ? (Wholes)(-1) : (Wholes)(0);
    Reals along_u = x_longer ? spot->u_x : spot->u_y, along_v = x_longer ? spot->v_x : spot->v_y;
    Shades sum;
    if (colors) sum.red = sum.green = sum.blue = (Reals)(0.0f);
    sum.alpha = (Reals)(0.0f);
    for (int n = 0; n < PROBES; ++n) {
        Wholes wanted = probes > (Wholes)(n) ? (Wholes)(-1) : (Wholes)(0);
        if (!SHADED_BITS_OF(wanted)) break;
        Reals step = ((float)n + 0.5f) / count - 0.5f;
        Shades probe;
        sample_detail(textures, m, spot->u + step * along_u, spot->v + step * along_v, detail, colors, &probe);
        if (n == 0) *found = probe;
        if (colors) {
            sum.red += wanted ? probe.red : (Reals)(0.0f);
            sum.green += wanted ? probe.green : (Reals)(0.0f);
            sum.blue += wanted ? probe.blue : (Reals)(0.0f);
        }
        sum.alpha += wanted ? probe.alpha : (Reals)(0.0f);
    }
    // Where there is one probe, it is not divided, and where all alphas are 1, their mean is.
    if (colors) sum.red /= count, sum.green /= count, sum.blue /= count;
    sum.alpha /= count;
    choose_shades(probes > (Wholes)(1) ? (Wholes)(-1) : (Wholes)(0), &sum, found, colors);
#else
    sample_detail(textures, m, spot->u, spot->v, 0.5f * log2_of(longest2), colors, found);
#endif
#else
    sample_detail(textures, m, spot->u, spot->v, (Reals)(0.0f), colors, found);
#endif
}

#endif
