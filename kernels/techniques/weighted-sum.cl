// weighted-sum: one pass over the fragments in the order they come, no sorting, not exact.
//
// Meshkin's sum (2007), as Bavoil and Myers compare it (2008, "Weighted Sum"), over a background C0:
//   C = sum(Ai Ci) + C0 (1 - sum(Ai))
// It is the picture's first-order part: right where alphas are small. Where they sum to more than one, what is left of the
// background is less than nothing (draw.h counts those pixels).
#include "shading.h"

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved)
{
    uint deepest = 0;
    for (int k = 0; k < STRIP; ++k) deepest = MAX(deepest, ((const uint *)&count)[k]);
    resolved->alpha = (VECTOR(float))(0.0f);
    for (uint first = 0; first < deepest; first += ROWS) {
        VECTOR(ulong) rows[ROWS];
        Colors source[ROWS];
        load_rows(fragments, begin, step, count, first, rows);
        uint fetched = MIN(deepest - first, (uint)ROWS);
        fetch_colors(rows, fetched, colors, source);
        for (uint k = 0; k < fetched; ++k) blend_add(resolved, source + k);
    }
    resolved->alpha = 1.0f - resolved->alpha;
}

#include "draw.h"
