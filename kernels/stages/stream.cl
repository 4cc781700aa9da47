// The stream: a batch's fragments in the device's memory, as a rasterizer sends them to the units that blend. It is for
// the execution by passes (frames/peel_passes.h, frames/add_passes.h).
//
//   draw_behind      a tile a work-group: opaque surfaces, before anything transparent (stages/opaque.h)
//   count_fragments  a tile a work-group: counts the fragments of each pixel in front of them (stages/windows.cl)
//   emit_stream      a tile a work-group: walks its records once more, and writes the fragments
//
//   fragments   key << 32 | payload, as in stages/walk.h. Where colours vary over a face, the payload is the fragment's
//               own place in the stream.
//   pixels      the fragment's pixel: those of the run's tiles in the order of base/common.h, tile after tile
//   colors      its colour, where colours vary over a face
//
// Fragments lie tile after tile, and within a tile in the order of submission. So neighbours are of one record, and of
// neighbouring pixels. Where several lanes share a tile, this holds for each lane's pixels: its fragments are one run.
#include "stages/windows.cl"

// z_far: of each pixel of the tiles. behind: the colours of each strip. tile_samples: how many samples of each tile have
// an opaque surface.
kernel void draw_behind(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                        Screen screen, global const uint *faces, global const void *palette, global const float *weights,
                        global const float *normals, global const float *uv, global const int *material_of,
                        global const Material *materials, global const uint *textures,
                        global const Lighting *lighting, global const Wiring *wiring,
                 global const uint *wire_lists, global const Wire *wires, global ulong *z_far,
                        global Colors *behind, global uint *tile_samples)
{
    const Batch records = {triangles, pair_start, pairs, screen}, *batch = &records;
    const Shading colored = GIVEN_SHADING, *shading = &colored;
    local uint samples;
    uint tile = get_group_id(0);
    if (LANE == 0) samples = 0;
    BARRIER;
    KEPT_MEMORY VECTOR(ulong) far[KEPT_STRIPS];
    KEPT_MEMORY Colors colors[KEPT_STRIPS];
    uint until = transparent_from(triangles, pairs, pair_start[tile], pair_start[tile + 1]);
    uint own_samples = draw_opaque(batch, shading, tile, until, far, colors);
    atomic_add(&samples, own_samples);
    for (int own = 0; own < STRIPS_A_LANE; ++own) {
        uint place = own * LANES + LANE, strip = tile * (TILE_PIXELS / STRIP) + place;
        *(global VECTOR(ulong) *)(z_far + strip * STRIP) = far[place];
        behind[strip] = colors[place];
    }
    BARRIER;
    if (LANE == 0) tile_samples[tile] = samples;
}

// Emits the fragments of a run: of whole tiles, or of the pixels first_pixel .. last_pixel of one tile. first_tile: of
// the run, in the batch. pixel_end, tile_start, run_start: as in stages/windows.cl; run_start is the place of the run's
// first fragment in the batch, modulo 2^32.
kernel void emit_stream(global const Triangle *triangles, global const uint *pair_start, global const uint *pairs,
                        Screen screen, uint first_tile, uint first_pixel, uint last_pixel, global const ulong *z_far,
                        global const uint *pixel_end, global const uint *tile_start, uint run_start,
                        global const uint *faces, global const void *palette, global const float *weights,
                        global const float *normals, global const float *uv, global const int *material_of,
                        global const Material *materials, global const uint *textures,
                        global const Lighting *lighting, global const Wiring *wiring,
                 global const uint *wire_lists, global const Wire *wires, global ulong *fragments,
                        global uint *pixels, global float4 *colors)
{
    const Batch records = {triangles, pair_start, pairs, screen}, *batch = &records;
    const Shading colored = GIVEN_SHADING, *shading = &colored;
    uint tile = first_tile + get_group_id(0);
    ENTER_TILE
    if (MIXED) list_begin = transparent_from(triangles, pairs, list_begin, list_end);
    // A lane's pixels follow each other in a tile, and so do their fragments in the stream.
    uint own_first = MAX((uint)(lane * (TILE_PIXELS / LANES)), first_pixel);
    uint next = tile_start[tile] - run_start + (own_first ? pixel_end[tile * TILE_PIXELS + own_first - 1] : 0);
    VISITS((1u << TILE_BLOCKS) - 1)
    uint own_pixel = block * BLOCK_PIXELS + FIRST_PIXEL;
    VECTOR(uint) key = keys_of(t, weight, screen.depth_scale);
#if MIXED
    covered &= is_in_front(key, t->source, *(global const VECTOR(ulong) *)(z_far + tile * TILE_PIXELS + own_pixel));
#endif
    ROUTE(false)
    uint bits = BITS_OF(covered) & bits_between((int)first_pixel - (int)own_pixel, (int)last_pixel - (int)own_pixel);
    uint run_pixel = get_group_id(0) * TILE_PIXELS + own_pixel;
#if FRAGMENT_COLOR
    for (int first = 0; first < STRIP; first += SHADED) {
        uint some = bits >> first & SHADED_BITS;
        if (!some) continue;
        Face face;
        face_of(t, batch->pairs[place], shading, &face);
        Reals to_shade_at[3];
        WEIGHTS_TO_SHADE(first, &face, to_shade_at);
        OnFace on_face;
        place_on_face(to_shade_at, &face, &on_face);
        Sight sight = SIGHT(first, &face);
        float4 colors_there[SHADED];
        uint shaded = 0;
        some = shade(&face, &on_face, shading, VIEW(batch), &sight, some, colors_there);
        for (; some; some &= some - 1, ++next) {
            int k = LOWEST_SHADED(some);
            fragments[next] = (ulong)ELEMENT(uint, key, first + k) << 32 | PAYLOAD(next, t);
            pixels[next] = run_pixel + first + k;
            colors[next] = colors_there[shaded++ % SHADED];
        }
    }
#else
    for (; bits; bits &= bits - 1, ++next) {
        int k = LOWEST_BIT(bits);
        fragments[next] = (ulong)ELEMENT(uint, key, k) << 32 | PAYLOAD(t->source, t);
        pixels[next] = run_pixel + k;
    }
#endif
    END_VISITS
}
