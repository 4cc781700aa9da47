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
#include "fragments/absorbance.h"
#include "fragments/blending.h"

// What is seen in one channel: reflected light, and light from behind.
INLINE VECTOR(float) seen_in(VECTOR(float) color, VECTOR(float) reflectance, VECTOR(float) from_behind)
{
    VECTOR(float) reflected = reflectance * color;
    return reflected + (1.0f - reflected) * color * from_behind;
}

// parameters: extinction for each unit of thickness; the light's red, green and blue; reflectance.
INLINE void shown(const Colors *foremost, VECTOR(float) thickness, global const float *parameters, Colors *resolved)
{
    VECTOR(float) lit = through(parameters[0] * thickness);
    VECTOR(float) reflectance = parameters[4] * (HEADLIGHT ? foremost->alpha : (VECTOR(float))(1.0f));
    resolved->red = seen_in(foremost->red, reflectance, parameters[1] * lit);
    resolved->green = seen_in(foremost->green, reflectance, parameters[2] * lit);
    resolved->blue = seen_in(foremost->blue, reflectance, parameters[3] * lit);
    resolved->alpha = (VECTOR(float))(0.0f);
    store_color(resolved, resolved);
    read_color(resolved, resolved);
}

#include "techniques/thickness.h"
