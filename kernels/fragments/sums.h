// Sums of a pixel's fragments, in submission order: what the techniques that do not sort have in common.
#ifndef SUMS_H
#define SUMS_H

#include "fragments/colors.h"

// Adds up a strip's fragments, by additive blending into a buffer of zeros: sum(Ai Ci) and sum(Ai).
INLINE void add_up(global const ulong *fragments, VECTOR(uint) begin, uint step, VECTOR(uint) count,
                   global const void *colors, Colors *sums)
{
    uint deepest = largest(count);
    Colors buffer;
    clear_sums(&buffer);
    for (uint first = 0; first < deepest; first += ROWS) {
        VECTOR(ulong) rows[ROWS];
        Colors source[ROWS];
        load_rows(fragments, begin, step, count, first, rows);
        uint fetched = MIN(deepest - first, (uint)ROWS);
        fetch_colors(rows, fetched, colors, source);
        for (uint k = 0; k < fetched; ++k) blend_add(&buffer, source + k);
    }
    read_color(&buffer, sums);
}

#endif
