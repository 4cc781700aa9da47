// The blend equations of the papers, as the hardware's fixed function would do them, for STRIP pixels at once.
#ifndef BLENDING_H
#define BLENDING_H

#include "common.h"

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

// Additive blending, both factors one, of a source whose colour is premultiplied:
//   Cdst = Cdst + Asrc Csrc,   Adst = Adst + Asrc.
INLINE void blend_add(Colors *destination, const Colors *source)
{
    destination->red += source->alpha * source->red;
    destination->green += source->alpha * source->green;
    destination->blue += source->alpha * source->blue;
    destination->alpha += source->alpha;
}

#endif
