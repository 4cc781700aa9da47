// Composition: writes a tile of the finished layer (premultiplied colour C and transmittance T) to the rows of the
// picture.
//
// Over a background b a pixel becomes C + T b. Without one it becomes straight: colour C / (1 - T) and alpha 1 - T. A
// pixel of the picture is the mean of columns x rows samples of the layer. Both divide TILE, so these share a tile. In a
// gradient b differs from row to row of the picture. The host computes it (pictures/background.py), so that it has the
// same bits on every device.
//
// Where blending is LINEAR, all of this is linear light. What comes out of it is converted to sRGB last.
#ifndef COMPOSITE_H
#define COMPOSITE_H

#include "fragments/blending.h"
#include "shading/reals.h"

// Turns linear colours into sRGB, 0..1. scales: see srgb_by.
INLINE void show(Colors *colors, global const uint *scales)
{
    UNROLL for (int c = 0; c < 3; ++c) {
        VECTOR(float) *channel = &colors->red + c;
        *channel = MAX(*channel, (VECTOR(float))(0.0f)), *channel = MIN(*channel, (VECTOR(float))(1.0f));
        Reals *values = (Reals *)channel;
        UNROLL for (int k = 0; k < STRIP / SHADED; ++k) values[k] = srgb_by(scales, values[k]);
    }
}

INLINE VECTOR(uint) to_byte(VECTOR(float) value)
{
    value = value * 255.0f + 0.5f;
    value = MIN(value, (VECTOR(float))(255.0f));
    return CONVERT(uint, STRIP, CONVERT(int, STRIP, MAX(value, (VECTOR(float))(0.0f))));
}

#define CHANNEL(colors, name, place) (((local const float *)&(colors)[(place) / STRIP].name)[(place) % STRIP])

// How the samples of a tile are those of the picture's pixels: the base 2 logarithms of a pixel's columns and rows of
// samples, and of the tile's columns and rows of pixels.
typedef struct { uint columns, rows, across, down; } Sampling;

// side_bits: those of a pixel's columns, and of its rows from the 8th bit on.
INLINE Sampling sampling_of(int side_bits)
{
    uint columns = side_bits & 255, rows = side_bits >> 8;
    return (Sampling){columns, rows, TILE_BITS - columns, TILE_BITS - rows};
}

// Where sample k of the picture's pixel at this column and row of the tile is in the layer.
INLINE uint sample_of(uint column, uint row, uint k, const Sampling *s)
{
    return pixel_at((column << s->columns) + (k & ((1u << s->columns) - 1)), (row << s->rows) + (k >> s->columns));
}

// The mean of the samples of the picture's pixel at this column and row of the tile.
INLINE float4 mean_of(local const Colors *layer, uint column, uint row, const Sampling *s)
{
    float4 sum = (float4)(0.0f);
    uint count = 1u << (s->columns + s->rows);
    PLAIN_LOOP for (uint k = 0; k < count; ++k) {
        uint p = sample_of(column, row, k, s);
        sum += (float4)(CHANNEL(layer, red, p), CHANNEL(layer, green, p), CHANNEL(layer, blue, p), CHANNEL(layer, alpha, p));
    }
    return sum / (float)count;
}

// The means of a strip of the picture's pixels, from number q of the tile on. Four samples a pixel are added up side by side,
// in the same order: these pixels are those of a row of four blocks.
INLINE void means_of_strip(local const Colors *layer, uint q, const Sampling *s, Colors *means)
{
#if LANES == 1 && STRIP == 16
#define OF_BLOCKS(a, b, c, d)                                                                                   \
    ((float16)(v[0].a, v[0].b, v[1].a, v[1].b, v[2].a, v[2].b, v[3].a, v[3].b, v[0].c, v[0].d, v[1].c, v[1].d,   \
               v[2].c, v[2].d, v[3].c, v[3].d))
    if (s->columns == 1 && s->rows == 1) {
        local const Colors *blocks = layer + q / STRIP * BLOCKS_A_ROW;
        UNROLL for (uint c = 0; c < 4; ++c) {
            float16 v[BLOCKS_A_ROW];
            UNROLL for (uint k = 0; k < BLOCKS_A_ROW; ++k) v[k] = (&blocks[k].red)[c];
            float16 sum = 0.0f + OF_BLOCKS(s0, s2, s8, sa);
            sum += OF_BLOCKS(s1, s3, s9, sb), sum += OF_BLOCKS(s4, s6, sc, se), sum += OF_BLOCKS(s5, s7, sd, sf);
            (&means->red)[c] = sum * 0.25f;
        }
        return;
    }
#endif
    PLAIN_LOOP for (uint k = 0; k < STRIP; ++k) {
        float4 mean = mean_of(layer, (q + k) & ((1u << s->across) - 1), (q + k) >> s->across & ((1u << s->down) - 1), s);
        SET_ELEMENT(float, means->red, k, mean.x), SET_ELEMENT(float, means->green, k, mean.y);
        SET_ELEMENT(float, means->blue, k, mean.z), SET_ELEMENT(float, means->alpha, k, mean.w);
    }
}

// --- what a technique finds besides colours -------------------------------------------------------------------------
// BOUNDED: layers are skipped once the transmittance in front of them is parameters[0] or less. Then a technique also
// finds, for each sample, the most that the skipped layers could have changed in any channel: the transmittance in
// front of them.
#ifndef BOUNDED
#define BOUNDED 0
#endif
#if BOUNDED
#define VALUES 1
#endif
#ifndef VALUES
#define VALUES 0
#endif
#if VALUES
// What it finds for each sample of a strip: one number or four.
#if BOUNDED
typedef VECTOR(float) Found;
#define NOTHING (VECTOR(float))(0.0f)
#else
// Four numbers have the fields of Colors, so that means are taken in the same way. Techniques that make a map use them by
// these names: what is measured, whether that is doubtful, and whether there is anything.
typedef Colors Found;
#define MEASURED red
#define UNPAIRED green
#define COVERED blue
#define NOTHING {(VECTOR(float))(0.0f), (VECTOR(float))(0.0f), (VECTOR(float))(0.0f), (VECTOR(float))(0.0f)}
#endif

// Writes these to the picture's pixels, as means of their samples. width, height: of the picture, in samples.
INLINE void store_values(local const Found *found, uint tile, int columns, int side_bits, int width, int height,
                         global float *values)
{
    const Sampling sampling = sampling_of(side_bits), *s = &sampling;
    uint left = tile % (uint)columns << s->across, top = tile / (uint)columns << s->down;
    width >>= s->columns, height >>= s->rows;
    for (uint p = LANE_IN(tile); p < 1u << (s->across + s->down); p += LANES) {
        uint column = p & ((1u << s->across) - 1), row = p >> s->across;
        if (left + column >= (uint)width || top + row >= (uint)height) continue;
        size_t at = (size_t)(top + row) * width + left + column;
#if BOUNDED
        float sum = 0.0f;
        uint count = 1u << (s->columns + s->rows);
        for (uint k = 0; k < count; ++k) sum += ((local const float *)found)[sample_of(column, row, k, s)];
        values[at] = sum / (float)count;
#else
        ((global float4 *)values)[at] = mean_of(found, column, row, s);
#endif
    }
}
#endif

// --- to the picture -------------------------------------------------------------------------------------------------
// A block's row of pixels, anywhere in memory: vectors usually begin at multiples of their own size.
typedef uint4 RowBytes __attribute__((aligned(4)));
typedef float16 RowColors __attribute__((aligned(16)));

// The column and the row in its tile of pixel p of the picture: of a block where pixels are samples, else of the tile row
// by row.
INLINE uint2 place_in_tile(uint p, const Sampling *s)
{
    uint block = p / BLOCK_PIXELS;
    if (s->columns) return (uint2)(p & ((1u << s->across) - 1), p >> s->across);
    return (uint2)(block % BLOCKS_A_ROW * BLOCK + p % BLOCK, block / BLOCKS_A_ROW * BLOCK + p % BLOCK_PIXELS / BLOCK);
}

// tile: its number in the picture. layer: its strips. side_bits: see sampling_of. width, height: of the picture, in
// samples. background: red, green and blue of each row of the picture; of all rows if `gradient` is 0; NULL for straight
// alpha. scales: of sRGB (shading/reals.h), where blending is LINEAR. color: premultiplied colours and alpha without the
// background, or NULL if nobody wants them. Returns how many of
// the lane's pixels have a negative transmittance, so that their colours are clamped.
INLINE uint composite_tile(local const Colors *layer, uint tile, int columns, int side_bits, int width, int height,
                           global const float4 *background, int gradient, global const uint *scales, global uint *image, global float4 *color)
{
    const float4 first = background ? *background : (float4)(0.0f);
    const Sampling sampling = sampling_of(side_bits), *s = &sampling;
    uint clamped = 0, pixels = 1u << (s->across + s->down);
    uint left = tile % (uint)columns << s->across, top = tile / (uint)columns << s->down;
    width >>= s->columns, height >>= s->rows;
    bool whole = s->columns == 0 && left + TILE <= (uint)width && top + TILE <= (uint)height;
    for (uint q = LANE_IN(tile) * STRIP; q < pixels; q += LANES * STRIP) {
        // A strip of the picture's pixels: those of a block where pixels are samples, else those of the tile row by
        // row.
        Colors pixel;
        if (s->columns) means_of_strip(layer, q, s, &pixel);
        else pixel = layer[q / STRIP];
        VECTOR(float) alpha = 1.0f - pixel.alpha;
        VECTOR(float) red = (VECTOR(float))(first.x), green = (VECTOR(float))(first.y), blue = (VECTOR(float))(first.z);
        PLAIN_LOOP for (uint k = 0; gradient && k < STRIP; ++k) {
            float4 row = background[MIN(top + place_in_tile(q + k, s).y, (uint)height - 1)];
            SET_ELEMENT(float, red, k, row.x), SET_ELEMENT(float, green, k, row.y), SET_ELEMENT(float, blue, k, row.z);
        }
        Colors shown = {pixel.red + pixel.alpha * red, pixel.green + pixel.alpha * green, pixel.blue + pixel.alpha * blue,
                        (VECTOR(float))(1.0f)};
        Colors straight;
        if (LINEAR || !background) {
            VECTOR(int) some = alpha > (VECTOR(float))(0.0f);
            straight.red = some ? pixel.red / alpha : (VECTOR(float))(0.0f);
            straight.green = some ? pixel.green / alpha : (VECTOR(float))(0.0f);
            straight.blue = some ? pixel.blue / alpha : (VECTOR(float))(0.0f);
            straight.alpha = some ? alpha : (VECTOR(float))(0.0f);
        }
        if (!background) shown = straight;
#if LINEAR
        show(&shown, scales);
        if (color) {
            show(&straight, scales);
            pixel.red = alpha * straight.red, pixel.green = alpha * straight.green, pixel.blue = alpha * straight.blue;
        }
#endif
        VECTOR(uint) bytes = to_byte(shown.red) | to_byte(shown.green) << (VECTOR(uint))(8) |
                             to_byte(shown.blue) << (VECTOR(uint))(16) | to_byte(shown.alpha) << (VECTOR(uint))(24);
        VECTOR(int) below = PASTE(as_, VECTOR(int))(pixel.alpha) < (VECTOR(int))(0);  // or -0, over an opaque surface
#if STRIP % BLOCK == 0
        if (whole) {
            uint block = q / BLOCK_PIXELS, x = left + block % BLOCKS_A_ROW * BLOCK;
            uint y = top + block / BLOCKS_A_ROW * BLOCK + q % BLOCK_PIXELS / BLOCK;
            UNROLL for (uint k = 0; k < STRIP / BLOCK; ++k) {
                size_t at = (size_t)(y + k) * width + x;
                float4 r = ((const float4 *)&pixel.red)[k], g = ((const float4 *)&pixel.green)[k];
                float4 b = ((const float4 *)&pixel.blue)[k], a = ((const float4 *)&alpha)[k];
                *(global RowBytes *)(image + at) = ((const uint4 *)&bytes)[k];
                if (!color) continue;
                float16 row = (float16)(r.x, g.x, b.x, a.x, r.y, g.y, b.y, a.y, r.z, g.z, b.z, a.z, r.w, g.w, b.w, a.w);
                if ((size_t)(color + at) % sizeof(row) == 0) STORE_LINE((global float16 *)(color + at), row);
                else *(global RowColors *)(color + at) = row;
            }
            clamped += POPCOUNT(BITS_OF(below));
            continue;
        }
#endif
        PLAIN_LOOP for (uint k = 0; k < STRIP; ++k) {
            uint p = q + k;
            uint2 place = place_in_tile(p, s);
            uint x = left + place.x, y = top + place.y;
            if (p >= pixels || x >= (uint)width || y >= (uint)height) continue;
            size_t at = (size_t)y * width + x;
            image[at] = ELEMENT(uint, bytes, k);
            if (color)
                color[at] = (float4)(ELEMENT(float, pixel.red, k), ELEMENT(float, pixel.green, k),
                                     ELEMENT(float, pixel.blue, k), ELEMENT(float, alpha, k));
            clamped += ELEMENT(int, below, k) != 0;
        }
    }
    return clamped;
}

#endif
