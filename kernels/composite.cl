// Composition: a layer (premultiplied colour and transmittance, in tile order) to the picture's rows.
//
//   composite    one work-group a tile
//   clear        the same where nothing was drawn
//
// Over a background: C + T b. Without one: straight alpha, C / (1 - T) and 1 - T.
// A picture pixel is the mean of `side` x `side` samples of the layer; side divides TILE, so they share a tile.
#include "common.h"

INLINE uchar4 to_bytes(float4 color)
{
    color = color * 255.0f + 0.5f;
    color = MIN(color, (float4)(255.0f));
    return CONVERT(uchar, 4, CONVERT(int, 4, MAX(color, (float4)(0.0f))));
}

kernel void composite(global const float4 *layer, uint first_tile, int columns, int side, int width, int height,
                      float red, float green, float blue, int has_background, int keep_color,
                      global uchar4 *image, global float4 *color)
{
    uint tile = get_group_id(0);
    int block = TILE / side;
    int block_x = (int)((first_tile + tile) % columns) * block, block_y = (int)((first_tile + tile) / columns) * block;
    for (int q = get_local_id(0); q < block * block; q += LANES) {
        int x = block_x + q % block, y = block_y + q / block;
        if (x >= width || y >= height) continue;
        int column = q % block * side, row = q / block * side;
        global const float4 *samples = layer + tile * TILE_PIXELS;
        float4 pixel = samples[pixel_at(column, row)];
        if (side > 1) {
            pixel = (float4)(0.0f);
            for (int k = 0; k < side * side; ++k) pixel += samples[pixel_at(column + k % side, row + k / side)];
            pixel /= (float)(side * side);
        }
        size_t at = (size_t)y * width + x;
        float alpha = 1.0f - pixel.w;
        if (keep_color) color[at] = (float4)(pixel.xyz, alpha);
        if (has_background) pixel = (float4)(pixel.xyz + pixel.w * (float3)(red, green, blue), 1.0f);
        else pixel = alpha > 0.0f ? (float4)(pixel.xyz / alpha, alpha) : (float4)(0.0f);
        image[at] = to_bytes(pixel);
    }
}

kernel void clear(uint first_tile, int columns, int side, int width, int height, uint empty, int keep_color,
                  global uint *image, global float4 *color)
{
    uint tile = first_tile + get_group_id(0);
    int block = TILE / side, block_x = (int)(tile % columns) * block, block_y = (int)(tile / columns) * block;
    for (int q = get_local_id(0); q < block * block; q += LANES) {
        int x = block_x + q % block, y = block_y + q / block;
        if (x >= width || y >= height) continue;
        size_t at = (size_t)y * width + x;
        image[at] = empty;
        if (keep_color) color[at] = (float4)(0.0f);
    }
}
