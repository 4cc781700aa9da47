// Lights: how SHADED fragments look under lights (LIGHTS), in linear light. Surfaces are those of glTF 2.0, appendix B:
//
//   diffuse   base_color (1 - metallic) (1 - albedo of the dielectric's highlight)
//   highlight a mixture, by `metallic`, of those of a dielectric, with f0 = 0.04, and of a metal, with f0 = base_color:
//             Schlick's F = f0 + (1 - f0) (1 - v.h)^5
//             GGX's D = a^2 / (pi (sin^2 + a^2 cos^2)^2) of the angle between n and h; a = roughness^2
//             Smith's V = 0.5 / (n.l sqrt((n.v)^2 (1 - a^2) + a^2) + n.v sqrt((n.l)^2 (1 - a^2) + a^2))
//
// One reflection by this model loses light where a surface is rough. What is lost is given back: the highlight is
// multiplied by 1 + f0 (1 / E - 1), where E is how much of all light one reflection returns if f0 is 1 (Turquin 2019).
// What the highlight takes, the diffuse part does not get. So a white surface in even white light is white.
//
// All of it is in the camera's space: x to the right, y up, z towards the camera; and relative to the camera, so that it is
// as precise far from the origin. Roots, quotients, sums and products alone are used. So it has the same bits everywhere.
#ifndef LIGHTS_H
#define LIGHTS_H

#include "shading/textures.h"

// What light falls on at SHADED pixels. normal: of any length, on the side that is seen. ray: where the pixels lie
// across and down on a plane at distance 1 (in parallel projection: from the middle, in scene units). distance: along the
// view. The rest is the material's: factors times texels.
typedef struct {
    Reals normal[3], ray[2];
#if POSITIONED
    Reals distance;
#endif
#if MAPS
    Reals metallic, roughness, occlusion, emissive[3];
#endif
} Surface;

INLINE Reals dot_of(const Reals a[3], const Reals b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// A vector of length 1. Of length 0 it is that towards the camera.
INLINE void to_unit(Reals vector[3])
{
    Reals length2 = dot_of(vector, vector), scale = 1.0f / square_root(length2);
    const Reals zero = (Reals)(0.0f);
    // Lengths whose squares are beyond float32, or vanish, are left to the caller.
    Reals known = length2 > zero ? scale : zero;
    vector[0] *= known, vector[1] *= known;
    vector[2] = length2 > zero ? vector[2] * known : (Reals)(1.0f);
}

// How much one reflection returns of even light: of light that f0 is multiplied with, and of all light if f0 is 1.
// tables: see clpeel/stages/albedo.py: ALBEDO_SIDE numbers for roots of n.v for each of ALBEDO_SIDE roughnesses.
// own: those of a material's one roughness.
INLINE Reals row_of(global const float *row, Words column, Reals rest)
{
    Reals first = AS_REALS(words_of_16((global const uint *)row, column));
    Reals second = AS_REALS(words_of_16((global const uint *)row, column + (Words)(1)));
    return first + rest * (second - first);
}
INLINE void albedo_of(global const Material *m, Reals facing, Reals *any, Reals *all)
{
    Reals place = square_root(facing) * (float)(ALBEDO_SIDE - 1), whole = floor_of(place);
    whole = least_of(whole, (Reals)((float)(ALBEDO_SIDE - 2)));
    Words column = AS_WORDS(TO_WHOLES(whole));
    *any = row_of(m->albedo, column, place - whole), *all = row_of(m->albedo + ALBEDO_SIDE, column, place - whole);
}
#if MAPS
INLINE Reals cell_of(global const uint *table, Words at, Reals across, Reals down)
{
    Reals a = AS_REALS(words_of(table, at)), b = AS_REALS(words_of(table, at + (Words)(1)));
    Reals c = AS_REALS(words_of(table, at + (Words)(ALBEDO_SIDE)));
    Reals d = AS_REALS(words_of(table, at + (Words)(ALBEDO_SIDE + 1)));
    a += across * (b - a), c += across * (d - c);
    return a + down * (c - a);
}
INLINE void albedo_at(global const uint *textures, Reals facing, Reals rough, Reals *any, Reals *all)
{
    const Reals last = (Reals)((float)(ALBEDO_SIDE - 2));
    Reals across = square_root(facing) * (float)(ALBEDO_SIDE - 1), down = rough * (float)(ALBEDO_SIDE - 1);
    Reals column = least_of(floor_of(across), last), row = least_of(floor_of(down), last);
    Words at = AS_WORDS(TO_WHOLES(row * (float)ALBEDO_SIDE + column));
    across -= column, down -= row;
    *any = cell_of(textures + ALBEDO_TABLES, at, across, down);
    *all = cell_of(textures + ALBEDO_TABLES + ALBEDO_SIDE * ALBEDO_SIDE, at, across, down);
}
#endif

// What all lamps give, each times how much it meets the surface: `even` light, and what highlights reflect of it: `plain`,
// which f0 is multiplied with, and `edge`, which it is not.
typedef struct { Reals even[3], plain[3], edge[3]; } Received;

// Adds one lamp. n, v: of length 1. facing: n.v, above 0. a2: the fourth power of roughness. facing_shadow: the root of V that
// all lamps have in common.
INLINE void add_lamp(global const Lamp *lamp, const Surface *s, const Reals n[3], const Reals v[3], Reals facing, Reals a2,
                     Reals facing_shadow, global const Lighting *lighting, Received *sum)
{
    const Reals zero = (Reals)(0.0f), one = (Reals)(1.0f);
    Reals l[3], power = one;
#if POSITIONED
    if (lamp->placed) {
        Reals away = lighting->perspective ? s->distance : one;
        l[0] = lamp->toward[0] - s->ray[0] * away, l[1] = lamp->toward[1] + s->ray[1] * away;
        l[2] = lamp->toward[2] + s->distance;
        Reals length2 = dot_of(l, l);
        Reals inverse = length2 > (Reals)(1e-30f) ? 1.0f / length2 : zero;
        // Of a lamp with a range, no light is left there (KHR_lights_punctual).
        Reals share = length2 * lamp->inverse_range2, left = 1.0f - share * share;
        left = left > zero ? left : zero;
        power = lamp->unit2 * inverse * left;
        to_unit(l);
        Reals beam = -(l[0] * lamp->along[0] + l[1] * lamp->along[1] + l[2] * lamp->along[2]);
        Reals cone = beam * lamp->cone_scale + lamp->cone_offset;
        cone = cone > zero ? least_of(cone, one) : zero;
        power *= cone * cone;
    } else
#endif
        l[0] = (Reals)(lamp->toward[0]), l[1] = (Reals)(lamp->toward[1]), l[2] = (Reals)(lamp->toward[2]);
    Reals met = dot_of(n, l);
    met = met > zero ? met : zero;
    power *= met;
    UNROLL for (int c = 0; c < 3; ++c) sum->even[c] += power * lamp->color[c];
    if (!lamp->shines) return;
    // h = l + v; its length is 2 v.h. The sine comes from a cross product, as 1 - cos^2 would lose all digits near 0. Both
    // are multiplied by the square of that length, so that there is one quotient.
    Reals h[3] = {l[0] + v[0], l[1] + v[1], l[2] + v[2]}, half2 = dot_of(h, h);
    Reals x = n[1] * h[2] - n[2] * h[1], y = n[2] * h[0] - n[0] * h[2], z = n[0] * h[1] - n[1] * h[0];
    Reals sine2 = x * x + y * y + z * z, spread = sine2 + a2 * (half2 - sine2);
    Reals shadow = met * facing_shadow + facing * square_root(met * met * (1.0f - a2) + a2);
    Reals shine = power * (a2 * 0.5f) * half2 * half2 / (spread * spread * shadow);
    Reals rest = 1.0f - 0.5f * square_root(half2), rest2 = rest * rest, fresnel = rest2 * rest2 * rest;
    fresnel = fresnel > zero ? fresnel : zero;
    shine = half2 > zero && met > zero ? shine : zero;
    Reals edge = shine * fresnel, plain = shine - edge;
    UNROLL for (int c = 0; c < 3; ++c) sum->plain[c] += plain * lamp->color[c], sum->edge[c] += edge * lamp->color[c];
}

// The light that comes from the surface, in place of its base colour. mapped: whether textures say what the material is
// there. highlight: what of it is reflected without entering the surface.
OUTLINE void light_up(global const Lighting *lighting, global const Material *m, const Surface *s, bool mapped,
                      global const uint *textures, Reals color[3], Reals highlight[3])
{
    const Reals zero = (Reals)(0.0f), one = (Reals)(1.0f);
    Reals n[3] = {s->normal[0], s->normal[1], s->normal[2]}, v[3] = {-s->ray[0], s->ray[1], one};
    if (!lighting->perspective) v[0] = v[1] = zero;
    to_unit(n), to_unit(v);
    Reals facing = dot_of(n, v);
    facing = facing > (Reals)(LEAST_FACING) ? least_of(facing, one) : (Reals)(LEAST_FACING);
    Reals metallic = (Reals)(m->metallic), rough = (Reals)(m->roughness), occlusion = one, any, all;
#if MAPS
    if (mapped) {
        metallic = s->metallic, rough = s->roughness, occlusion = s->occlusion;
        albedo_at(textures, facing, rough, &any, &all);
    } else
#endif
        albedo_of(m, facing, &any, &all);
    Reals a = rough * rough, a2 = a * a, facing_shadow = square_root(facing * facing * (1.0f - a2) + a2);
    Received sum;
    UNROLL for (int c = 0; c < 3; ++c) sum.even[c] = sum.plain[c] = sum.edge[c] = zero;
    global const Lamp *lamps = (global const Lamp *)(lighting + 1);
    for (uint k = 0; k < lighting->count; ++k) add_lamp(lamps + k, s, n, v, facing, a2, facing_shadow, lighting, &sum);
    // Light from all around is that of `sky` above and that of `ground` below, and changes evenly between them. A cosine
    // spreads it to 2/3; a highlight sees it where it mirrors, spread by roughness.
    Reals up = n[0] * lighting->zenith[0] + n[1] * lighting->zenith[1] + n[2] * lighting->zenith[2];
    Reals mirrored = 2.0f * facing * up - (v[0] * lighting->zenith[0] + v[1] * lighting->zenith[1] + v[2] * lighting->zenith[2]);
    Reals above = 0.5f + up * 0x1.555556p-2f, beyond = 0.5f + 0.5f * mirrored * (1.0f - a * 0x1.555556p-2f);
    beyond = beyond > zero ? least_of(beyond, one) : zero;
    const Reals f = (Reals)(DIELECTRIC), returned = 1.0f / all, dielectric = 1.0f + f * (returned - 1.0f);
    Reals taken = (f * any + (all - any)) * dielectric;
    UNROLL for (int c = 0; c < 3; ++c) {
        // A surface between both kinds is a mixture of both.
        Reals metal = 1.0f + color[c] * (returned - 1.0f), given_back = dielectric + metallic * (metal - dielectric);
        Reals f0 = f * dielectric + metallic * (color[c] * metal - f * dielectric);
        float span = lighting->sky[c] - lighting->ground[c];
        Reals around = (lighting->ground[c] + span * above) * occlusion, mirror = (lighting->ground[c] + span * beyond) * occlusion;
        Reals into = color[c] * (1.0f - metallic) * (1.0f - taken);
        highlight[c] = f0 * (sum.plain[c] + mirror * any) + given_back * (sum.edge[c] + mirror * (all - any));
        color[c] = into * (sum.even[c] + around);
#if MAPS
        if (mapped) color[c] += s->emissive[c];
        else
#endif
            color[c] += m->emissive[c];
    }
}

#endif
