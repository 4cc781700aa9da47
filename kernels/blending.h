// The blend equations of the papers, as the hardware's fixed function would do them.
#ifndef BLENDING_H
#define BLENDING_H

#include "common.h"

// Under blending (Bavoil and Myers 2008, "Under Blending"), front to back, with Adst = transmittance from 1:
//   Cdst = Adst (Asrc Csrc) + Cdst,   Adst = (1 - Asrc) Adst.
// Two variables, as each step waits for the last: a colour and transmittance in one vector would wait for its shuffles too.
// color.w has no meaning.
INLINE void blend_under(float4 *color, float *transmittance, float4 source)
{
    *color += *transmittance * (source.w * source);
    *transmittance *= 1.0f - source.w;
}

#endif
