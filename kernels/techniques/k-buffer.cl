// k-buffer: keeps KEPT_LAYERS fragments of each pixel, sorts these, and does something simple with the others, the tail.
//
// Fragments come in the order of submission. Which are kept is said by BY_ARRIVAL:
//
//   0   the nearest ones (Bavoil, Callahan, Lefohn, Comba and Silva 2007, "Multi-Fragment Effects on the GPU using the
//       k-Buffer"): each arriving fragment is inserted among those kept, and the farthest of them is left over
//   1   the first ones to arrive (Myers and Bavoil 2007, "Stencil Routed A-Buffer"), which are sorted afterwards
//
// With AVERAGED, those left over become one layer behind the kept ones, by weighted-average (fragments/averaging.h). This
// is "Hybrid Transparency" (Maule, Comba, Torchelsen and Bastos 2013): with the kept colour Ck and transmittance Tk, and
// Cw and Tw of the tail,
//   C = Ck + Tk (Cw + Tw C0).
// Otherwise they are lost. The frame then counts their pixels (CUT_AFTER, frames/one_pass.h).
//
// All lanes insert fragments in the same order, so all leave them over in the same order. The sums of the tail, which depend
// on it, thus have the same bits on every shape of device.
#ifndef KEPT_LAYERS
#define KEPT_LAYERS 8
#define BY_ARRIVAL 0
#define AVERAGED 1
#endif
#if !AVERAGED
#define CUT_AFTER KEPT_LAYERS
#endif
#include "fragments/averaging.h"
#include "fragments/sorting.h"

// Blends one row of kept fragments after the other. Like `sort`, it stops where nothing behind could be seen.
#define BLEND_ROWS(row)                                                                                         \
    for (uint first = 0; first < most && is_seen(read_channel(front.alpha), 0.0f); first += SEEN_EVERY)         \
        PLAIN_LOOP for (uint k = first; k < MIN(first + SEEN_EVERY, most); ++k) {                               \
            Colors source;                                                                                      \
            VECTOR(ulong) fragment;                                                                             \
            row;                                                                                                \
            fetch_colors(&fragment, 1, colors, &source);                                                        \
            blend_under(&front, &source);                                                                       \
        }

#if LANES > 1
// Keeps fragments of one pixel in the first places of its list, in their order, and leaves the others in the places behind.
INLINE void keep_in_place(global ulong *list, uint step, uint count)
{
    if (KEPT_LAYERS == 0) return;
    PLAIN_LOOP for (uint i = 1; i < count; ++i) {
        ulong arrived = list[(size_t)i * step];
        uint at = i;
        if (i >= KEPT_LAYERS) {
            if (BY_ARRIVAL) break;
            at = KEPT_LAYERS - 1;
            ulong farthest = list[(size_t)at * step];
            if (arrived > farthest) continue;
            list[(size_t)i * step] = farthest;
        }
        PLAIN_LOOP for (; at > 0 && list[(size_t)(at - 1) * step] > arrived; --at)
            list[(size_t)at * step] = list[(size_t)(at - 1) * step];
        list[(size_t)at * step] = arrived;
    }
}
#endif

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved)
{
    const VECTOR(uint) room = (VECTOR(uint))(KEPT_LAYERS);
    VECTOR(uint) kept = MIN(count, room);
    uint deepest = largest(count), most = MIN(deepest, (uint)KEPT_LAYERS);
    Colors front, tail;
    clear_buffer(&front);
    clear_sums(&tail);
    if (!AVERAGED && BY_ARRIVAL) deepest = most;
#if LANES == 1
    VECTOR(ulong) held[KEPT_LAYERS + 1];
    for (uint k = 0; k < KEPT_LAYERS; ++k) held[k] = (VECTOR(ulong))(ABSENT);
    for (uint first = 0; first < deepest; first += ROWS) {
        VECTOR(ulong) rows[ROWS];
        load_rows(fragments, begin, step, count, first, rows);
        uint row_count = MIN(deepest - first, (uint)ROWS);
        for (uint row = 0; row < row_count; ++row) {
            VECTOR(ulong) left = rows[row];
            bool arrives_late = first + row >= KEPT_LAYERS;
            if (!BY_ARRIVAL || !arrives_late)
                for (uint k = 0; k < KEPT_LAYERS; ++k) exchange(held + k, &left);
            rows[row] = left;
        }
        if (AVERAGED && first + row_count > KEPT_LAYERS) {
            Colors source[ROWS];
            fetch_colors(rows, row_count, colors, source);
            for (uint row = 0; row < row_count; ++row) blend_add(&tail, source + row);
        }
    }
    BLEND_ROWS(fragment = held[k])
#else
    STRIP_LOOP for (int k = 0; k < STRIP; ++k)
        keep_in_place(fragments + ELEMENT(uint, begin, k), step, ELEMENT(uint, count, k));
    BLEND_ROWS(load_rows(fragments, begin, step, kept, k, &fragment))
    if (AVERAGED)
        PLAIN_LOOP for (uint k = KEPT_LAYERS; k < deepest; ++k) {
            Colors source;
            VECTOR(ulong) fragment;
            load_rows(fragments, begin, step, count, k, &fragment);
            fetch_colors(&fragment, 1, colors, &source);
            blend_add(&tail, &source);
        }
#endif
    read_color(&front, resolved);
    if (AVERAGED) {
        Colors behind;
        read_color(&tail, &behind);
        weigh(count - kept, &behind);
        put_over(resolved, &behind);
    }
}

#include "frames/one_pass.h"
