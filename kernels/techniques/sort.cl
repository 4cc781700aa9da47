// sort: the exact picture, by sorting each pixel's fragments (sorting.h) and blending them front to back.
//
// Blending (blending.h) stops where the transmittance is exactly zero: nothing behind can change the picture.
#include "sorting.h"

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
    uint deepest = sort_deep(fragments, scratch, begin, count);
    for (uint first = 0; first < deepest; first += RUN_MAX) {
        VECTOR(ulong) all[RUN_MAX];
        uint row_count = load_sorted(fragments, begin, step, count, first, deepest, all);
        for (uint row = 0; row < row_count && is_seen(resolved->alpha); row += ROWS) {
            Colors source[ROWS];
            uint fetched = MIN(deepest - first - row, (uint)ROWS);
            fetch_colors(all + row, fetched, colors, source);
            for (uint k = 0; k < fetched; ++k) blend_under(resolved, source + k);
        }
    }
}

#include "draw.h"
