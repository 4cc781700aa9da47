// The picture where nothing is drawn.
//
//   clear        one work-group a tile
#include "composite.h"

kernel void clear(uint first_tile, int columns, int side_bits, int width, int height, uint empty, int keep_color,
                  global uint *image, global float4 *color)
{
    uint tile = first_tile + get_group_id(0);
    FOR_EACH_PIXEL {
        size_t at = (size_t)y * width + x;
        image[at] = empty;
        if (keep_color) color[at] = (float4)(0.0f);
    }
}
