// Averaging: a pixel's layers as if all were alike, of the average colour and alpha (techniques/weighted-average.cl).
//
// Where A is small, float32 loses the coverage 1 - (1 - A)^n, because 1 - A rounds to one. So the power is computed as
// a pair of floats, by squaring, which gives the same bits on every device. Colours are the sums times coverage /
// sum(Ai). This factor is one where there is one fragment, and is used only where sum(Ai) is not zero.
#ifndef AVERAGING_H
#define AVERAGING_H

#include "fragments/blending.h"
#include "base/wide.h"

typedef struct { VECTOR(float) high, low; } Parts;  // an unevaluated sum

// Multiplies a by b (Dekker 1971), to about 46 bits.
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

// Makes a finished layer of the sums of `count` fragments. `resolved` comes as sum(Ai Ci) and sum(Ai), and leaves as
// premultiplied colour and transmittance.
INLINE void weigh(VECTOR(uint) count, Colors *resolved)
{
    // The paper's buffer also counts the fragments. In 16-bit floats it counts to 2048, as one more is rounded away. In
    // 8 bits it counts steps, to 255.
    VECTOR(uint) n = PRECISION ? MIN(count, (VECTOR(uint))(PRECISION == 1 ? 2048 : 255)) : count;
    VECTOR(float) sum = resolved->alpha;
    VECTOR(int) some = sum != (VECTOR(float))(0.0f);
    Parts power;
    through_all(some ? sum / CONVERT(float, STRIP, n) : (VECTOR(float))(0.0f), n, &power);
    VECTOR(float) scale = some ? ((1.0f - power.high) - power.low) / sum : (VECTOR(float))(0.0f);
    resolved->red *= scale, resolved->green *= scale, resolved->blue *= scale;
    resolved->alpha = power.high + power.low;
}

#endif
