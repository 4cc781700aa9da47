// sort: the exact picture. It sorts each pixel's fragments (fragments/sorting.h) and blends them front to back.
//
// Blending stops where the transmittance is exactly zero, because then nothing behind can change the picture. With
// BOUNDED, the blending of each pixel stops where its transmittance is parameters[0] or less. This transmittance is
// then also the most that the fragments behind can change (stages/composite.h).
#include "fragments/sorting.h"

#if RUN == 1
#define MAY_BE_SEEN(transmittance) true
#else
#define MAY_BE_SEEN(transmittance) is_seen(transmittance, least_seen)
#endif

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved
#if BOUNDED
                          , global const float *parameters, VECTOR(float) *found
#endif
                          )
{
#if BOUNDED
    const float least_seen = parameters[0];
    VECTOR(uint) blended = (VECTOR(uint))(0);
#else
    const float least_seen = 0.0f;
#endif
    Colors color;
    clear_buffer(&color);
    uint deepest = sort_deep(fragments, scratch, begin, step, count);
    for (uint first = 0; first < deepest; first += RUN) {
#if RUN == 1
        if (first % SEEN_EVERY == 0 && !is_seen(read_channel(color.alpha), least_seen)) break;
#endif
        VECTOR(ulong) all[RUN];
        uint row_count = load_sorted(fragments, begin, step, count, first, deepest, all);
        for (uint row = 0; row < row_count && MAY_BE_SEEN(read_channel(color.alpha)); row += ROWS) {
            Colors source[ROWS];
            uint fetched = MIN(deepest - first - row, (uint)ROWS);
            fetch_colors(all + row, fetched, colors, source);
            for (uint k = 0; k < fetched; ++k) {
#if BOUNDED
                VECTOR(int) seen = read_channel(color.alpha) > (VECTOR(float))(least_seen);
                source[k].alpha = PASTE(as_, VECTOR(float))(PASTE(as_, VECTOR(int))(source[k].alpha) & seen);
                blended -= PASTE(as_, VECTOR(uint))(seen);
#endif
                blend_under(&color, source + k);
            }
        }
    }
    read_color(&color, resolved);
#if BOUNDED
    VECTOR(int) hidden = count > blended;
    *found = PASTE(as_, VECTOR(float))(PASTE(as_, VECTOR(int))(resolved->alpha) & hidden);
#endif
}

#include "frames/one_pass.h"
