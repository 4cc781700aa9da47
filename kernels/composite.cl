// Composition: a layer (premultiplied colour and transmittance, in tile order) to the picture's rows.
//
//   composite    one work-group a tile
//
// Over a background: C + T b. Without one: straight alpha, C / (1 - T) and 1 - T.
#include "common.h"

INLINE uchar4 to_bytes(float4 color)
{
    color = color * 255.0f + 0.5f;
    color = MIN(color, (float4)(255.0f));
    return CONVERT(uchar, 4, CONVERT(int, 4, MAX(color, (float4)(0.0f))));
}

kernel void composite(global const float4 *layer, uint first_tile, int columns, int width, int height,
                      uint first_pixel, uint last_pixel, float red, float green, float blue, int has_background,
                      int keep_color, global uchar4 *image, global float4 *color)
{
    uint tile = get_group_id(0);
    int tile_x = (int)((first_tile + tile) % columns) * TILE, tile_y = (int)((first_tile + tile) / columns) * TILE;
    for (uint p = first_pixel + get_local_id(0); p <= last_pixel; p += LANES) {
        int x = tile_x + (int)(p % TILE), y = tile_y + (int)(p / TILE);
        if (x >= width || y >= height) continue;
        size_t at = (size_t)y * width + x;
        float4 pixel = layer[tile * TILE_PIXELS + p];
        float alpha = 1.0f - pixel.w;
        if (keep_color) color[at] = (float4)(pixel.xyz, alpha);
        if (has_background) pixel = (float4)(pixel.xyz + pixel.w * (float3)(red, green, blue), 1.0f);
        else pixel = alpha > 0.0f ? (float4)(pixel.xyz / alpha, alpha) : (float4)(0.0f);
        image[at] = to_bytes(pixel);
    }
}
