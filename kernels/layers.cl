// Layers: the lists of a window (raster.cl) to the layers that are peeled, front to back.
//
//   peel_layers   one work-item a pixel: sorts its list by (depth, submission index), then keeps what is peeled
//
//   fragments     before: pixel by pixel, in submission order; after: each pixel's layers, from where its list began
//   kept          how many these are, of each pixel of the window's tiles
//
// A pixel's list ends with its first opaque fragment. Of the transparent ones the `front` nearest and the `back` farthest are
// peeled; without keep_coincident, of equal depths the first submitted alone.
#include "sorting.h"

// Puts a short list into order where it lies.
static void sort_inserting(global ulong *list, uint count)
{
    PLAIN_LOOP for (uint k = 1; k < count; ++k) {
        ulong fragment = list[k];
        uint to = k;
        PLAIN_LOOP for (; to > 0 && list[to - 1] > fragment; --to) list[to] = list[to - 1];
        list[to] = fragment;
    }
}

INLINE float alpha_of(ulong fragment, global const void *colors)
{
#if FRAGMENT_COLOR
    return ((global const float4 *)colors)[(uint)fragment].w;
#else
    return palette_color(colors, COLOR_RATE_FACE ? (uint)fragment : 0).w;
#endif
}

// spare: as long as `fragments`; read and written only where a pixel has more than INSERTED_MAX.
kernel void peel_layers(global ulong *fragments, global ulong *spare, global const void *colors,
                        global const uint *pixel_end, global const uint *tile_start, uint window_tile, uint tiles,
                        uint window_start, uint first_pixel, uint last_pixel, uint front, uint back,
                        int keep_coincident, global uint *kept)
{
    uint at = get_global_id(0), pixel = at % TILE_PIXELS, tile = window_tile + at / TILE_PIXELS;
    if (at / TILE_PIXELS >= tiles) return;
    global const uint *end = pixel_end + tile * TILE_PIXELS + pixel;
    uint before = pixel ? end[-1] : 0, count = *end - before;
    kept[at] = 0;
    if (count == 0 || pixel < first_pixel || pixel > last_pixel) return;
    uint begin = tile_start[tile] - window_start + before;

    global ulong *list = fragments + begin, *sorted = list;
    if (count > INSERTED_MAX) sorted = sort_digits(list, spare + begin, count);
    else sort_inserting(list, count);

    uint found = 0, solid = 0;
    for (uint k = 0; k < count && !solid; ++k) {
        ulong fragment = sorted[k];
        if (!keep_coincident && found && list[found - 1] >> 32 == fragment >> 32) continue;
        solid = alpha_of(fragment, colors) == 1.0f;
        list[found++] = fragment;  // never ahead of what is read
    }
    uint clear = found - solid;
    if (clear > front && clear - front > back) {
        uint skipped = clear - front - back;
        for (uint k = front + skipped; k < found; ++k) list[k - skipped] = list[k];
        found -= skipped;
    }
    kept[at] = found;
}
