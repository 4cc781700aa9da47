// Where a fragment's colour comes from.
//
//   palette          colours as given: one for the scene, for each face or for each vertex; 4 bytes or 4 floats each
//   FRAGMENT_COLOR   colours vary over a face: each fragment has its own, in `colors`, and its payload says where
//   otherwise        the payload is the packed colour itself, or the place in the palette
#ifndef SHADING_H
#define SHADING_H

#include "common.h"

INLINE float4 palette_color(global const void *palette, uint index)
{
#if PACKED_COLOR
    return unpack_color(((global const uint *)palette)[index]);
#else
    return ((global const float4 *)palette)[index];
#endif
}

INLINE uint face_payload(global const void *palette, uint source)
{
    uint index = COLOR_RATE_FACE ? source : 0;
#if PACKED_COLOR
    return ((global const uint *)palette)[index];
#else
    return index;
#endif
}

// `colors` is the fragments' own colours, or the palette where they have none.
INLINE float4 fragment_color(uint payload, global const float4 *colors)
{
#if PACKED_COLOR && !FRAGMENT_COLOR
    return unpack_color(payload);
#else
    return colors[payload];
#endif
}

#endif
