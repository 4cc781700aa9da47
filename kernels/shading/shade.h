// Shading: the colours of fragments, where they vary over a face (FRAGMENT_COLOR).
//
//   a face without a material has the scene's colours as they are: of all, of the face, or of its vertices. So has one whose
//       material is PLAIN: it says no more than how lights fall on it
//   a face with a material has  sRGB(base_color * texel * C),  where C is the scene's colour, which is linear there; and
//       alpha  opacity                                         where its alpha means nothing
//              opacity, or 0 where it is less than the cut-off  CUT
//              opacity * base_color's * texel's * C's           BLENDED
//
// Where blending is LINEAR, all of these colours become linear light as they leave here.
//
// Where texels route (ROUTED_BY_TEXELS), a fragment of alpha 0 is not there. Of faces that hide (HIDES), a fragment of
// alpha 1 is opaque. So alpha must have the same bits wherever it is computed: `routed` and `shade` share its code.
#ifndef SHADE_H
#define SHADE_H

#include "fragments/colors.h"
#include "shading/lights.h"
#include "shading/wires.h"

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
    global const Lighting *lighting;
    Wires wires;
} Shading;

// All of these, as kernels have them as arguments.
#define GIVEN_SHADING                                                                                           \
    {faces, palette, weights, normals, uv, material_of, materials, textures, lighting, {wiring, wire_lists, wires}}

#define NORMALS (HEADLIGHT | LIGHTS)

// Whether fragments are painted, a vector of them at a time: they have materials, or lights fall on them. The first of all
// materials is that of faces without one, whose number is -1.
#define PAINTED (MATERIALS | LIGHTS)
#define MATERIAL_AT(shading, number) ((shading)->materials + 1 + (number))

#if FRAGMENT_COLOR
// The barycentric weights of a record at SHADED pixels, times twice its area: the same as in VISITS, to the bit. x, y:
// the sample of the first pixel, in subpixels from the image's centre.
INLINE void weights_at(global const Triangle *t, int x, int y, Reals weight[3])
{
    for (int k = 0; k < 3; ++k) {
        int a = k < 2 ? k + 1 : 0, b = k > 0 ? k - 1 : 2, dx = t->x[b] - t->x[a], dy = t->y[b] - t->y[a];
        int least = dy < 0 || (dy == 0 && dx > 0) ? 0 : 1;
        long e = (long)dx * (y - t->y[a]) - (long)dy * (x - t->x[a]) - least, first = e >> STEP_BITS;
        float rest = (float)((int)(e & (STEP - 1)) + least);
#if SHADED == 1
        weight[k] = (float)first * (float)STEP + rest;
#else
        Wholes step = dx * SHADED_Y - dy * SHADED_X;
        if (t->flags & SMALL) weight[k] = TO_REALS((Wholes)((int)first) + step) * (float)STEP + rest;
        else weight[k] = TO_REALS((PASTE(long, SHADED))(first) + CONVERT(long, SHADED, step)) * (float)STEP + rest;
#endif
    }
}

#if PATTERNED
// The same at the centres of the picture's pixels that SHADED pixels belong to: from number `pixel` of a block on. first:
// F of the edge at the block's first sample (stages/walk.h). rest: rest + least.
INLINE Reals weight_at_centre(long first, float rest, int dx, int dy, bool small, int pixel)
{
#if SHADED == 1
    int step = dx * CENTRE_Y(pixel / BLOCK) - dy * CENTRE_X(pixel % BLOCK);
    return (float)(2 * first + step) * (float)(STEP / 2) + rest;
#else
    Wholes step = dx * CENTRE_Y(SHADED_ROWS + pixel / BLOCK) - dy * CENTRE_X(SHADED_COLUMNS);
    if (small) return TO_REALS((Wholes)(2 * (int)first) + step) * (float)(STEP / 2) + rest;
    return TO_REALS((PASTE(long, SHADED))(2 * first) + CONVERT(long, SHADED, step)) * (float)(STEP / 2) + rest;
#endif
}

// x, y: the block's first sample, in subpixels from the image's centre.
INLINE void weights_at_centres(global const Triangle *t, int x, int y, int pixel, Reals weight[3])
{
    UNROLL for (int k = 0; k < 3; ++k) {
        int a = k < 2 ? k + 1 : 0, b = k > 0 ? k - 1 : 2, dx = t->x[b] - t->x[a], dy = t->y[b] - t->y[a];
        int least = dy < 0 || (dy == 0 && dx > 0) ? 0 : 1;
        long e = (long)dx * (y - t->y[a]) - (long)dy * (x - t->x[a]) - least;
        float rest = (float)(((int)e & (STEP - 1)) + least);
        weight[k] = weight_at_centre(e >> STEP_BITS, rest, dx, dy, t->flags & SMALL, pixel);
    }
}
#endif

// --- a record's face ------------------------------------------------------------------------------------------------
// What all fragments of a record have in common: weights as they are stored; the colours and normals of the face's
// vertices, or its one colour; its material, or NULL; and the texture coordinates of its vertices. right, down: by how
// much u, v and 1, times the unscaled shares, grow from one place that is shaded to the next.
typedef struct {
    float weight[9];
    float4 color[3];
#if WIRES
    uint source;
    uint wired;  // if edges are drawn on it, FROM_FRONT or FROM_BEHIND; else 0
#endif
#if NORMALS
    float3 normal[3];
#endif
#if LIGHTS
    float side;  // -1 if the face is seen from behind, else 1; 0 if it has no sides (TURNED)
#endif
#if POSITIONED
    float depth[3], depth_min, depth_max, per_area;  // of the record's plane (stages/walk.h, keys_of)
#endif
#if PAINTED
    bool opaque;  // whether the scene's alphas at its vertices are all 1
    global const Material *material;  // NULL for the scene's colours as they are, without lights
    float4 base;  // the material's base colour; times the scene's colour, if that does not vary over the face
    float2 uv[3];
    float3 right, down;
#endif
#if MAPS
    uint3 vertex;
    float4 share_right, share_down;  // by how much the unscaled shares grow from pixel to pixel
#endif
} Face;

#if PAINTED
// What the scene's colour contributes to a material's.
INLINE float4 tint_of(global const Material *m, float4 color)
{
    if (!(m->flags & RGB_OF_SCENE)) color.x = color.y = color.z = 1.0f;
    if (!(m->flags & ALPHA_OF_SCENE)) color.w = 1.0f;
    return color;
}
#endif

#if PAINTED && LEVELS
// By how much u, v and 1, times the unscaled shares, grow from pixel to pixel; right, down: by how much the shares do.
INLINE void growth_of(const float2 uv[3], float4 right, float4 down, float3 *to_right, float3 *to_down)
{
    float3 at[3];
    UNROLL for (int j = 0; j < 3; ++j) at[j] = (float3)(uv[j], 1.0f);
    *to_right = right.x * at[0] + right.y * at[1] + right.z * at[2];
    *to_down = down.x * at[0] + down.y * at[1] + down.z * at[2];
}
#endif

// Whether a face is shaded at each sample. In a pattern it is shaded once for each of the picture's pixels, at the pixel's
// centre, unless its texels say which of its samples are there.
INLINE bool shades_samples(const Face *f)
{
#if PATTERNED && ROUTED
    return f->material && f->material->flags & ROUTED_BY_TEXELS;
#else
    return !PATTERNED;
#endif
}

INLINE void face_of(global const Triangle *t, uint record, const Shading *shading, Face *f)
{
    uint source = t->source;
#if WIRES
    f->source = source;
    f->wired = !has_wires(&shading->wires, source) ? 0 : t->flags & BACK_FACING ? FROM_BEHIND : FROM_FRONT;
    if (is_band(&shading->wires, source)) source = 0;  // what a band would be without its edge does not show
#endif
    uint3 vertex = load_face(shading->faces, source);
    UNROLL for (int k = 0; k < 9; ++k) f->weight[k] = shading->weights[9 * record + k];
#if COLOR_RATE_VERTEX
    f->color[0] = palette_color(shading->palette, vertex.x);
    f->color[1] = palette_color(shading->palette, vertex.y), f->color[2] = palette_color(shading->palette, vertex.z);
#else
    f->color[0] = palette_color(shading->palette, COLOR_RATE_FACE ? source : 0);
#endif
#if NORMALS
    f->normal[0] = load3(shading->normals, vertex.x), f->normal[1] = load3(shading->normals, vertex.y);
    f->normal[2] = load3(shading->normals, vertex.z);
#endif
#if LIGHTS
    f->side = t->flags & TURNED ? 0.0f : t->flags & BACK_FACING ? -1.0f : 1.0f;
#endif
#if POSITIONED
    UNROLL for (int k = 0; k < 3; ++k) f->depth[k] = t->depth[k];
    f->depth_min = t->depth_min, f->depth_max = t->depth_max, f->per_area = t->inverse_area;
#endif
#if PAINTED
#if MAPS
    f->vertex = vertex;
#endif
    f->opaque = f->color[0].w == 1.0f;
    if (COLOR_RATE_VERTEX) f->opaque = f->opaque && f->color[1].w == 1.0f && f->color[2].w == 1.0f;
    int number = MATERIALS ? shading->material_of[source] : -1;
    f->material = LIGHTS || number >= 0 ? MATERIAL_AT(shading, number) : 0;
    if (!f->material) return;
    global const float *base = f->material->base_color;
    f->base = (float4)(base[0], base[1], base[2], base[3]);
    if (!COLOR_RATE_VERTEX) f->base *= tint_of(f->material, f->color[0]);
    if (!MATERIALS || !(f->material->flags & TEXTURED || f->material->mapped)) return;
    global const float2 *uv = (global const float2 *)shading->uv;
    f->uv[0] = uv[vertex.x], f->uv[1] = uv[vertex.y], f->uv[2] = uv[vertex.z];
#if LEVELS
    float4 right = (float4)(0.0f), down = right;  // of the unscaled shares
    UNROLL for (int c = 0; c < 3; ++c) {
        int a = c < 2 ? c + 1 : 0, b = c > 0 ? c - 1 : 2;
        float4 part = (float4)(f->weight[3 * c], f->weight[3 * c + 1], f->weight[3 * c + 2], 0.0f) * (float)SUBPIXELS;
        right -= (float)(t->y[b] - t->y[a]) * part, down += (float)(t->x[b] - t->x[a]) * part;
    }
#if PATTERNED
    if (!shades_samples(f)) right *= (float)SHOWN_COLUMNS, down *= (float)SHOWN_ROWS;
#endif
#if MAPS
    f->share_right = right, f->share_down = down;
#endif
    growth_of(f->uv, right, down, &f->right, &f->down);
#endif
#endif
}

#if WIRES
#define IS_WIRED(face) ((face)->wired)
#else
#define IS_WIRED(face) false
#endif

// Asks for what face_of will load for the records pairs[from] .. pairs[to - 1]. These lie all over memory, and each is
// found by what was loaded before. So the loads of many records must overlap.
INLINE void prefetch_faces(global const Triangle *triangles, global const uint *pairs, uint from, uint to, const Shading *shading)
{
    for (uint k = from; k < to; ++k) {
        uint record = pairs[k], source = triangles[record].source;
        PREFETCH(shading->weights + 9 * record);
        PREFETCH(shading->weights + 9 * record + 8);
        if (COLOR_RATE_FACE) PREFETCH((global const uchar *)shading->palette + (size_t)source * (PACKED_COLOR ? 4 : 16));
#if COLOR_RATE_VERTEX || NORMALS || MATERIALS
        global const uint *vertex = shading->faces + 3 * source;
        for (int j = 0; j < 3; ++j) {
            if (COLOR_RATE_VERTEX)
                PREFETCH((global const uchar *)shading->palette + (size_t)vertex[j] * (PACKED_COLOR ? 4 : 16));
            if (NORMALS) PREFETCH(shading->normals + 3 * vertex[j]);
            if (MATERIALS) PREFETCH(shading->uv + 2 * vertex[j]);
        }
#endif
    }
}

// --- where on a face ------------------------------------------------------------------------------------------------
// SHADED pixels of a record on its face: the shares of the face's three vertices, which sum to 1; and what they were
// multiplied with for that.
typedef struct {
    Reals share[3], scale;
#if POSITIONED
    Reals depth;
#endif
} OnFace;

// weight: the record's barycentric weights there, times twice its area.
INLINE void place_on_face(const Reals weight[3], const Face *f, OnFace *place)
{
    UNROLL for (int j = 0; j < 3; ++j) {
        place->share[j] = (Reals)(0.0f);
        UNROLL for (int c = 0; c < 3; ++c) place->share[j] += weight[c] * f->weight[3 * c + j];
        // Snapping moves corners by up to 1/512 pixel, so a weight can be slightly negative. So can it at the centre of a
        // pixel that the face covers in part. Clamping it keeps the colour within the colours of the corners.
        place->share[j] = MAX(place->share[j], (Reals)(0.0f));
    }
    Reals sum = place->share[0] + place->share[1] + place->share[2];
    if (PATTERNED) sum = MAX(sum, (Reals)(0x1p-120f));  // beside a face that is seen from its edge all may be negative
    place->scale = 1.0f / sum;
    UNROLL for (int j = 0; j < 3; ++j) place->share[j] *= place->scale;
#if POSITIONED
    place->depth = f->depth[0] + (weight[1] * f->depth[1] + weight[2] * f->depth[2]) * f->per_area;
    place->depth = MAX(place->depth, (Reals)(f->depth_min)), place->depth = MIN(place->depth, (Reals)(f->depth_max));
#endif
}

// Where SHADED pixels are seen, right and down from the image's centre, in subpixels. Only lights and edges need to
// know.
typedef struct { Reals x, y; } Sight;

// From number `pixel` of a block on, at their samples, or at the centres of the picture's pixels that have them
// (shades_samples). column, row: the block's first pixel.
INLINE Sight sight_of(bool samples, int column, int row, int pixel, int width, int height)
{
    Sight sight;
#if !(LIGHTS | WIRES)
    sight.x = sight.y = (Reals)(0.0f);
#else
#if PATTERNED
    if (!samples) {
        int x = SAMPLE_X(column, row, width, PATTERN), y = SAMPLE_Y(column, row, height, PATTERN);
#if SHADED == 1
        sight.x = (float)(x + CENTRE_X(pixel % BLOCK) * STEP / 2), sight.y = (float)(y + CENTRE_Y(pixel / BLOCK) * STEP / 2);
#else
        sight.x = TO_REALS(x + CENTRE_X(SHADED_COLUMNS) * STEP / 2);
        sight.y = TO_REALS(y + CENTRE_Y(SHADED_ROWS + pixel / BLOCK) * STEP / 2);
#endif
        return sight;
    }
#endif
    column += pixel % BLOCK, row += pixel / BLOCK;
    int x = SAMPLE_X(column, row, width, PATTERN), y = SAMPLE_Y(column, row, height, PATTERN);
#if SHADED == 1
    sight.x = (float)x, sight.y = (float)y;
#else
    sight.x = TO_REALS(x + SHADED_X * STEP), sight.y = TO_REALS(y + SHADED_Y * STEP);
#endif
#endif
    return sight;
}

#if LIGHTS
// What light falls on there.
INLINE void surface_of(const Face *f, const OnFace *place, global const Lighting *lighting, const Sight *sight, Surface *s)
{
    Reals a = place->share[0], b = place->share[1], c = place->share[2], n[3];
    n[0] = a * f->normal[0].x + b * f->normal[1].x + c * f->normal[2].x;
    n[1] = a * f->normal[0].y + b * f->normal[1].y + c * f->normal[2].y;
    n[2] = a * f->normal[0].z + b * f->normal[1].z + c * f->normal[2].z;
    global const float *axes = lighting->right;  // then up, and back
    UNROLL for (int j = 0; j < 3; ++j)
        s->normal[j] = n[0] * axes[3 * j] + n[1] * axes[3 * j + 1] + n[2] * axes[3 * j + 2];
    s->ray[0] = sight->x * lighting->ray[0], s->ray[1] = sight->y * lighting->ray[1];
    Reals side = (Reals)(f->side);
    if (f->side == 0.0f) {
        Reals facing = s->normal[2];
        if (lighting->perspective) facing += s->normal[1] * s->ray[1] - s->normal[0] * s->ray[0];
        side = facing < (Reals)(0.0f) ? (Reals)(-1.0f) : (Reals)(1.0f);
    }
    UNROLL for (int j = 0; j < 3; ++j) s->normal[j] *= side;
#if POSITIONED
    s->distance = lighting->perspective ? lighting->near / place->depth : lighting->far - place->depth * lighting->span;
#endif
}
#endif

#if PAINTED
// Where a texture is sampled there, if the vertices have these coordinates. to_right, to_down: see growth_of. The
// coordinates of vertex j, divided by w, are linear over the screen. So they grow from pixel to pixel as the shares do,
// less what the sum of shares grows by.
INLINE void spot_on(const OnFace *place, const float2 uv[3], float3 to_right, float3 to_down, global const Mapping *texture,
                    Spot *spot)
{
    spot->u = place->share[0] * uv[0].x + place->share[1] * uv[1].x + place->share[2] * uv[2].x;
    spot->v = place->share[0] * uv[0].y + place->share[1] * uv[1].y + place->share[2] * uv[2].y;
#if LEVELS
    Reals u_x = (to_right.x - spot->u * to_right.z) * place->scale, v_x = (to_right.y - spot->v * to_right.z) * place->scale;
    Reals u_y = (to_down.x - spot->u * to_down.z) * place->scale, v_y = (to_down.y - spot->v * to_down.z) * place->scale;
    reach_of(texture, u_x, v_x, u_y, v_y, spot);
#endif
}

// Where the material's first texture is sampled there.
INLINE void spot_of(const Face *f, const OnFace *place, Spot *spot)
{
    spot_on(place, f->uv, f->right, f->down, &f->material->base, spot);
}
#endif

// --- colours --------------------------------------------------------------------------------------------------------
// The scene's colour at pixel k.
INLINE float4 scene_color(const Face *f, const OnFace *place, int k)
{
#if COLOR_RATE_VERTEX
    float a = ONE_OF(float, place->share[0], k), b = ONE_OF(float, place->share[1], k), c = ONE_OF(float, place->share[2], k);
    float4 color = a * f->color[0] + b * f->color[1] + c * f->color[2];
#if PAINTED
    if (f->opaque) color.w = 1.0f;  // interpolation of three ones may miss 1 by some roundings
#endif
    return color;
#else
    return f->color[0];
#endif
}

// The light there: how much the headlight dims colours, or what lights fall on.
#if LIGHTS
typedef Surface Light;
#else
typedef Reals Light;
#endif

// view: the direction that the camera looks in, of length 1. sight: where the pixels are.
INLINE Light light_on(const Face *f, const OnFace *place, const Shading *shading, float3 view, const Sight *sight)
{
#if LIGHTS
    Surface s;
    surface_of(f, place, shading->lighting, sight, &s);
    return s;
#elif HEADLIGHT
#if MATERIALS
    if (f->material && f->material->flags & UNLIT) return (Reals)(1.0f);
#endif
    Reals a = place->share[0], b = place->share[1], c = place->share[2];
    Reals n_x = a * f->normal[0].x + b * f->normal[1].x + c * f->normal[2].x;
    Reals n_y = a * f->normal[0].y + b * f->normal[1].y + c * f->normal[2].y;
    Reals n_z = a * f->normal[0].z + b * f->normal[1].z + c * f->normal[2].z;
    Reals length2 = n_x * n_x + n_y * n_y + n_z * n_z, facing = n_x * view.x + n_y * view.y + n_z * view.z;
    Reals cosine = MIN(MAX(facing, -facing) / square_root(length2), (Reals)(1.0f));
    cosine = length2 > (Reals)(0.0f) ? cosine : (Reals)(1.0f);
    return AMBIENT + (1.0f - AMBIENT) * cosine;
#else
    return (Reals)(1.0f);
#endif
}

// For translucency, which needs no alpha, but needs colour and light apart: the colour has no light on it, and light is in
// alpha's place.
#ifndef LIGHT_IN_ALPHA
#define LIGHT_IN_ALPHA 0
#endif
#define LIT(color, light) (LIGHT_IN_ALPHA ? (float4)((color).xyz, light) : (color) * (float4)(light, light, light, 1.0f))

#if PAINTED
// --- fragments that wait for their material -------------------------------------------------------------------------
// Small faces cover a few pixels of a strip. What follows takes a vector for each step. So fragments of one material wait
// here side by side, whichever records they are of, until there are enough for whole vectors. WAITING: how many may wait.
// There is room for a vector behind them, so that whole ones can be written.
#if SHADED == 1
#define WAITING 1
#define WAITING_ROOM 1
#else
#define WAITING (8 * SHADED)
#define WAITING_ROOM (WAITING + SHADED)
#endif
#define SURFACE_NUMBERS (5 + POSITIONED)
typedef struct {
    float u[WAITING_ROOM], v[WAITING_ROOM];  // and the rest of their spots (shading/textures.h)
#if LEVELS
    float across2[WAITING_ROOM];
#endif
#if PROBES > 1
    float along_u[WAITING_ROOM], along_v[WAITING_ROOM], probes[WAITING_ROOM];
#endif
#if HEADLIGHT
    float light[WAITING_ROOM];
#endif
#if LIGHTS
    float surface[SURFACE_NUMBERS][WAITING_ROOM];  // the fields of a Surface but those of MAPS
#endif
    float4 tint[WAITING_ROOM];  // base_color * C
    uint to[WAITING_ROOM];  // where their colours are wanted
    global const Material *material;
    uint count;
} Waiting;

// Whether fragments of a material wait. Not where their texels say which of them are there, or what maps add to them would
// have to wait, too.
#if MAPS
#define WAITS(m) (!((m)->flags & ROUTED_BY_TEXELS) && !(m)->mapped)
#else
#define WAITS(m) (!((m)->flags & ROUTED_BY_TEXELS))
#endif

// Vectors usually begin at multiples of their own size.
#if SHADED == 1
typedef Reals AnyReals;
typedef Part AnyPart;
#else
typedef Reals AnyReals __attribute__((aligned(4)));
typedef Part AnyPart __attribute__((aligned(16)));
#endif

// Puts the elements of these bits side by side.
INLINE void put_together(Reals value, uint bits, float *to)
{
#if SHADED == 1
    *to = value;
#elif SHADED == 16 && __has_builtin(__builtin_ia32_compresssf512_mask)
    *(AnyReals *)to = __builtin_ia32_compresssf512_mask(value, (Reals)(0.0f), (ushort)bits);
#else
    if (bits == SHADED_BITS) *(AnyReals *)to = value;
    else
        for (; bits; bits &= bits - 1) *to++ = ONE_OF(float, value, LOWEST_SHADED(bits));
#endif
}

// Lets fragments wait: those of a face at these pixels. There must be room. light: on them. to: where their colours are
// wanted.
INLINE void let_wait(const Face *f, const OnFace *place, const Light *light, uint bits, Words to, Waiting *w)
{
    uint end = w->count;
    w->material = f->material, w->count += POPCOUNT(bits);
    put_together(AS_REALS(to), bits, (float *)w->to + end);
    if (MATERIALS && f->material->flags & TEXTURED) {
        Spot spot;
        spot_of(f, place, &spot);
        put_together(spot.u, bits, w->u + end), put_together(spot.v, bits, w->v + end);
#if LEVELS
        put_together(spot.across2, bits, w->across2 + end);
#endif
#if PROBES > 1
        put_together(spot.along_u, bits, w->along_u + end), put_together(spot.along_v, bits, w->along_v + end);
        put_together(spot.probes, bits, w->probes + end);
#endif
    }
#if HEADLIGHT
    put_together(*light, bits, w->light + end);
#endif
#if LIGHTS
    if (light)
        UNROLL for (int k = 0; k < SURFACE_NUMBERS; ++k) put_together(((const Reals *)light)[k], bits, w->surface[k] + end);
#endif
#if COLOR_RATE_VERTEX
    for (uint left = bits; left; left &= left - 1)
        w->tint[end++] = f->base * tint_of(f->material, scene_color(f, place, LOWEST_SHADED(left)));
#else
    UNROLL for (int k = 0; k < PARTS; ++k) ((AnyPart *)(w->tint + end))[k] = SAME_PART(f->base);
#endif
}

// What a fragment's alpha is, of the product of all alphas: see the top.
INLINE Part alpha_of(uint flags, Part opacity, Part cutoff, Part alpha)
{
    if (flags & PLAIN) return alpha;
    if (flags & CUT) return alpha >= cutoff ? opacity : (Part)(0.0f);
    return flags & BLENDED ? alpha * opacity : opacity;
}

#if LIGHTS
// Light as it is blended. What is brighter than white is white: to_srgb takes no more than 1.
INLINE Reals shown_light(const Shading *shading, Reals light)
{
    light = least_of(light, (Reals)(1.0f));
    return LINEAR ? light : to_srgb(shading->textures, light);
}

// The colours of SHADED fragments under lights, as they are blended. color: as materials are, linear, but sRGB if they are
// PLAIN. Of these, fragments whose normals have no length stay as they are: lines and points without normals
// (clpeel/scene/normals.py).
INLINE void light_colors(const Shading *shading, global const Material *m, const Surface *s, bool mapped, float4 colors[SHADED])
{
    Reals channel[4], highlight[3];
    to_channels(colors, channel);
    if (m->flags & PLAIN)
        UNROLL for (int c = 0; c < 3; ++c) channel[c] = to_linear(channel[c]);
    light_up(shading->lighting, m, s, mapped, shading->textures, channel, highlight);
#if FULL_HIGHLIGHTS
    // A highlight covers what it lies on: what is transparent comes through less. T: with it. D: without it.
    //   cover = max (T - D) / max(1 - D, 1/4),   alpha' = 1 - (1 - alpha) (1 - cover),
    //   C alpha' = T - (1 - alpha) (1 - cover) D,   but no more than alpha'
    // Where D is nearly white, a highlight adds next to nothing. Divided by 1 - D that would cover all, beside places where
    // D is white and nothing is added.
    const Reals zero = (Reals)(0.0f), one = (Reals)(1.0f);
    Reals with[3], cover = zero;
    UNROLL for (int c = 0; c < 3; ++c) {
        with[c] = shown_light(shading, channel[c] + highlight[c]), channel[c] = shown_light(shading, channel[c]);
        Reals left = 1.0f - channel[c], share = (with[c] - channel[c]) / MAX(left, (Reals)(0.25f));
        cover = MAX(cover, share);
    }
    cover = least_of(cover, one);
    Reals through = (1.0f - channel[3]) * (1.0f - cover), alpha = 1.0f - through;
    alpha = through > zero ? alpha : one;
    UNROLL for (int c = 0; c < 3; ++c) {
        Reals covered = with[c] - through * channel[c];
        covered = alpha > zero ? covered / alpha : channel[c];
        channel[c] = least_of(MAX(covered, zero), one);
    }
    channel[3] = alpha;
#else
    UNROLL for (int c = 0; c < 3; ++c) channel[c] = shown_light(shading, channel[c] + highlight[c]);
#endif
    if (m->flags & PLAIN) {
        Reals given[4], length2 = dot_of(s->normal, s->normal);
        to_channels(colors, given);
        UNROLL for (int c = 0; c < (LINEAR ? 3 : 0); ++c) given[c] = to_linear(given[c]);
        UNROLL for (int c = 0; c < 4; ++c) channel[c] = length2 > (Reals)(0.0f) ? channel[c] : given[c];
    }
    of_channels(channel, colors);
}
#endif

// Whether colours are sRGB before they are what is blended: it is sRGB, or the headlight dims it.
#define DIMS_SRGB (!LINEAR || (HEADLIGHT && !LIGHT_IN_ALPHA))

// The colours of SHADED or fewer fragments that wait, from number `first` on. shown: as they are blended; else their red,
// green and blue mean nothing, but their alphas are the same. mapped: what lights fall on, where textures say it; or NULL.
OUTLINE void paint(const Waiting *w, uint first, bool shown, const Shading *shading, const Light *mapped, float4 colors[SHADED])
{
    global const Material *m = w->material;
    global const uint *textures = shading->textures;
    int count = (int)MIN(w->count - first, (uint)SHADED);
    // What is loaded in the loop is loaded again after each store, as a compiler must expect it to be changed.
    const uint flags = m->flags;
    const Part opacity = (Part)(m->opacity), cutoff = (Part)(m->alpha_cutoff);
    Part texel[PARTS];
    if (MATERIALS && flags & TEXTURED) {
        Spot spot;
        spot.u = *(const AnyReals *)(w->u + first), spot.v = *(const AnyReals *)(w->v + first);
#if LEVELS
        spot.across2 = *(const AnyReals *)(w->across2 + first);
#endif
#if PROBES > 1
        spot.along_u = *(const AnyReals *)(w->along_u + first), spot.along_v = *(const AnyReals *)(w->along_v + first);
        spot.probes = *(const AnyReals *)(w->probes + first);
#endif
        sample_texture(textures, &m->base, &spot, count, texel);
    }
#if HEADLIGHT
    Reals lights = *(const AnyReals *)(w->light + first);
#endif
    const bool lit = LIGHTS && shown && !(flags & UNLIT);
    for (int k = 0; k < count; k += PART_COLORS) {
        Part color = *(const AnyPart *)(w->tint + first + k);
        if (MATERIALS && flags & TEXTURED) color *= texel[k / PART_COLORS];
        Part alpha = alpha_of(flags, opacity, cutoff, color);
        if (shown && !lit && !(flags & PLAIN)) color = DIMS_SRGB ? part_to_srgb(textures, color) : MIN(color, (Part)(1.0f));
#if HEADLIGHT
        Part light = for_channels(lights, k);
        if (LIGHT_IN_ALPHA) alpha = light;
        else color *= light;
#endif
#if LINEAR
        if (shown && !lit) color = DIMS_SRGB || flags & PLAIN ? part_to_linear(color) : color;
#endif
        *(AnyPart *)(colors + k) = ALPHAS ? alpha : color;
    }
#if LIGHTS
    if (!lit) return;
    Surface surface;
    if (!mapped)
        UNROLL for (int k = 0; k < SURFACE_NUMBERS; ++k) ((Reals *)&surface)[k] = *(const AnyReals *)(w->surface[k] + first);
    light_colors(shading, m, mapped ? mapped : &surface, mapped != 0, colors);
#endif
}

// Stores the colours of all fragments that wait, where they are wanted.
OUTLINE void paint_all(Waiting *w, const Shading *shading, global float4 *colors)
{
    uint count = w->count;
    for (uint first = 0; first < count; first += SHADED) {
        float4 painted[SHADED];
        paint(w, first, true, shading, 0, painted);
        uint some = MIN(count - first, (uint)SHADED);
        for (uint k = 0; k < some; ++k) colors[w->to[first + k]] = painted[k];
    }
    w->count = 0;
}
#endif

#if !LIGHTS
// The colour of a face without a material at pixel k. light: on these pixels.
INLINE float4 plain_color(const Face *f, const OnFace *place, const Reals *light, int k)
{
    float4 color = scene_color(f, place, k);
    if (HEADLIGHT) color = LIT(color, ONE_OF(float, *light, k));
    return LINEAR ? linear_color(color) : color;
}
#endif

// --- colours, at once -----------------------------------------------------------------------------------------------
#if MAPS
// --- maps: textures that say what a surface is ----------------------------------------------------------------------
// The elements of these bits, side by side.
INLINE Reals compact(Reals value, uint bits)
{
#if SHADED == 1
    return value;
#else
    float room[2 * SHADED];
    put_together(value, bits, room);
    return *(const AnyReals *)room;
#endif
}

// A map at the pixels of these bits, side by side, `count` of them: its four channels. uv: of the face's vertices there.
INLINE void sample_map(const Face *f, const OnFace *place, const Shading *shading, global const Mapping *map, uint bits,
                       int count, float2 uv[3], Reals channels[4])
{
    global const float2 *all = (global const float2 *)shading->uv + map->uv;
    uv[0] = all[f->vertex.x], uv[1] = all[f->vertex.y], uv[2] = all[f->vertex.z];
    float3 right = (float3)(0.0f), down = right;
#if LEVELS
    growth_of(uv, f->share_right, f->share_down, &right, &down);
#endif
    Spot spot;
    spot_on(place, uv, right, down, map, &spot);
    spot.u = compact(spot.u, bits), spot.v = compact(spot.v, bits);
#if LEVELS
    spot.across2 = compact(spot.across2, bits);
#endif
#if PROBES > 1
    spot.along_u = compact(spot.along_u, bits), spot.along_v = compact(spot.along_v, bits);
    spot.probes = compact(spot.probes, bits);
#endif
    Part texel[PARTS];
    sample_texture(shading->textures, map, &spot, count, texel);
    to_channels((const float4 *)texel, channels);
}

// Bends the normals by a map (glTF 2.0, section 3.9.3). Its texels are along the tangent, in which u grows; along the
// bitangent, against which v grows; and along the normal.
INLINE void bend_normals(const Face *f, const OnFace *place, const Shading *shading, uint bits, int count, Surface *s)
{
    global const Mapping *map = &f->material->normal_map;
    float2 uv[3];
    Reals texel[4];
    sample_map(f, place, shading, map, bits, count, uv, texel);
    float3 a = load3(shading->normals, map->tangents + f->vertex.x), b = load3(shading->normals, map->tangents + f->vertex.y);
    float3 c = load3(shading->normals, map->tangents + f->vertex.z);
    Reals share[3];
    UNROLL for (int j = 0; j < 3; ++j) share[j] = compact(place->share[j], bits);
    Reals world[3], t[3], n[3] = {s->normal[0], s->normal[1], s->normal[2]};
    world[0] = share[0] * a.x + share[1] * b.x + share[2] * c.x, world[1] = share[0] * a.y + share[1] * b.y + share[2] * c.y;
    world[2] = share[0] * a.z + share[1] * b.z + share[2] * c.z;
    global const float *axes = shading->lighting->right;
    UNROLL for (int j = 0; j < 3; ++j)
        t[j] = f->side * (world[0] * axes[3 * j] + world[1] * axes[3 * j + 1] + world[2] * axes[3 * j + 2]);
    to_unit(n);
    Reals lean = dot_of(n, t);
    UNROLL for (int j = 0; j < 3; ++j) t[j] -= lean * n[j];
    to_unit(t);
    float2 first = uv[1] - uv[0], second = uv[2] - uv[0];
    float turn = first.x * second.y - first.y * second.x > 0.0f ? -f->side : f->side;
    Reals along = (2.0f * texel[0] - 1.0f) * f->material->normal_scale;
    Reals across = (2.0f * texel[1] - 1.0f) * (f->material->normal_scale * turn), out = 2.0f * texel[2] - 1.0f;
    s->normal[0] = along * t[0] + across * (n[1] * t[2] - n[2] * t[1]) + out * n[0];
    s->normal[1] = along * t[1] + across * (n[2] * t[0] - n[0] * t[2]) + out * n[1];
    s->normal[2] = along * t[2] + across * (n[0] * t[1] - n[1] * t[0]) + out * n[2];
}

// What the surface is at the pixels of these bits, side by side: factors times texels.
INLINE void map_surface(const Face *f, const OnFace *place, const Shading *shading, uint bits, int count, Surface *s)
{
    global const Material *m = f->material;
    float2 uv[3];
    Reals texel[4];
    UNROLL for (int k = 0; k < SURFACE_NUMBERS; ++k) ((Reals *)s)[k] = compact(((const Reals *)s)[k], bits);
    s->metallic = (Reals)(m->metallic), s->roughness = (Reals)(m->roughness), s->occlusion = (Reals)(1.0f);
    UNROLL for (int c = 0; c < 3; ++c) s->emissive[c] = (Reals)(m->emissive[c]);
    if (m->normal_map.used) bend_normals(f, place, shading, bits, count, s);
    if (m->metallic_roughness_map.used) {
        sample_map(f, place, shading, &m->metallic_roughness_map, bits, count, uv, texel);
        Reals rough = s->roughness * texel[1];
        s->metallic *= texel[2], s->roughness = MAX(rough, (Reals)(LEAST_ROUGHNESS));
    }
    if (m->occlusion_map.used) {
        sample_map(f, place, shading, &m->occlusion_map, bits, count, uv, texel);
        s->occlusion += m->occlusion_strength * (texel[0] - 1.0f);
    }
    if (m->emissive_map.used) {
        sample_map(f, place, shading, &m->emissive_map, bits, count, uv, texel);
        UNROLL for (int c = 0; c < 3; ++c) s->emissive[c] *= texel[c];
    }
}
#endif

// Colours of a face without its edges at SHADED pixels, of which those in `bits` are wanted. Returns which of these are
// there: where texels route, those whose alpha is not 0. colors: one for each pixel that is there, side by side.
INLINE uint shade_face(const Face *f, const OnFace *place, const Shading *shading, float3 view, const Sight *sight, uint bits,
                  float4 colors[SHADED])
{
    Light light = light_on(f, place, shading, view, sight);
#if PAINTED
    if (f->material) {
        Waiting waiting;
        waiting.count = 0;
        let_wait(f, place, &light, bits, (Words)(0), &waiting);
        const Light *mapped = 0;
#if MAPS
        if (f->material->mapped) map_surface(f, place, shading, bits, (int)waiting.count, &light), mapped = &light;
#endif
        paint(&waiting, 0, true, shading, mapped, colors);
        if (!LIGHT_IN_ALPHA && f->material->flags & ROUTED_BY_TEXELS) {  // translucency routes before
            const float4 *from = colors;
            for (uint left = bits; left; left &= left - 1, ++from)
                if (from->w > 0.0f) *colors++ = *from;
                else bits &= ~(left & (0u - left));
        }
        return bits;
    }
#endif
#if !LIGHTS
#if SHADED == 1
    *colors = plain_color(f, place, &light, 0);  // a loop would keep it in memory: a compiler cannot know that it ends at once
#else
    for (uint left = bits; left; left &= left - 1) *colors++ = plain_color(f, place, &light, LOWEST_SHADED(left));
#endif
#endif
    return bits;
}

// The same with its edges.
INLINE uint shade(const Face *f, const OnFace *place, const Shading *shading, float3 view, const Sight *sight, uint bits,
                  float4 colors[SHADED])
{
#if WIRES
    if (f->wired) {
        const Wires *w = &shading->wires;
        if (BEHIND || is_band(w, f->source))
            UNROLL for (int k = 0; k < SHADED; ++k) colors[k] = (float4)(0.0f);
        else
            bits = shade_face(f, place, shading, view, sight, bits, colors);
        float unit = (float)(shades_samples(f) ? SUBPIXELS : SUBPIXELS * SHOWN_ROWS);
        Reals covered = wires_over(w, f->source, f->wired, sight->x * ((float)SHOWN_ROWS / SHOWN_COLUMNS), sight->y, unit);
        float4 *color = colors;
        for (uint left = bits; left; left &= left - 1, ++color)
            *color = with_wire(w, *color, ONE_OF(float, covered, LOWEST_SHADED(left)));
        return bits;
    }
#endif
    return shade_face(f, place, shading, view, sight, bits, colors);
}

#if ROUTED
// Which of a record's covered fragments are there (-1, else 0), by what its texels say. solid: whether opaque fragments
// are wanted: then of records that are not OPAQUE those alone whose alpha is 1.
OUTLINE VECTOR(int) routed(global const Triangle *t, uint record, const VECTOR(float) weight[3], VECTOR(int) covered,
                           const Shading *shading, bool solid)
{
    uint all = BITS_OF(covered), kept = 0;
    bool whole = HIDING && solid && !(t->flags & OPAQUE);
    if (is_band(&shading->wires, t->source)) return whole ? (VECTOR(int))(0) : covered;
    int number = shading->material_of[t->source];
    uint flags = number < 0 ? 0 : MATERIAL_AT(shading, number)->flags;
    if (!(flags & ROUTED_BY_TEXELS)) return whole ? (VECTOR(int))(0) : covered;
    if (whole && !(flags & HIDES)) return (VECTOR(int))(0);
    Face face;
    face_of(t, record, shading, &face);
    for (int first = 0; first < STRIP; first += SHADED) {
        uint bits = all >> first & SHADED_BITS;
        if (!bits) continue;
        Reals at_samples[3];
        UNROLL for (int j = 0; j < 3; ++j) at_samples[j] = SAMPLES_OF(weight[j], first);
        OnFace place;
        place_on_face(at_samples, &face, &place);
        Waiting waiting;
        waiting.count = 0;
#if LIGHTS
        const Light *none = 0;
#else
        Light whole_light = (Reals)(1.0f), *none = &whole_light;
#endif
        let_wait(&face, &place, none, bits, (Words)(0), &waiting);
        float4 colors[SHADED];
        paint(&waiting, 0, false, shading, 0, colors);
        for (const float4 *color = colors; bits; bits &= bits - 1, ++color)
            if (whole ? color->w == 1.0f : color->w > 0.0f) kept |= (bits & (0u - bits)) << first;
    }
    return MASK_OF(kept);
}
#define ROUTE(solid) covered = routed(t, batch->pairs[place], weight, covered, shading, solid);
#endif
#endif

// Between VISITS and END_VISITS: takes the fragments away that are not there.
#ifndef ROUTE
#define ROUTE(solid)
#endif

#endif
