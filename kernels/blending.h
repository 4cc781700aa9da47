// The blend equations of the papers, as the hardware's fixed function would do them.
#ifndef BLENDING_H
#define BLENDING_H

#include "common.h"

// Under blending (Bavoil and Myers 2008, "Under Blending"), front to back, with Adst = transmittance in .w from 1:
//   Cdst = Adst (Asrc Csrc) + Cdst,   Adst = (1 - Asrc) Adst.
INLINE float4 blend_under(float4 destination, float4 source)
{
    float3 color = destination.xyz + destination.w * (source.w * source.xyz);
    return (float4)(color, (1.0f - source.w) * destination.w);
}

#endif
