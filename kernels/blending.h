// The blend equations of the papers, as the hardware's fixed function would do them, for STRIP pixels at once.
#ifndef BLENDING_H
#define BLENDING_H

#include "common.h"

#ifndef HALF_SUMS
#define HALF_SUMS 0
#endif

// Colours side by side, a pixel an element. As what is blended into, `alpha` is the transmittance that is left.
typedef struct { VECTOR(float) red, green, blue, alpha; } Colors;

// Under blending (Bavoil and Myers 2008, "Under Blending"), front to back, with Adst = transmittance from 1:
//   Cdst = Adst (Asrc Csrc) + Cdst,   Adst = (1 - Asrc) Adst.
INLINE void blend_under(Colors *destination, const Colors *source)
{
    destination->red += destination->alpha * (source->alpha * source->red);
    destination->green += destination->alpha * (source->alpha * source->green);
    destination->blue += destination->alpha * (source->alpha * source->blue);
    destination->alpha *= 1.0f - source->alpha;
}

// Over blending (Bavoil and Myers 2008, "Under Blending", its first equation), back to front:
//   Cdst = Asrc Csrc + (1 - Asrc) Cdst,   and what is left of the light from behind: Tdst = (1 - Asrc) Tdst.
INLINE void blend_over(Colors *destination, const Colors *source)
{
    VECTOR(float) through = 1.0f - source->alpha;
    destination->red = source->alpha * source->red + through * destination->red;
    destination->green = source->alpha * source->green + through * destination->green;
    destination->blue = source->alpha * source->blue + through * destination->blue;
    destination->alpha *= through;
}

// The same of all that is behind at once, both premultiplied, with the transmittance of either.
INLINE void put_over(Colors *front, const Colors *behind)
{
    front->red += front->alpha * behind->red;
    front->green += front->alpha * behind->green;
    front->blue += front->alpha * behind->blue;
    front->alpha *= behind->alpha;
}

// What a buffer of 16-bit floats keeps of a number that is not negative: the nearest, halves to even; beyond 65504 infinity.
INLINE VECTOR(float) to_half(VECTOR(float) value)
{
    VECTOR(uint) bits = PASTE(as_, VECTOR(uint))(value);
    VECTOR(uint) even = (bits + (VECTOR(uint))(0xFFF) + (bits >> (VECTOR(uint))(13) & (VECTOR(uint))(1))) & (VECTOR(uint))(~0x1FFFu);
    VECTOR(float) rounded = PASTE(as_, VECTOR(float))(even);
    rounded = rounded >= (VECTOR(float))(65536.0f) ? (VECTOR(float))(INFINITY) : rounded;
    // Below 2^-14 they lie 2^-24 apart, as floats do from 0.5 on.
    return value < (VECTOR(float))(0x1p-14f) ? (value + 0.5f) - 0.5f : rounded;
}

// Additive blending, both factors one, of a source whose colour is premultiplied:
//   Cdst = Cdst + Asrc Csrc,   Adst = Adst + Asrc
// into a buffer of floats, or, with HALF_SUMS, of 16-bit floats, rounded at each sum.
#if HALF_SUMS
#define KEPT(sum) to_half(sum)
#else
#define KEPT(sum) (sum)
#endif
INLINE void blend_add(Colors *destination, const Colors *source)
{
    destination->red = KEPT(destination->red + source->alpha * source->red);
    destination->green = KEPT(destination->green + source->alpha * source->green);
    destination->blue = KEPT(destination->blue + source->alpha * source->blue);
    destination->alpha = KEPT(destination->alpha + source->alpha);
}

#endif
