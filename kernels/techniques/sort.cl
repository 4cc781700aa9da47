// sort: the exact picture, by sorting each pixel's fragments and blending them front to back.
//
//   resolve    one work-group a tile, one lane a pixel at a time
//
// Order: (depth, submission index), nearest first. Fragments arrive in submission order and every sort here is stable, so
// the depth key alone decides. Lists up to RUN_MAX are sorted in private memory; longer ones are cut into runs that are
// sorted so in place, then merged bottom-up between `fragments` and `scratch`: n log n whatever the depth.
// Blending (blending.h) stops where the transmittance is exactly zero: nothing behind can change the picture.
#include "blending.h"
#include "shading.h"

INLINE uint key_of(ulong fragment) { return (uint)(fragment >> 32); }

#if LANES == 1
// Rank sort: a fragment's place is the number of fragments before it. One lane has the vector unit to itself, so 16 are
// ranked at once against each of the others, without a branch that depends on a depth.
INLINE void sort_run(global const ulong *list, uint count, ulong *sorted)
{
    const uint16 lane = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    uint key[RUN_MAX] __attribute__((aligned(64)));
    for (uint k = 0; k < count; ++k) key[k] = key_of(list[k]);
    for (uint first = 0; first < count; first += 16) {
        uint16 own = *(const uint16 *)(key + first), rank = (uint16)(0);
        // Equal keys: those submitted earlier come first, so up to this block they count too.
        uint k = 0;
        for (; k < first; ++k) rank -= as_uint16((uint16)(key[k]) <= own);
        for (; k < MIN(first + 16, count); ++k)
            rank -= as_uint16((uint16)(key[k]) < own + (as_uint16(lane > (uint16)(k - first)) & (uint16)(1)));
        for (; k < count; ++k) rank -= as_uint16((uint16)(key[k]) < own);
        for (uint k = 0; k < MIN(count - first, 16u); ++k) sorted[((const uint *)&rank)[k]] = list[first + k];
    }
}
#else
// Insertion sort: the least work for a lane of its own.
INLINE void sort_run(global const ulong *list, uint count, ulong *sorted)
{
    for (uint i = 0; i < count; ++i) {
        ulong moving = list[i];
        uint k = i;
        for (; k > 0 && key_of(sorted[k - 1]) > key_of(moving); --k) sorted[k] = sorted[k - 1];
        sorted[k] = moving;
    }
}
#endif

// Sorts count > RUN_MAX fragments; returns where they end up, `list` or `spare`.
static global const ulong *merge_sort(global ulong *list, global ulong *spare, uint count)
{
    ulong run[RUN_MAX];
    for (uint first = 0; first < count; first += RUN_MAX) {
        uint length = MIN(count - first, (uint)RUN_MAX);
        sort_run(list + first, length, run);
        for (uint k = 0; k < length; ++k) list[first + k] = run[k];
    }
    for (uint width = RUN_MAX; width < count; width *= 2) {
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
        float4 color = (float4)(0.0f);
        float transmittance = 1.0f;
        if (count <= RUN_MAX) {
            ulong run[RUN_MAX];
            sort_run(fragments + begin, count, run);
            for (uint k = 0; k < count && transmittance != 0.0f; ++k)
                blend_under(&color, &transmittance, fragment_color((uint)run[k], colors));
        } else {
            global const ulong *sorted = merge_sort(fragments + begin, scratch + begin, count);
            for (uint k = 0; k < count && transmittance != 0.0f; ++k)
                blend_under(&color, &transmittance, fragment_color((uint)sorted[k], colors));
        }
        layer[slot] = (float4)(color.xyz, transmittance);
    }
}
