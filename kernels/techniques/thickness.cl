// thickness: how far the ray of each pixel runs through the scene, as a map (thickness.h).
//
// The picture is made of the map by the host, which knows its range then; here a pixel is covered, or it is not.
#include "base/common.h"
#include "fragments/blending.h"

INLINE void shown(const Colors *foremost, VECTOR(float) thickness, global const float *parameters, Colors *resolved)
{
    resolved->red = resolved->green = resolved->blue = resolved->alpha = (VECTOR(float))(0.0f);
}

#include "techniques/thickness.h"
