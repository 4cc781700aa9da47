// sort: the exact picture, by sorting each pixel's fragments and blending them front to back.
//
// Order: (depth, submission index), nearest first: that of the fragments as integers (raster.h). Up to RUN_MAX of each of
// a strip's pixels are held in private memory, a row of vectors for each layer, and sorted side by side by one network,
// whose steps depend on no depth. A deeper pixel is sorted first where it lies, by its digits.
// Blending (blending.h) stops where the transmittance is exactly zero: nothing behind can change the picture.
#include "sorting.h"

INLINE void exchange(VECTOR(ulong) *nearer, VECTOR(ulong) *farther)
{
    VECTOR(ulong) a = *nearer, b = *farther, least = MIN(a, b);
    *nearer = least, *farther = a ^ b ^ least;  // the other: a CPU has one unit that compares, and several that do this
}

#define X(i, j) exchange(rows + i, rows + j);

// Sorts ROWS rows: the network of 19 exchanges (Knuth, The Art of Computer Programming 3, 5.3.4).
INLINE void sort_eight(VECTOR(ulong) *rows)
{
    X(0, 2) X(1, 3) X(4, 6) X(5, 7) X(0, 4) X(1, 5) X(2, 6) X(3, 7) X(0, 1) X(2, 3) X(4, 5) X(6, 7) X(2, 4) X(3, 5) X(1, 4)
    X(3, 6) X(1, 2) X(3, 4) X(5, 6)
}

// Merges sorted runs of ROWS rows two by two, `count` in all: the bitonic network (Batcher 1968), whose first step pairs the
// first of one run with the last of the other. It is that for the next power of two: what is not there would stay behind.
// Storing rows is what costs: so the last steps, which stay among eight rows, are taken while those are in registers.
INLINE void merge_rows(VECTOR(ulong) *all, uint count)
{
    for (uint run = ROWS; run < count; run *= 2)
        for (uint first = 0; first + run < count; first += 2 * run) {
            uint end = MIN(first + 2 * run, count);
            for (uint far = first + run; far < end; ++far) exchange(all + 2 * (first + run) - 1 - far, all + far);
            for (uint step = run / 2; step >= ROWS; step /= 2)
                for (uint part = first; part + step < end; part += 2 * step)
                    for (uint k = part; k < MIN(part + step, end - step); ++k) exchange(all + k, all + k + step);
            for (uint part = first; part < end; part += ROWS) {
                VECTOR(ulong) rows[ROWS];
                UNROLL for (int k = 0; k < ROWS; ++k) rows[k] = all[part + k];
                X(0, 4) X(1, 5) X(2, 6) X(3, 7) X(0, 2) X(1, 3) X(4, 6) X(5, 7) X(0, 1) X(2, 3) X(4, 5) X(6, 7)
                UNROLL for (int k = 0; k < ROWS; ++k) all[part + k] = rows[k];
            }
        }
}

// Whether any pixel lets something through.
INLINE bool is_seen(VECTOR(float) transmittance)
{
    bool seen = false;
    for (int k = 0; k < STRIP; ++k) seen |= ((const float *)&transmittance)[k] != 0.0f;
    return seen;
}

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved)
{
    uint deepest = 0;
    for (int k = 0; k < STRIP; ++k) {
        uint size = ((const uint *)&count)[k], from = ((const uint *)&begin)[k];
        deepest = MAX(deepest, size);
        if (size <= RUN_MAX) continue;
        global const ulong *sorted = sort_digits(fragments + from, scratch + from, size);
        if (sorted != fragments + from)
            PLAIN_LOOP for (uint i = 0; i < size; i += 8)
                *(global Octet *)(fragments + from + i) = *(global const Octet *)(sorted + i);
    }
    for (uint first = 0; first < deepest; first += RUN_MAX) {
        VECTOR(ulong) all[RUN_MAX];
        uint row_count = (MIN(deepest - first, (uint)RUN_MAX) + ROWS - 1) / ROWS * ROWS;
        for (uint row = 0; row < row_count; row += ROWS) {
            VECTOR(ulong) rows[ROWS];
            load_rows(fragments, begin, step, count, first + row, rows);
            if (first == 0) sort_eight(rows);
            UNROLL for (int k = 0; k < ROWS; ++k) all[row + k] = rows[k];
        }
        if (first == 0) merge_rows(all, row_count);
        for (uint row = 0; row < row_count && is_seen(resolved->alpha); row += ROWS) {
            Colors source[ROWS];
            uint fetched = MIN(deepest - first - row, (uint)ROWS);
            fetch_colors(all + row, fetched, colors, source);
            for (uint k = 0; k < fetched; ++k) blend_under(resolved, source + k);
        }
    }
}

#include "draw.h"
