// weighted-average: one pass over the fragments in the order they come, no sorting, not exact.
//
// Bavoil and Myers (2008, "Weighted Average"): all n fragments of a pixel are taken to have the average colour, weighted by
// alpha, and the average alpha,
//   C = sum(Ai Ci) / sum(Ai),   A = sum(Ai) / n,
// and n such layers over a background C0 are
//   C A (1 - (1 - A)^n) / A + C0 (1 - A)^n.
// The coverage 1 - (1 - A)^n is what float32 loses where A is small: 1 - A rounds to one. So the power is taken of a pair of
// floats, by squaring, which has the same bits on every device; and colours are the sums times coverage / sum(Ai), which is
// one where there is one fragment, and asked for only where sum(Ai) is not zero.
#include "sums.h"
#include "wide.h"

// The product of two unevaluated sums x + y of floats, |y| small beside |x| (Dekker 1971): about 46 bits.
INLINE float2 product(float2 a, float2 b)
{
    float p = a.x * b.x, e = FMA1(a.x, b.x, -p) + (a.x * b.y + a.y * b.x), s = p + e;
    return (float2)(s, e - (s - p));
}

// (1 - alpha)^n: its nearest float, and 1 minus it.
INLINE float2 through_all(float alpha, uint n)
{
    float2 power = (float2)(1.0f, 0.0f), base = (float2)(1.0f - alpha, 0.0f);
    base.y = (1.0f - base.x) - alpha;  // exact, as 0 <= alpha <= 1
    for (; n; n >>= 1, base = product(base, base))
        if (n & 1) power = product(power, base);
    return (float2)(power.x + power.y, (1.0f - power.x) - power.y);
}

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved)
{
    add_up(fragments, begin, step, count, colors, resolved);
    for (int k = 0; k < STRIP; ++k) {
        // A buffer of 16-bit floats counts to 2048: one more is rounded away.
        uint n = ((const uint *)&count)[k];
        if (HALF_SUMS) n = MIN(n, 2048u);
        float sum = ((const float *)&resolved->alpha)[k], scale = 0.0f, through = 1.0f;
        if (sum != 0.0f) {
            float2 both = through_all(sum / (float)n, n);
            through = both.x, scale = both.y / sum;
        }
        ((float *)&resolved->red)[k] *= scale, ((float *)&resolved->green)[k] *= scale;
        ((float *)&resolved->blue)[k] *= scale, ((float *)&resolved->alpha)[k] = through;
    }
}

#include "draw.h"
