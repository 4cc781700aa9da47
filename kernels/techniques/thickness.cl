// thickness: how far the ray of each pixel runs through the scene, as a map (techniques/thickness.h).
//
// The host makes the picture from the map, because only then the range of lengths is known. Here pixels are only marked
// as covered or not.
#include "base/common.h"
#include "fragments/blending.h"

INLINE void shown(const Colors *foremost, VECTOR(float) thickness, global const float *parameters, Colors *resolved)
{
    resolved->red = resolved->green = resolved->blue = resolved->alpha = (VECTOR(float))(0.0f);
}

#include "techniques/thickness.h"
