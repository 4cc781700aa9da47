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
#include "fragments/sums.h"
#include "base/wide.h"

typedef struct { VECTOR(float) high, low; } Parts;  // an unevaluated sum

// The product (Dekker 1971): about 46 bits.
INLINE void multiply(Parts *a, const Parts *b)
{
    VECTOR(float) p = a->high * b->high, e;
    UNROLL for (int k = 0; k < STRIP; ++k)
        ((float *)&e)[k] = FMA1(((const float *)&a->high)[k], ((const float *)&b->high)[k], -((const float *)&p)[k]);
    e += a->high * b->low + a->low * b->high;
    a->high = p + e;
    a->low = e - (a->high - p);
}

// (1 - alpha)^n, 0 <= alpha <= 1.
INLINE void through_all(VECTOR(float) alpha, VECTOR(uint) n, Parts *power)
{
    Parts base = {1.0f - alpha, (1.0f - (1.0f - alpha)) - alpha};  // exact
    power->high = (VECTOR(float))(1.0f), power->low = (VECTOR(float))(0.0f);
    while (largest(n)) {
        Parts taken = *power;
        multiply(&taken, &base);
        VECTOR(int) odd = PASTE(as_, VECTOR(int))(n & (VECTOR(uint))(1)) == (VECTOR(int))(1);
        power->high = odd ? taken.high : power->high, power->low = odd ? taken.low : power->low;
        n >>= (VECTOR(uint))(1);
        Parts same = base;
        multiply(&base, &same);
    }
}

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved)
{
    add_up(fragments, begin, step, count, colors, resolved);
    // A buffer of 16-bit floats counts to 2048: one more is rounded away. One of 8 bits counts its steps, to 255.
    VECTOR(uint) n = PRECISION ? MIN(count, (VECTOR(uint))(PRECISION == 1 ? 2048 : 255)) : count;
    VECTOR(float) sum = resolved->alpha;
    VECTOR(int) some = sum != (VECTOR(float))(0.0f);
    Parts power;
    through_all(some ? sum / CONVERT(float, STRIP, n) : (VECTOR(float))(0.0f), n, &power);
    VECTOR(float) scale = some ? ((1.0f - power.high) - power.low) / sum : (VECTOR(float))(0.0f);
    resolved->red *= scale, resolved->green *= scale, resolved->blue *= scale;
    resolved->alpha = power.high + power.low;
}

#include "frames/one_pass.h"
