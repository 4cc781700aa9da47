// layer-count: how many layers each pixel has, as a map.
//
// The host makes the picture of the map, as it knows the greatest number then. Here a pixel is covered, or it is not.
#define VALUES 1
#include "base/common.h"
#include "stages/composite.h"

// found: the number of layers, 0, and whether there is any.
INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved,
                          global const float *parameters, Found *found)
{
    found->red = CONVERT(float, STRIP, count);
    found->blue = count > (VECTOR(uint))(0) ? (VECTOR(float))(1.0f) : (VECTOR(float))(0.0f);
    resolved->alpha = 1.0f - found->blue;
}

#include "frames/one_pass.h"
