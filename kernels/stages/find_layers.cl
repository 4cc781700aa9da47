// Layers: finds in the lists of a window (stages/windows.cl) the layers that peeling would give, front to back.
//
//   peel_layers   a pixel a work-item: sorts its list by (depth, submission index), and keeps the layers to be peeled
//
//   fragments     before: pixel by pixel, in submission order; after: each pixel's layers, from where its list began
//   kept          how many layers each pixel of the window's tiles has
//
// With opaque_first, the layers of a pixel end with its first opaque fragment. Of the transparent ones the `front`
// nearest and the `back` farthest are peeled. Without keep_coincident, only the first submitted fragment of each depth
// is kept.
#include "fragments/sorting.h"

// Sorts a short list in place.
static void sort_inserting(global ulong *list, uint count)
{
    PLAIN_LOOP for (uint k = 1; k < count; ++k) {
        ulong fragment = list[k];
        uint to = k;
        PLAIN_LOOP for (; to > 0 && list[to - 1] > fragment; --to) list[to] = list[to - 1];
        list[to] = fragment;
    }
}

// Whether a fragment is of an opaque surface, which is one whose alphas are all 1. Interpolation of such alphas may
// miss 1 by some roundings. The picture has them as exactly opaque (stages/opaque.h), so the fragment gets the alpha 1
// here.
INLINE bool is_opaque(ulong fragment, global float4 *colors, global const uint *sources, global const uint *faces,
                      global const void *palette)
{
    uint payload = (uint)fragment;
#if COLOR_RATE_VERTEX && !MATERIALS  // those have alpha 1 already (shading/shade.h)
    uint3 face = load_face(faces, sources[payload]);
    if (palette_color(palette, face.x).w == 1.0f && palette_color(palette, face.y).w == 1.0f &&
        palette_color(palette, face.z).w == 1.0f)
        colors[payload].w = 1.0f;
#endif
#if FRAGMENT_COLOR
    return colors[payload].w == 1.0f;
#else
    return palette_color(palette, COLOR_RATE_FACE ? payload : 0).w == 1.0f;
#endif
}

// spare: has the length of `fragments`; used only where a pixel has more than INSERTED_MAX fragments.
kernel void peel_layers(global ulong *fragments, global ulong *spare, global float4 *colors, global const uint *sources,
                        global const uint *faces, global const void *palette, global const uint *pixel_end, global const uint *tile_start, uint window_tile, uint tiles,
                        uint window_start, uint first_pixel, uint last_pixel, uint front, uint back,
                        int keep_coincident, int opaque_first, global uint *kept)
{
    uint at = get_global_id(0), pixel = at % TILE_PIXELS, tile = window_tile + at / TILE_PIXELS;
    if (at / TILE_PIXELS >= tiles) return;
    global const uint *end = pixel_end + tile * TILE_PIXELS + pixel;
    uint before = pixel ? end[-1] : 0, count = *end - before;
    kept[at] = 0;
    if (count == 0 || pixel < first_pixel || pixel > last_pixel) return;
    uint begin = tile_start[tile] - window_start + before;

    global ulong *list = fragments + begin, *sorted = list;
    if (count > INSERTED_MAX) sorted = sort_list(list, spare + begin, count);
    else sort_inserting(list, count);

    uint found = 0, solid = 0;
    for (uint k = 0; k < count && !solid; ++k) {
        ulong fragment = sorted[k];
        if (!keep_coincident && found && list[found - 1] >> 32 == fragment >> 32) continue;
        solid = opaque_first && is_opaque(fragment, colors, sources, faces, palette);
        list[found++] = fragment;  // never ahead of what is read next
    }
    uint clear = found - solid;
    if (clear > front && clear - front > back) {
        uint skipped = clear - front - back;
        for (uint k = front + skipped; k < found; ++k) list[k - skipped] = list[k];
        found -= skipped;
    }
    kept[at] = found;
}
