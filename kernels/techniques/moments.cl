// moments: two passes over a pixel's fragments, without sorting; not exact.
//
// Muenstermann, Krumpen, Klein and Peters (2018, "Moment-Based Order-Independent Transparency") keep of all fragments a few
// moments: sums of their absorbances -ln(1 - Ai), times functions of their depths (equation 3). A second pass asks the
// moments how much absorbance lies in front of each fragment, and so how much of its light comes through (equation 2):
//   T(z) = e^(-b0 share(z)),   b0 = sum of -ln(1 - Ai)
//   C = sum(Ai T(zi) Ci) / sum(Ai T(zi)) (1 - e^-b0) + C0 e^-b0
// So coverage is exact, and colours are a mean. share() is in moments-power.h, and in moments-trigonometric.h.
//
// Moments are moved a little towards those of an even spread, by the paper's bias, so that rounding cannot make them those
// of nothing. Depths from the near plane to the far one become -1 to 1, by their logarithm in perspective (equation 11).
//
// Sums are exact (fragments/exact_sums.h), so they are the same in any order of fragments. T is divided by its greatest
// value. That cancels in C, and it keeps T from vanishing where there are many layers.
//
//   parameters    what depth_of needs; place = a + b x, where x is the depth, or in perspective -ln(c depth): a, b, c;
//                 overestimation; 1 - bias; bias times each moment of the even spread; where moments are quantized, what is
//                 added to each of them, and the matrices of odd and even ones there, and back
#include "fragments/blending.h"
#include "fragments/colors.h"
#include "fragments/depth.h"
#include "fragments/absorbance.h"
#include "fragments/exact_sums.h"

#define PARAMETERS 1

#ifndef MOMENTS
#define MOMENTS 4
#endif
#ifndef TRIGONOMETRIC
#define TRIGONOMETRIC 0
#endif
#ifndef QUANTIZED
#define QUANTIZED 0
#endif
#ifndef PERSPECTIVE
#define PERSPECTIVE 1
#endif

// How many masses the canonical representation has besides the one at a fragment's depth.
#define ORDER (MOMENTS / 2)
#define ROOTS ORDER
#include "fragments/roots.h"

#if TRIGONOMETRIC
#include "techniques/moments-trigonometric.h"
#else
#include "techniques/moments-power.h"
#endif

#define OVERESTIMATION 4
#define BIAS 5
#define QUANTIZATION (BIAS + 1 + MOMENTS)

// --- depths ---------------------------------------------------------------------------------------------------------
// -ln(x), x > 0; and 0 from 1 on. x = m 2^-e, with m from 1/2 to 1, of which 1 - m is exact.
INLINE VECTOR(float) minus_logarithm(VECTOR(float) x)
{
    VECTOR(int) bits = PASTE(as_, VECTOR(int))(x);
    VECTOR(float) e = CONVERT(float, STRIP, (VECTOR(int))(126) - (bits >> (VECTOR(int))(23)));
    VECTOR(int) mantissa = (bits & (VECTOR(int))(0x7FFFFF)) | (VECTOR(int))(0x3F000000);
    VECTOR(float) rest = absorbance_of(1.0f - PASTE(as_, VECTOR(float))(mantissa));
    return x < (VECTOR(float))(1.0f) ? e * LN2_HIGH + (e * LN2_LOW + rest) : (VECTOR(float))(0.0f);
}

// Where in -1 to 1 fragments lie.
INLINE VECTOR(float) place_of(VECTOR(ulong) fragment, global const float *parameters)
{
    VECTOR(float) depth = depth_of(CONVERT(uint, STRIP, fragment >> (VECTOR(ulong))(32)), parameters[0]);
    if (PERSPECTIVE) depth = minus_logarithm(parameters[3] * depth);
    VECTOR(float) place = parameters[1] + parameters[2] * depth;
    return MIN(MAX(place, (VECTOR(float))(-1.0f)), (VECTOR(float))(1.0f));
}

// --- moments --------------------------------------------------------------------------------------------------------
// What 16 bits keep of a number from 0 to 1.
INLINE VECTOR(float) to_16_bits(VECTOR(float) value)
{
    VECTOR(float) inside = MIN(MAX(value, (VECTOR(float))(0.0f)), (VECTOR(float))(1.0f));
    return CONVERT(float, STRIP, CONVERT(int, STRIP, inside * 65535.0f + 0.5f)) / 65535.0f;
}

#if QUANTIZED
#if TRIGONOMETRIC
INLINE void quantize(VECTOR(float) *b, global const float *numbers)
{
    UNROLL for (int k = 0; k < MOMENTS; ++k) b[k] = 2.0f * to_16_bits(0.5f * b[k] + 0.5f) - 1.0f;
}
#else
// Odd moments are b[0], b[2], ... and even ones b[1], b[3], ... Either are mixed by a matrix, so that they fill 0 to 1.
INLINE void quantize(VECTOR(float) *b, global const float *numbers)
{
    UNROLL for (int even = 0; even < 2; ++even) {
        global const float *there = numbers + MOMENTS + even * ORDER * ORDER, *back = there + 2 * ORDER * ORDER;
        VECTOR(float) kept[ORDER];
        UNROLL for (int i = 0; i < ORDER; ++i) {
            kept[i] = (VECTOR(float))(numbers[2 * i + even]);
            UNROLL for (int j = 0; j < ORDER; ++j) kept[i] += there[i * ORDER + j] * b[2 * j + even];
            kept[i] = to_16_bits(kept[i]) - numbers[2 * i + even];
        }
        UNROLL for (int i = 0; i < ORDER; ++i) {
            b[2 * i + even] = back[i * ORDER] * kept[0];
            UNROLL for (int j = 1; j < ORDER; ++j) b[2 * i + even] += back[i * ORDER + j] * kept[j];
        }
    }
}
#endif
#endif

// 1 - e^-x, for 0 and more. Where x is small, it is the series, as e^-x is next to 1.
INLINE VECTOR(float) covered_by(VECTOR(float) x)
{
    VECTOR(float) series = 1.0f - x * (1.0f / 7);
    series = 1.0f - x * (1.0f / 6) * series;
    series = 1.0f - x * (1.0f / 5) * series;
    series = 1.0f - x * (1.0f / 4) * series;
    series = 1.0f - x * (1.0f / 3) * series;
    series = 1.0f - x * 0.5f * series;
    return x < (VECTOR(float))(0.25f) ? x * series : 1.0f - through(x);
}

// The first pass: finds the total absorbance, what the moments say of it, and where the foremost fragment lies.
INLINE void find_moments(global const ulong *fragments, VECTOR(uint) begin, uint step, VECTOR(uint) count,
                         global const void *colors, global const float *parameters, VECTOR(float) *total, Curve *curve,
                         VECTOR(float) *foremost)
{
    const VECTOR(float) zero = (VECTOR(float))(0.0f), one = (VECTOR(float))(1.0f);
    VECTOR(float) steps = steps_for(count);
    VECTOR(long) sums[MOMENTS + 1];
    UNROLL for (int k = 0; k <= MOMENTS; ++k) sums[k] = (VECTOR(long))(0);
    *foremost = one;
    uint deepest = largest(count);
    for (uint first = 0; first < deepest; first += ROWS) {
        VECTOR(ulong) rows[ROWS];
        Colors source[ROWS];
        load_rows(fragments, begin, step, count, first, rows);
        uint fetched = MIN(deepest - first, (uint)ROWS);
        fetch_colors(rows, fetched, colors, source);
        for (uint k = 0; k < fetched; ++k) {
            VECTOR(float) power[MOMENTS], alpha = source[k].alpha, absorbance = absorbance_of(alpha);
            VECTOR(int) some = alpha > zero;  // where there is no fragment, alpha is 0, and depth means nothing
            VECTOR(float) place = some ? place_of(rows[k], parameters) : one;
            absorbance = some ? absorbance : zero;
            *foremost = MIN(*foremost, place);
            powers_of(place, power);
            add_exactly(sums, absorbance, steps);
            UNROLL for (int m = 0; m < MOMENTS; ++m) add_exactly(sums + 1 + m, absorbance * power[m], steps);
        }
    }
    VECTOR(float) b[MOMENTS], sum = sum_of(sums[0], steps);
    *total = sum;
    UNROLL for (int k = 0; k < MOMENTS; ++k) b[k] = quotient(sum_of(sums[k + 1], steps), sum);
#if QUANTIZED
    quantize(b, parameters + QUANTIZATION);
#endif
    UNROLL for (int k = 0; k < MOMENTS; ++k) b[k] = b[k] * parameters[BIAS] + parameters[BIAS + 1 + k];
    find_curve(b, curve);
}

// The least share of absorbance in front of any fragment. Power moments have it at the foremost one. Of trigonometric ones
// it may be anywhere, as a mass in the wrapping zone counts for all.
INLINE VECTOR(float) least_share(global const ulong *fragments, VECTOR(uint) begin, uint step, VECTOR(uint) count,
                                 global const void *colors, global const float *parameters, const Curve *curve,
                                 VECTOR(float) foremost)
{
#if TRIGONOMETRIC
    VECTOR(float) least = (VECTOR(float))(1.0f);
    uint deepest = largest(count);
    for (uint first = 0; first < deepest; first += ROWS) {
        VECTOR(ulong) rows[ROWS];
        Colors source[ROWS];
        load_rows(fragments, begin, step, count, first, rows);
        uint fetched = MIN(deepest - first, (uint)ROWS);
        fetch_colors(rows, fetched, colors, source);
        for (uint k = 0; k < fetched; ++k) {
            VECTOR(float) share = share_before(curve, place_of(rows[k], parameters), parameters[OVERESTIMATION]);
            least = source[k].alpha > (VECTOR(float))(0.0f) ? MIN(least, share) : least;
        }
    }
    return least;
#else
    return share_before(curve, foremost, parameters[OVERESTIMATION]);
#endif
}

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved,
                          global const float *parameters)
{
    const VECTOR(float) zero = (VECTOR(float))(0.0f);
    VECTOR(float) total, foremost;
    Curve curve;
    find_moments(fragments, begin, step, count, colors, parameters, &total, &curve, &foremost);
    VECTOR(float) least = least_share(fragments, begin, step, count, colors, parameters, &curve, foremost);
    uint deepest = largest(count);
#if PRECISION
    Colors buffer;
    clear_sums(&buffer);
#else
    VECTOR(float) steps = steps_for(count);
    VECTOR(long) red = (VECTOR(long))(0), green = red, blue = red, weight = red;
#endif
    for (uint first = 0; first < deepest; first += ROWS) {
        VECTOR(ulong) rows[ROWS];
        Colors source[ROWS];
        load_rows(fragments, begin, step, count, first, rows);
        uint fetched = MIN(deepest - first, (uint)ROWS);
        fetch_colors(rows, fetched, colors, source);
        for (uint k = 0; k < fetched; ++k) {
            VECTOR(float) alpha = source[k].alpha;
            VECTOR(float) share = share_before(&curve, place_of(rows[k], parameters), parameters[OVERESTIMATION]);
            VECTOR(float) behind = total * MAX(share - least, zero);
            source[k].alpha = alpha > zero ? alpha * through(behind) : zero;
#if PRECISION
            blend_add(&buffer, source + k);
#else
            add_exactly(&red, source[k].alpha * source[k].red, steps);
            add_exactly(&green, source[k].alpha * source[k].green, steps);
            add_exactly(&blue, source[k].alpha * source[k].blue, steps);
            add_exactly(&weight, source[k].alpha, steps);
#endif
        }
    }
    Colors sums;
#if PRECISION
    read_color(&buffer, &sums);
#else
    sums.red = sum_of(red, steps), sums.green = sum_of(green, steps);
    sums.blue = sum_of(blue, steps), sums.alpha = sum_of(weight, steps);
#endif
    VECTOR(float) scale = quotient(covered_by(total), sums.alpha);
    resolved->red = sums.red * scale, resolved->green = sums.green * scale, resolved->blue = sums.blue * scale;
    resolved->alpha = through(total);
}

#include "frames/one_pass.h"
