// weighted-blended: one pass over the fragments in submission order, without sorting; not exact.
//
// McGuire and Bavoil (2013, "Weighted Blended Order-Independent Transparency", equation 6) weigh each fragment by how near
// it is, in place of sorting. Over a background C0, with weights wi:
//   C = sum(Ai Ci wi) / sum(Ai wi) (1 - R) + C0 R,   R = product of (1 - Ai)
// So coverage is that of all layers in order, and colours are a mean. The weights are one of their equations 7 to 10
// (WEIGHT), each of the form
//   w = A max(1/100, min(3000, f))
// 7 to 9 have the distance z in scene units. 10 has the window depth d, which is 0 at the near plane and 1 at the far one:
// f = 3000 (1 - d)^3.
//
// 1 - d is computed from the reversed depth (fragments/depth.h), of which it is a linear function. So nothing cancels out
// where d is close to 1.
//
//   parameters    1 - d as a + b depth: a, b; then z, which is c / depth in perspective and else c + e depth: c, e; then
//                 the scale of depths
#include "fragments/blending.h"
#include "fragments/colors.h"
#include "fragments/depth.h"

#define PARAMETERS 1

#ifndef WEIGHT
#define WEIGHT 10
#endif

// A sum of 16-bit floats may be infinite. Then it counts as the greatest number that they have, so that a mean stays one.
#define GREATEST 65504.0f

INLINE VECTOR(float) finite(VECTOR(float) sum) { return PRECISION == 1 ? MIN(sum, (VECTOR(float))(GREATEST)) : sum; }

INLINE VECTOR(float) squared(VECTOR(float) value) { return value * value; }

// The weight of fragments with these depths, less the factor A.
INLINE VECTOR(float) weight_of(VECTOR(float) depth, global const float *parameters)
{
#if WEIGHT == 10
    VECTOR(float) left = parameters[0] + parameters[1] * depth, weight = 3000.0f * left * squared(left);
#else
#if PERSPECTIVE
    VECTOR(float) z = parameters[2] / depth;
#else
    VECTOR(float) z = parameters[2] + parameters[3] * depth;
#endif
    VECTOR(float) far = squared(z * (1.0f / 200.0f)), third = z * 0.1f;
#if WEIGHT == 7
    VECTOR(float) weight = 10.0f / (1e-5f + squared(z * 0.2f) + far * far * far);
#elif WEIGHT == 8
    VECTOR(float) weight = 10.0f / (1e-5f + third * third * third + far * far * far);
#else
    VECTOR(float) weight = 0.03f / (1e-5f + far * far);
#endif
#endif
    weight = MIN(weight, (VECTOR(float))(3000.0f));
    return MAX(weight, (VECTOR(float))(0.01f));
}

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved,
                          global const float *parameters)
{
    const VECTOR(float) zero = (VECTOR(float))(0.0f);
    VECTOR(float) through = (VECTOR(float))(1.0f);
    uint deepest = largest(count);
    Colors buffer;
    clear_sums(&buffer);
    for (uint first = 0; first < deepest; first += ROWS) {
        VECTOR(ulong) rows[ROWS];
        Colors source[ROWS];
        load_rows(fragments, begin, step, count, first, rows);
        uint fetched = MIN(deepest - first, (uint)ROWS);
        fetch_colors(rows, fetched, colors, source);
        for (uint k = 0; k < fetched; ++k) {
            VECTOR(float) alpha = source[k].alpha;
            VECTOR(float) depth = depth_of(CONVERT(uint, STRIP, rows[k] >> (VECTOR(ulong))(32)), parameters[4]);
            through = KEPT(through * (1.0f - alpha));
            // Where there is no fragment, alpha is 0, and depth means nothing.
            source[k].alpha = alpha > zero ? alpha * (alpha * weight_of(depth, parameters)) : zero;
            blend_add(&buffer, source + k);
        }
    }
    Colors sums;
    read_color(&buffer, &sums);
    VECTOR(float) scale = sums.alpha > zero ? (1.0f - through) / finite(sums.alpha) : zero;
    resolved->red = finite(sums.red) * scale, resolved->green = finite(sums.green) * scale;
    resolved->blue = finite(sums.blue) * scale;
    resolved->alpha = through;
}

#include "frames/one_pass.h"
