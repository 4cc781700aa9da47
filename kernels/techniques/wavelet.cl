// wavelet: two passes over the fragments in submission order, without sorting; not exact.
//
// Aizenshtein, Smal and McGuire (2022, "Wavelet Transparency") add up absorbances (fragments/absorbance.h). What lies in
// front of a place x absorbs the sum A(x) of what fragments before x absorb, a function with a step at each fragment. It is
// kept as Haar wavelets of some levels (WAVELET_RANK): these are added up in the first pass. The second one computes for
// each fragment what A says of its place, and from that how much of the fragment is seen:
//   wi = Ai e^-A(xi),   C = sum(wi Ci) / sum(wi) (1 - R) + C0 R,   R = product of (1 - Ai)
// So coverage is exact, and colours are a mean.
//
// Levels 0 .. WAVELET_RANK resolve depths into CELLS equal cells. x counts cells, from 0 at the nearest depth to CELLS - 1
// at the farthest, so that the last cell has all that is absorbed. A step of height a at x has the mean a and a share of
// the wavelet number k of a level, which is W cells wide:
//   mean:      a (1 - x / CELLS)
//   wavelet:   a max(0, 1/2 - |x / W - (k + 1/2)|)
// A wavelet takes its share off the left half of its cells, and adds it to the right half. (The paper gives it a height of
// 2^(level / 2), and divides shares by as much. Here it has the height 1, so all factors are powers of two.) This gives the
// mean of A over each cell. In between, A is interpolated: it has the mean of a cell at that cell's far end. A fragment does
// not hide itself, so its own part of that is taken off again.
//
//   parameters    the depths at x = 0 and at x = CELLS - 1, unless they are those of each pixel (PIXEL_RANGE); the scale of
//                 depths (fragments/depth.h)
#ifndef WAVELET_RANK
#define WAVELET_RANK 3
#define PIXEL_RANGE 1
#define PERSPECTIVE 1
#endif
#include "fragments/absorbance.h"
#include "fragments/blending.h"
#include "fragments/colors.h"
#include "fragments/depth.h"

#define PARAMETERS 1

#define CELLS (2 << WAVELET_RANK)

// Absorbances beyond this count as this, so that the weight of no fragment is lost.
#define MOST_ABSORBED 60.0f

#define ZERO (VECTOR(float))(0.0f)

INLINE VECTOR(float) depths_of(VECTOR(ulong) fragments, float scale)
{
    return depth_of(CONVERT(uint, STRIP, fragments >> (VECTOR(ulong))(32)), scale);
}

// The depths of each pixel's nearest and farthest fragment.
INLINE void find_range(global const ulong *fragments, VECTOR(uint) begin, uint step, VECTOR(uint) count, float scale,
                       VECTOR(float) *nearest, VECTOR(float) *farthest)
{
    VECTOR(ulong) least = (VECTOR(ulong))(ABSENT), most = (VECTOR(ulong))(0ul);
    uint deepest = largest(count);
    for (uint first = 0; first < deepest; first += ROWS) {
        VECTOR(ulong) rows[ROWS];
        load_rows(fragments, begin, step, count, first, rows);
        for (uint k = 0; k < MIN(deepest - first, (uint)ROWS); ++k) {
            least = MIN(least, rows[k]);
            most = MAX(most, rows[k] == (VECTOR(ulong))(ABSENT) ? (VECTOR(ulong))(0ul) : rows[k]);
        }
    }
    *nearest = depths_of(least, scale), *farthest = depths_of(most, scale);
}

// Where depths lie between two others, in cells. In perspective depth is near / distance, and x is linear in the distance:
//   (1 / depth - 1 / nearest) / (1 / farthest - 1 / nearest) = (nearest - depth) / (nearest - farthest) farthest / depth.
INLINE VECTOR(float) place_of(VECTOR(float) depth, VECTOR(float) nearest, VECTOR(float) farthest)
{
    VECTOR(float) share = (nearest - depth) / (nearest - farthest);
#if PERSPECTIVE
    share *= farthest / depth;
#endif
    share = share > ZERO ? share : ZERO;  // which it is not either where all depths are equal
    return MIN(share, (VECTOR(float))(1.0f)) * (CELLS - 1);
}

// How much a level's wavelet number k has of a step of height 1. cells: how many a wavelet of the level is wide.
INLINE VECTOR(float) share_of(VECTOR(float) x, int cells, int k)
{
    VECTOR(float) off = x * (1.0f / cells) - (k + 0.5f);
    return MAX(0.5f - MAX(off, -off), ZERO);
}

// Adds a step of a strip's fragments. The mean is haar[0], and a level of `size` wavelets begins at haar[size].
INLINE void add_step(VECTOR(float) *haar, VECTOR(float) x, VECTOR(float) absorbance)
{
    haar[0] = KEPT(haar[0] + absorbance * (1.0f - x * (1.0f / CELLS)) * FULL);
    UNROLL for (int size = 1; size < CELLS; size *= 2)
        UNROLL for (int k = 0; k < size; ++k)
            haar[size + k] = KEPT(haar[size + k] + absorbance * share_of(x, CELLS / size, k) * FULL);
}

// Turns wavelets into the means of all cells, level by level. Each level makes two cells of one.
INLINE void means_of(VECTOR(float) *haar)
{
    UNROLL for (int at = 0; at < CELLS; ++at) haar[at] = read_channel(haar[at]);
    VECTOR(float) cells[CELLS];
    cells[0] = haar[0];
    UNROLL for (int size = 1; size < CELLS; size *= 2)
        UNROLL for (int k = size - 1; k >= 0; --k) {
            VECTOR(float) mean = cells[k], share = haar[size + k];
            cells[2 * k] = mean - share, cells[2 * k + 1] = mean + share;
        }
    UNROLL for (int at = 0; at < CELLS; ++at) haar[at] = cells[at];
}

// What absorbs light in front of fragments at these places, themselves left out.
INLINE VECTOR(float) absorbed_before(const VECTOR(float) *cells, VECTOR(float) x, VECTOR(float) own)
{
    VECTOR(float) sum = ZERO, past = x - CONVERT(float, STRIP, CONVERT(int, STRIP, x));
    UNROLL for (int k = 0; k < CELLS; ++k) {
        VECTOR(float) off = x - (k + 1.0f);
        sum += cells[k] * MAX(1.0f - MAX(off, -off), ZERO);
    }
    sum -= own * (past * (1.0f - past));
    return MIN(MAX(sum, ZERO), (VECTOR(float))(MOST_ABSORBED));
}

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved,
                          global const float *parameters)
{
    const float scale = parameters[2];
    VECTOR(float) nearest = (VECTOR(float))(parameters[0]), farthest = (VECTOR(float))(parameters[1]);
    VECTOR(float) haar[CELLS], left = (VECTOR(float))(1.0f);
    uint deepest = largest(count);
    Colors buffer;
    if (PIXEL_RANGE) find_range(fragments, begin, step, count, scale, &nearest, &farthest);
    clear_sums(&buffer);
    UNROLL for (int at = 0; at < CELLS; ++at) haar[at] = ZERO;
    for (int pass = 0; pass < 2; ++pass) {
        for (uint first = 0; first < deepest; first += ROWS) {
            VECTOR(ulong) rows[ROWS];
            Colors source[ROWS];
            load_rows(fragments, begin, step, count, first, rows);
            uint fetched = MIN(deepest - first, (uint)ROWS);
            fetch_colors(rows, fetched, colors, source);
            for (uint k = 0; k < fetched; ++k) {
                VECTOR(float) alpha = source[k].alpha, absorbance = absorbance_of(alpha);
                // Where there is no fragment, alpha is 0, and depth means nothing.
                VECTOR(float) x = place_of(depths_of(rows[k], scale), nearest, farthest);
                x = alpha > ZERO ? x : ZERO;
                if (pass == 0) {
                    left *= 1.0f - alpha;
                    add_step(haar, x, absorbance);
                } else {
                    source[k].alpha = alpha * through(absorbed_before(haar, x, absorbance));
                    blend_add(&buffer, source + k);
                }
            }
        }
        if (pass == 0) means_of(haar);
    }
    Colors sums;
    read_color(&buffer, &sums);
    VECTOR(float) mean = sums.alpha > ZERO ? (1.0f - left) / sums.alpha : ZERO;
    resolved->red = sums.red * mean, resolved->green = sums.green * mean, resolved->blue = sums.blue * mean;
    resolved->alpha = left;
}

#include "frames/one_pass.h"
