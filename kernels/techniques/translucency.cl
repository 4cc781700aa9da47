// translucency: a light behind the scene, which is seen where the scene is thin (techniques/thickness.h).
//
// S is the colour of the foremost fragment, L the camera's light on it (1 where unlit), and F what its surface
// reflects:
//   F = reflectance S L
//   C = F + (1 - F) light S exp(-extinction thickness)
// Light that a surface reflects does not pass it, so C never leaves 0..1. Where there is anything, it hides the
// background.
#define LIGHT_IN_ALPHA 1
#include "base/common.h"
#include "fragments/blending.h"

// exp(-x) for x >= 0, as  2^-n exp(-r)  with n = x / ln 2, rounded, and r = x - n ln 2 within +-0.35. ln 2 is given in
// two parts. The first has 16 bits, so that its product with n is exact. The eighth term of the series is below 2^-27
// of the sum.
INLINE VECTOR(float) exp_negative(VECTOR(float) x)
{
    x = MIN(x, (VECTOR(float))(128.0f));
    VECTOR(float) n = (x * 0x1.715476p+0f + 0x1.8p23f) - 0x1.8p23f;  // adding 1.5 * 2^23 rounds to whole numbers
    VECTOR(float) r = n * 0x1.62e4p-1f - x;
    r += n * 0x1.7f7d1cp-20f;
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

// What is seen in one channel: reflected light, and light from behind.
INLINE VECTOR(float) seen_in(VECTOR(float) color, VECTOR(float) reflectance, VECTOR(float) from_behind)
{
    VECTOR(float) reflected = reflectance * color;
    return reflected + (1.0f - reflected) * color * from_behind;
}

// parameters: extinction for each unit of thickness; the light's red, green and blue; reflectance.
INLINE void shown(const Colors *foremost, VECTOR(float) thickness, global const float *parameters, Colors *resolved)
{
    VECTOR(float) through = exp_negative(parameters[0] * thickness);
    VECTOR(float) reflectance = parameters[4] * (HEADLIGHT ? foremost->alpha : (VECTOR(float))(1.0f));
    resolved->red = seen_in(foremost->red, reflectance, parameters[1] * through);
    resolved->green = seen_in(foremost->green, reflectance, parameters[2] * through);
    resolved->blue = seen_in(foremost->blue, reflectance, parameters[3] * through);
    resolved->alpha = (VECTOR(float))(0.0f);
    store_color(resolved, resolved);
    read_color(resolved, resolved);
}

#include "techniques/thickness.h"
