// Shading: the colours of fragments, where they vary over a face (FRAGMENT_COLOR).
//
//   a face without a material has the scene's colours as they are: of all, of the face, or of its vertices
//   a face with a material has  sRGB(base_color * texel * C),  where C is the scene's colour, which is linear there; and
//       alpha  opacity                                         where its alpha means nothing
//              opacity, or 0 where it is less than the cut-off  CUT
//              opacity * base_color's * texel's * C's           BLENDED
//
// Where texels route (ROUTED_BY_TEXELS), a fragment of alpha 0 is not there. Of faces that hide (HIDES), a fragment of
// alpha 1 is opaque. So alpha must have the same bits wherever it is computed: `alpha_at` and `shade` share its code.
#ifndef SHADE_H
#define SHADE_H

#include "fragments/colors.h"
#include "shading/textures.h"

// What the colours of a batch's fragments are computed from: as given (fragments/colors.h); where they vary over a face,
// the corners' shares (stages/projection.h, store_weights), the normals and texture coordinates of vertices; and where
// there are MATERIALS, which one each face has (negative if none), all of them, and their textures (shading/textures.h).
typedef struct {
    global const uint *faces;
    global const void *palette;
    global const float *weights, *normals, *uv;
    global const int *material_of;
    global const Material *materials;
    global const uint *textures;
} Shading;

#if FRAGMENT_COLOR
// The barycentric weights of a record at SHADED pixels, times twice its area: the same as in VISITS, to the bit. x, y:
// the sample of the first pixel, in subpixels from the image's centre.
INLINE void weights_at(global const Triangle *t, int x, int y, Reals weight[3])
{
    for (int k = 0; k < 3; ++k) {
        int a = k < 2 ? k + 1 : 0, b = k > 0 ? k - 1 : 2, dx = t->x[b] - t->x[a], dy = t->y[b] - t->y[a];
        int least = dy < 0 || (dy == 0 && dx > 0) ? 0 : 1;
        long e = (long)dx * (y - t->y[a]) - (long)dy * (x - t->x[a]) - least, first = e >> SUBPIXEL_BITS;
        float rest = (float)((int)(e & (SUBPIXELS - 1)) + least);
#if SHADED == 1
        weight[k] = (float)first * (float)SUBPIXELS + rest;
#else
        int8 step = dx * SHADED_ROWS - dy * SHADED_COLUMNS;
        if (t->flags & SMALL) weight[k] = CONVERT(float, 8, (int8)((int)first) + step) * (float)SUBPIXELS + rest;
        else weight[k] = CONVERT(float, 8, (long8)(first) + CONVERT(long, 8, step)) * (float)SUBPIXELS + rest;
#endif
    }
}

// --- where on a face ------------------------------------------------------------------------------------------------
// SHADED pixels of a record on its face: the shares of the face's three vertices, which sum to 1; and what they were
// divided by.
typedef struct { Reals share[3], scale; } OnFace;

// weight: the record's barycentric weights there, times twice its area.
INLINE void place_on_face(const Reals weight[3], uint record, const Shading *shading, OnFace *place)
{
    for (int j = 0; j < 3; ++j) {
        place->share[j] = (Reals)(0.0f);
        for (int c = 0; c < 3; ++c) place->share[j] += weight[c] * shading->weights[9 * record + 3 * c + j];
        // Snapping moves corners by up to 1/512 pixel, so a weight can be slightly negative. Clamping it keeps the
        // colour within the colours of the corners.
        place->share[j] = MAX(place->share[j], (Reals)(0.0f));
    }
    place->scale = 1.0f / (place->share[0] + place->share[1] + place->share[2]);
    for (int j = 0; j < 3; ++j) place->share[j] *= place->scale;
}

#if MATERIALS
// The texture coordinates there. Those of vertex j, divided by w, are linear over the screen. So they grow from pixel to
// pixel as the shares do, less what the sum of shares grows by.
INLINE void spot_of(global const Triangle *t, uint record, uint3 face, const OnFace *place, const Shading *shading, Spot *spot)
{
    float2 at[3] = {vload2(face.x, shading->uv), vload2(face.y, shading->uv), vload2(face.z, shading->uv)};
    spot->u = place->share[0] * at[0].x + place->share[1] * at[1].x + place->share[2] * at[2].x;
    spot->v = place->share[0] * at[0].y + place->share[1] * at[1].y + place->share[2] * at[2].y;
#if LEVELS
    float right[3], down[3];  // by how much vertex j's share grows from pixel to pixel, before it is divided
    for (int j = 0; j < 3; ++j) {
        right[j] = down[j] = 0.0f;
        for (int c = 0; c < 3; ++c) {
            int a = c < 2 ? c + 1 : 0, b = c > 0 ? c - 1 : 2;
            float part = shading->weights[9 * record + 3 * c + j] * (float)SUBPIXELS;
            right[j] -= (float)(t->y[b] - t->y[a]) * part, down[j] += (float)(t->x[b] - t->x[a]) * part;
        }
    }
    float right_sum = right[0] + right[1] + right[2], down_sum = down[0] + down[1] + down[2];
    spot->u_x = (right[0] * at[0].x + right[1] * at[1].x + right[2] * at[2].x - spot->u * right_sum) * place->scale;
    spot->v_x = (right[0] * at[0].y + right[1] * at[1].y + right[2] * at[2].y - spot->v * right_sum) * place->scale;
    spot->u_y = (down[0] * at[0].x + down[1] * at[1].x + down[2] * at[2].x - spot->u * down_sum) * place->scale;
    spot->v_y = (down[0] * at[0].y + down[1] * at[1].y + down[2] * at[2].y - spot->v * down_sum) * place->scale;
#endif
}
#endif

// --- colours --------------------------------------------------------------------------------------------------------
// The scene's colours there. colors: whether red, green and blue are wanted, besides alpha.
INLINE void scene_color(const OnFace *place, uint3 face, uint source, const Shading *shading, bool colors, Shades *shades)
{
#if COLOR_RATE_VERTEX
#if SHADED == 1
    // Corner by corner, which takes fewer registers.
    float4 color = (float4)(0.0f);
    bool opaque = true;
    PLAIN_LOOP for (int j = 0; j < 3; ++j) {
        float4 corner = palette_color(shading->palette, j == 0 ? face.x : j == 1 ? face.y : face.z);
        color += (j == 0 ? place->share[0] : j == 1 ? place->share[1] : place->share[2]) * corner;
        opaque = opaque && corner.w == 1.0f;
    }
    shades->red = color.x, shades->green = color.y, shades->blue = color.z, shades->alpha = color.w;
#else
    float4 p = palette_color(shading->palette, face.x), q = palette_color(shading->palette, face.y), r = palette_color(shading->palette, face.z);
    Reals a = place->share[0], b = place->share[1], c = place->share[2];
    if (colors) {
        shades->red = a * p.x + b * q.x + c * r.x, shades->green = a * p.y + b * q.y + c * r.y;
        shades->blue = a * p.z + b * q.z + c * r.z;
    }
    shades->alpha = a * p.w + b * q.w + c * r.w;
    bool opaque = p.w == 1.0f && q.w == 1.0f && r.w == 1.0f;
#endif
    // Interpolation of three ones may miss 1 by some roundings.
    if (MATERIALS && opaque) shades->alpha = (Reals)(1.0f);
#else
    float4 color = palette_color(shading->palette, COLOR_RATE_FACE ? source : 0);
    shades->red = (Reals)(color.x), shades->green = (Reals)(color.y);
    shades->blue = (Reals)(color.z), shades->alpha = (Reals)(color.w);
#endif
}

#if MATERIALS
// The material of a face, or NULL.
INLINE global const Material *material_at(const Shading *shading, uint source)
{
    int number = shading->material_of[source];
    return number < 0 ? 0 : shading->materials + number;
}

// Makes the scene's colours those of a face with this material.
INLINE void apply_material(global const Triangle *t, uint record, uint3 face, const OnFace *place, global const Material *m,
                           const Shading *shading, bool colors, Shades *shades)
{
    const Reals one = (Reals)(1.0f);
    Shades texel = {one, one, one, one};
    bool routes = m->flags & (CUT | BLENDED);
    if (m->flags & TEXTURED && (colors || routes)) {
        Spot spot;
        spot_of(t, record, face, place, shading, &spot);
        sample_texture(shading->textures, m, &spot, colors, &texel);
    }
    if (colors) {
        bool tinted = m->flags & RGB_OF_SCENE;
        shades->red = to_srgb(texel.red * (tinted ? m->base_color[0] * shades->red : (Reals)(m->base_color[0])));
        shades->green = to_srgb(texel.green * (tinted ? m->base_color[1] * shades->green : (Reals)(m->base_color[1])));
        shades->blue = to_srgb(texel.blue * (tinted ? m->base_color[2] * shades->blue : (Reals)(m->base_color[2])));
    }
    Reals alpha = texel.alpha * m->base_color[3];
    if (m->flags & ALPHA_OF_SCENE) alpha *= shades->alpha;
    Reals opacity = (Reals)(m->opacity);
    if (m->flags & CUT) alpha = alpha >= (Reals)(m->alpha_cutoff) ? opacity : (Reals)(0.0f);
    else alpha = m->flags & BLENDED ? alpha * opacity : opacity;
    shades->alpha = alpha;
}
#endif

// Colours of a record at SHADED pixels. weight: their barycentric weights, times twice the area. source: its face.
// view: the direction that the camera looks in, of length 1. alpha: where there are MATERIALS, gets the alpha once more,
// as `shades` may have the light in its place.
INLINE void shade(global const Triangle *t, const Reals weight[3], uint record, uint source, const Shading *shading, float3 view,
                  Shades *shades, Reals *alpha)
{
    OnFace place;
    place_on_face(weight, record, shading, &place);
    uint3 face = load_face(shading->faces, source);
    scene_color(&place, face, source, shading, true, shades);
#if MATERIALS
    global const Material *m = material_at(shading, source);
    if (m) apply_material(t, record, face, &place, m, shading, true, shades);
    *alpha = shades->alpha;
#endif
#if HEADLIGHT
#if SHADED == 1
    float3 normal = (float3)(0.0f);
    PLAIN_LOOP for (int j = 0; j < 3; ++j) {
        uint vertex = j == 0 ? face.x : j == 1 ? face.y : face.z;
        normal += (j == 0 ? place.share[0] : j == 1 ? place.share[1] : place.share[2]) * load3(shading->normals, vertex);
    }
    Reals n_x = normal.x, n_y = normal.y, n_z = normal.z;
#else
    Reals a = place.share[0], b = place.share[1], c = place.share[2];
    float3 n_a = load3(shading->normals, face.x), n_b = load3(shading->normals, face.y), n_c = load3(shading->normals, face.z);
    Reals n_x = a * n_a.x + b * n_b.x + c * n_c.x, n_y = a * n_a.y + b * n_b.y + c * n_c.y;
    Reals n_z = a * n_a.z + b * n_b.z + c * n_c.z;
#endif
    Reals length2 = n_x * n_x + n_y * n_y + n_z * n_z, facing = n_x * view.x + n_y * view.y + n_z * view.z;
    Reals cosine = MIN(MAX(facing, -facing) / square_root(length2), (Reals)(1.0f));
    cosine = length2 > (Reals)(0.0f) ? cosine : (Reals)(1.0f);
    Reals light = AMBIENT + (1.0f - AMBIENT) * cosine;
#if MATERIALS
    if (m && m->flags & UNLIT) light = (Reals)(1.0f);
#endif
#ifdef LIGHT_IN_ALPHA
    shades->alpha = light;  // translucency needs no alpha, but needs colour and light apart
#else
    shades->red *= light, shades->green *= light, shades->blue *= light;
#endif
#endif
}

#if ROUTED
// Which of a record's covered fragments are there (-1, else 0), by what its texels say. solid: whether opaque fragments
// are wanted: then of records that are not OPAQUE those alone whose alpha is 1.
OUTLINE VECTOR(int) routed(global const Triangle *t, uint record, const VECTOR(float) weight[3], VECTOR(int) covered,
                           const Shading *shading, bool solid)
{
    uint source = t->source, all = BITS_OF(covered), kept = 0;
    bool whole = HIDING && solid && !(t->flags & OPAQUE);
    global const Material *m = material_at(shading, source);
    if (!m || !(m->flags & ROUTED_BY_TEXELS)) return whole ? (VECTOR(int))(0) : covered;
    if (whole && !(m->flags & HIDES)) return (VECTOR(int))(0);
    uint3 face = load_face(shading->faces, source);
    for (int first = 0; first < STRIP; first += SHADED) {
        uint bits = all >> first & SHADED_BITS;
        if (!bits) continue;
        Reals at_samples[3];
        UNROLL for (int j = 0; j < 3; ++j) at_samples[j] = SAMPLES_OF(weight[j], first);
        OnFace place;
        place_on_face(at_samples, record, shading, &place);
        Shades shades;
        scene_color(&place, face, source, shading, false, &shades);
        apply_material(t, record, face, &place, m, shading, false, &shades);
        uint there = whole ? SHADED_BITS_OF(shades.alpha == (Reals)(1.0f)) : SHADED_BITS_OF(shades.alpha > (Reals)(0.0f));
        kept |= (bits & there) << first;
    }
    return MASK_OF(kept);
}
#define ROUTE(solid) covered = routed(t, batch->pairs[place], weight, covered, shading, solid);
#endif

INLINE float4 shade_of(const Shades *shades, int k)
{
#if SHADED == 1
    return (float4)(shades->red, shades->green, shades->blue, shades->alpha);
#else
    return (float4)(((const float *)&shades->red)[k], ((const float *)&shades->green)[k],
                    ((const float *)&shades->blue)[k], ((const float *)&shades->alpha)[k]);
#endif
}
#endif

// Between VISITS and END_VISITS: takes the fragments away that are not there.
#ifndef ROUTE
#define ROUTE(solid)
#endif

#endif
