// Absorbance: the logarithm of what is absorbed. Where transmittances are multiplied, absorbances are added, so their sum
// does not ask for an order.
//
//   absorbance = -ln(1 - alpha),   1 - alpha = e^-absorbance
//
// Both functions are made of + - * / and of fixed polynomials, so that every device gives the same bits. A device's own
// exp and log differ from one to the next.
#ifndef ABSORBANCE_H
#define ABSORBANCE_H

#include "base/common.h"

// ln 2 in two parts. The first has 16 bits, so its product with a small whole number is exact.
#define LN2_HIGH 0x1.62e4p-1f
#define LN2_LOW 0x1.7f7d1cp-20f

// What absorbances take an opaque surface to let through, as -ln 0 is infinite: less than a step of 16 bits shows.
#ifndef LEAST_THROUGH
#define LEAST_THROUGH 0x1p-17f
#endif

// -ln(1 - alpha), 0 <= alpha; at most -ln(LEAST_THROUGH). The relative error is below 2^-21, for the least alphas too.
//
// 1 - alpha is u + lost, where u is rounded, and u = m 2^-n, with m from sqrt(1/2) to sqrt(2). Then
//   -ln(u + lost) = n ln 2 - ln m - lost / u,
// as lost is at most 2^-25. With f = m - 1 and s = f / (2 + f), ln m = 2 artanh s = f - s (f - r), and r is the series
// 2/3 s^2 + 2/5 s^4 + ... Its fifth term would be below 2^-28 of ln m.
INLINE VECTOR(float) absorbance_of(VECTOR(float) alpha)
{
    VECTOR(float) u = 1.0f - alpha, lost = (1.0f - u) - alpha;
    VECTOR(int) clear = u > (VECTOR(float))(LEAST_THROUGH);
    u = clear ? u : (VECTOR(float))(LEAST_THROUGH), lost = clear ? lost : (VECTOR(float))(0.0f);
    VECTOR(int) bits = PASTE(as_, VECTOR(int))(u);
    VECTOR(int) power = (bits - (VECTOR(int))(0x3F3504F3)) >> (VECTOR(int))(23);  // sqrt(1/2) as a float's bits
    VECTOR(float) n = -CONVERT(float, STRIP, power);
    VECTOR(float) f = PASTE(as_, VECTOR(float))(bits - (power << (VECTOR(int))(23))) - 1.0f;
    VECTOR(float) s = f / (2.0f + f), square = s * s;
    VECTOR(float) r = square * (2.0f / 9) + (2.0f / 7);
    r = r * square + (2.0f / 5);
    r = r * square + (2.0f / 3);
    VECTOR(float) rest = s * (f - r * square) - f;
    return n * LN2_HIGH + (rest + (n * LN2_LOW - lost / u));
}

// e^-absorbance, for 0 and more: 2^-n e^-r, with n = absorbance / ln 2, rounded, and r = absorbance - n ln 2 within +-0.35.
// The eighth term of the series is below 2^-27 of the sum. From 2^-126 on the result is 0.
INLINE VECTOR(float) through(VECTOR(float) absorbance)
{
    VECTOR(float) x = MIN(absorbance, (VECTOR(float))(128.0f));
    VECTOR(float) n = (x * 0x1.715476p+0f + 0x1.8p23f) - 0x1.8p23f;  // adding 1.5 * 2^23 rounds to whole numbers
    VECTOR(float) r = n * LN2_HIGH - x;
    r += n * LN2_LOW;
    VECTOR(float) sum = r * (1.0f / 5040) + (1.0f / 720);
    sum = sum * r + (1.0f / 120);
    sum = sum * r + (1.0f / 24);
    sum = sum * r + (1.0f / 6);
    sum = sum * r + 0.5f;
    sum = sum * r + 1.0f;
    sum = sum * r + 1.0f;
    VECTOR(int) exponent = (VECTOR(int))(127) - CONVERT(int, STRIP, n);
    VECTOR(float) scale = PASTE(as_, VECTOR(float))(exponent << (VECTOR(int))(23));
    return exponent > (VECTOR(int))(0) ? sum * scale : (VECTOR(float))(0.0f);
}

#endif
