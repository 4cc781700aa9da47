// layer-count: how many layers each pixel has, as a map.
//
// The host makes the picture of the map, as it knows the greatest number then. Here a pixel is covered, or it is not.
#define VALUES 1
#include "base/common.h"
#include "stages/composite.h"

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved,
                          global const float *parameters, Found *found)
{
    found->MEASURED = CONVERT(float, STRIP, count);
    found->COVERED = count > (VECTOR(uint))(0) ? (VECTOR(float))(1.0f) : (VECTOR(float))(0.0f);
    resolved->alpha = 1.0f - found->COVERED;
}

#include "frames/one_pass.h"
