// sort: the exact picture, by sorting each pixel's fragments and blending them front to back.
//
//   resolve    one work-group a tile, one lane a pixel at a time
//
// Order: (depth, submission index), nearest first. Fragments arrive in submission order and every sort here is stable, so
// the depth key alone decides. Short lists are sorted by insertion in private memory; longer ones are cut into runs that
// are sorted so in place, then merged bottom-up between `fragments` and `scratch`: n log n whatever the depth.
// Blending (blending.h) stops where the transmittance is exactly zero: nothing behind can change the picture.
#include "blending.h"
#include "shading.h"

INLINE uint key_of(ulong fragment) { return (uint)(fragment >> 32); }

INLINE void insertion_sort(ulong *run, uint count)
{
    for (uint i = 1; i < count; ++i) {
        ulong moving = run[i];
        uint k = i;
        for (; k > 0 && key_of(run[k - 1]) > key_of(moving); --k) run[k] = run[k - 1];
        run[k] = moving;
    }
}

// Sorts count > INSERTION_MAX fragments; returns where they end up, `list` or `spare`.
static global const ulong *merge_sort(global ulong *list, global ulong *spare, uint count)
{
    for (uint first = 0; first < count; first += INSERTION_MAX) {
        ulong run[INSERTION_MAX];
        uint length = MIN(count - first, (uint)INSERTION_MAX);
        for (uint k = 0; k < length; ++k) run[k] = list[first + k];
        insertion_sort(run, length);
        for (uint k = 0; k < length; ++k) list[first + k] = run[k];
    }
    for (uint width = INSERTION_MAX; width < count; width *= 2) {
        for (uint first = 0; first < count; first += 2 * width) {
            uint a = first, middle = MIN(first + width, count), b = middle, end = MIN(first + 2 * width, count);
            for (uint out = first; out < end; ++out) {
                bool left = b >= end || (a < middle && key_of(list[a]) <= key_of(list[b]));
                spare[out] = list[left ? a++ : b++];
            }
        }
        global ulong *swap = list;
        list = spare;
        spare = swap;
    }
    return list;
}

kernel void resolve(global ulong *fragments, global ulong *scratch, global const uint *pixel_end,
                    global const uint *tile_start, global const float4 *colors, uint window_tile,
                    uint first_pixel, uint last_pixel, global float4 *layer)
{
    uint tile = get_group_id(0);
    for (uint p = first_pixel + get_local_id(0); p <= last_pixel; p += LANES) {
        uint slot = (window_tile + tile) * TILE_PIXELS + p;
        uint begin = p ? pixel_end[slot - 1] : 0, count = pixel_end[slot] - begin;
        begin += tile_start[tile];
        float4 color = (float4)(0.0f, 0.0f, 0.0f, 1.0f);
        if (count <= INSERTION_MAX) {
            ulong run[INSERTION_MAX];
            for (uint k = 0; k < count; ++k) run[k] = fragments[begin + k];
            insertion_sort(run, count);
            for (uint k = 0; k < count && color.w != 0.0f; ++k)
                color = blend_under(color, fragment_color((uint)run[k], colors));
        } else {
            global const ulong *sorted = merge_sort(fragments + begin, scratch + begin, count);
            for (uint k = 0; k < count && color.w != 0.0f; ++k)
                color = blend_under(color, fragment_color((uint)sorted[k], colors));
        }
        layer[slot] = color;
    }
}
