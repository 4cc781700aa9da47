// sort: the exact picture, by sorting each pixel's fragments and blending them front to back.
//
//   resolve    one work-group a tile, one lane a strip of its pixels at a time
//
// Order: (depth, submission index), nearest first: that of the fragments as integers (raster.cl). Up to RUN_MAX of each of a
// strip's pixels are held in private memory, a row of vectors for each layer, and sorted side by side by one network, whose
// steps depend on no depth. A deeper pixel is sorted first where it lies, by its digits.
// Blending (blending.h) stops where the transmittance is exactly zero: nothing behind can change the picture.
#include "shading.h"

// Batcher's bitonic sorter with all exchanges in one direction, so that rows beyond `count`, were there any with ABSENT,
// would never move: any count will do.
INLINE void exchange(VECTOR(ulong) *nearer, VECTOR(ulong) *farther)
{
    VECTOR(ulong) a = *nearer, b = *farther;
    *nearer = MIN(a, b), *farther = MAX(a, b);
}

INLINE void sort_rows(VECTOR(ulong) *rows, uint count)
{
    for (uint sorted = 1; sorted < count; sorted *= 2) {
        // Two sorted runs, the second from behind: then the lesser of each pair are in the first run's place.
        for (uint middle = sorted; middle < count; middle += 2 * sorted)
            for (uint b = middle; b < MIN(middle + sorted, count); ++b) exchange(rows + (2 * middle - 1 - b), rows + b);
        for (uint gap = sorted / 2; gap; gap /= 2)
            for (uint middle = gap; middle < count; middle += 2 * gap)
                for (uint b = middle; b < MIN(middle + gap, count); ++b) exchange(rows + (b - gap), rows + b);
    }
}

// Sorts one pixel's fragments by the digits of their depth keys, the least first, between `list` and `spare`: as many steps
// for each fragment, however many there are. Digits that all have in common are passed over.
static void sort_digits(global ulong *list, global ulong *spare, uint count)
{
    uint place[4][256];
    for (uint k = 0; k < 4 * 256; ++k) place[0][k] = 0;
    for (uint k = 0; k < count; ++k) {
        uint key = (uint)(list[k] >> 32);
        ++place[0][key & 255], ++place[1][key >> 8 & 255], ++place[2][key >> 16 & 255], ++place[3][key >> 24];
    }
    global ulong *from = list, *to = spare;
    for (int digit = 0; digit < 4; ++digit) {
        int shift = 32 + 8 * digit;
        if (place[digit][from[0] >> shift & 255] == count) continue;
        uint sum = 0;
        for (int k = 0; k < 256; ++k) {
            uint size = place[digit][k];
            place[digit][k] = sum;
            sum += size;
        }
        for (uint k = 0; k < count; ++k) {
            ulong fragment = from[k];
            to[place[digit][fragment >> shift & 255]++] = fragment;
        }
        global ulong *swap = from;
        from = to, to = swap;
    }
    if (from != list)
        for (uint k = 0; k < count; ++k) list[k] = from[k];
}

// Whether any pixel lets something through.
INLINE bool is_seen(VECTOR(float) transmittance)
{
    bool seen = false;
    for (int k = 0; k < STRIP; ++k) seen |= ((const float *)&transmittance)[k] != 0.0f;
    return seen;
}

kernel void resolve(global ulong *fragments, global ulong *scratch, global const uint *pixel_end,
                    global const uint *tile_start, global const void *colors, uint window_tile,
                    uint first_pixel, uint last_pixel, global float4 *layer)
{
    uint tile = get_group_id(0), first_slot = (window_tile + tile) * TILE_PIXELS;
    for (uint p = get_local_id(0) * STRIP; p < TILE_PIXELS; p += LANES * STRIP) {
        uint begin[STRIP], count[STRIP], deepest = 0;
        for (int k = 0; k < STRIP; ++k) {
            bool here = p + k >= first_pixel && p + k <= last_pixel;
            begin[k] = p + k ? pixel_end[first_slot + p + k - 1] : 0;
            count[k] = here ? pixel_end[first_slot + p + k] - begin[k] : 0;
            begin[k] += tile_start[tile];
            deepest = MAX(deepest, count[k]);
            if (count[k] > RUN_MAX) sort_digits(fragments + begin[k], scratch + begin[k], count[k]);
        }
        Colors blended = {(VECTOR(float))(0.0f), (VECTOR(float))(0.0f), (VECTOR(float))(0.0f), (VECTOR(float))(1.0f)};
        for (uint first = 0; first < deepest; first += RUN_MAX) {
            VECTOR(ulong) rows[RUN_MAX];
            uint row_count = MIN(deepest - first, (uint)RUN_MAX);
            for (int k = 0; k < STRIP; ++k) {
                uint held = count[k] > first ? MIN(count[k] - first, row_count) : 0;
                SCALAR_LOOP
                for (uint row = 0; row < held; ++row) ((ulong *)(rows + row))[k] = fragments[begin[k] + first + row];
                SCALAR_LOOP
                for (uint row = held; row < row_count; ++row) ((ulong *)(rows + row))[k] = ABSENT;
            }
            if (first == 0) sort_rows(rows, row_count);
            for (uint row = 0; row < row_count && is_seen(blended.alpha); row += FETCH_ROWS) {
                Colors source[FETCH_ROWS];
                uint fetched = MIN(row_count - row, (uint)FETCH_ROWS);
                fetch_colors(rows + row, fetched, colors, source);
                for (uint k = 0; k < fetched; ++k) blend_under(&blended, source + k);
            }
        }
        for (int k = 0; k < STRIP; ++k)
            if (p + k >= first_pixel && p + k <= last_pixel)
                layer[first_slot + p + k] = (float4)(((const float *)&blended.red)[k], ((const float *)&blended.green)[k],
                                                     ((const float *)&blended.blue)[k], ((const float *)&blended.alpha)[k]);
    }
}
