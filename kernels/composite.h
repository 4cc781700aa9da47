// Composition: a tile of a layer (premultiplied colour and transmittance) to the picture's rows.
//
// Over a background: C + T b. Without one: straight alpha, C / (1 - T) and 1 - T.
// A picture pixel is the mean of `side` x `side` samples of the layer; side divides TILE, so they share a tile.
#ifndef COMPOSITE_H
#define COMPOSITE_H

#include "common.h"

INLINE uchar4 to_bytes(float4 color)
{
    color = color * 255.0f + 0.5f;
    color = MIN(color, (float4)(255.0f));
    return CONVERT(uchar, 4, CONVERT(int, 4, MAX(color, (float4)(0.0f))));
}

// tile: of the picture. Returns how many of this lane's pixels let less than nothing through: their colours are clamped.
INLINE uint composite_tile(local const float4 *layer, uint tile, int columns, int side_bits, int width, int height,
                           float4 background, int keep_color, global uchar4 *image, global float4 *color)
{
    uint bits = TILE_BITS - side_bits, side = 1u << side_bits, clamped = 0;
    for (uint q = get_local_id(0); q < 1u << 2 * bits; q += LANES) {
        uint column = q & ((1u << bits) - 1), row = q >> bits;  // in the tile, in pixels of the picture
        uint x = (tile % (uint)columns << bits) + column, y = (tile / (uint)columns << bits) + row;
        if (x >= (uint)width || y >= (uint)height) continue;
        float4 pixel = layer[pixel_at(column * side, row * side)];
        if (side > 1) {
            pixel = (float4)(0.0f);
            for (uint k = 0; k < side * side; ++k)
                pixel += layer[pixel_at(column * side + k % side, row * side + k / side)];
            pixel /= (float)(side * side);
        }
        size_t at = (size_t)y * width + x;
        float alpha = 1.0f - pixel.w;
        clamped += pixel.w < 0.0f;
        if (keep_color) color[at] = (float4)(pixel.xyz, alpha);
        if (background.w != 0.0f) pixel = (float4)(pixel.xyz + pixel.w * background.xyz, 1.0f);
        else pixel = alpha > 0.0f ? (float4)(pixel.xyz / alpha, alpha) : (float4)(0.0f);
        image[at] = to_bytes(pixel);
    }
    return clamped;
}

#endif
