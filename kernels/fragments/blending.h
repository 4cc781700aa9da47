// The blend equations of the papers, as the hardware's fixed function would compute them, for STRIP pixels at once.
#ifndef BLENDING_H
#define BLENDING_H

#include "base/common.h"

// Colours are blended into buffers of PRECISION (clpeel/techniques/precision.py). The result of each blend is rounded
// as it is stored:
//
//   0   float32
//   1   16-bit floats: to the nearest, halves to even; 65520 and more become infinity
//   2   8 bits, 255 steps from 0 to 1: times 255, plus one half, fraction dropped; clamped to 255
//
// FULL is the number that stands for 1 in a buffer. With 8 bits a buffer counts in steps of 1/255, because whole
// numbers and their halves are exact.
#ifndef PRECISION
#define PRECISION 0
#endif
#if PRECISION == 2
#define FULL 255.0f
#else
#define FULL 1.0f
#endif

// The colours of a strip, one pixel in each element. Where it is blended into, `alpha` is the transmittance left.
typedef struct { VECTOR(float) red, green, blue, alpha; } Colors;

// --- rounding to a buffer's precision -------------------------------------------------------------------------------
// What a buffer of 16-bit floats stores of a number that is not negative.
INLINE VECTOR(float) to_half(VECTOR(float) value)
{
    VECTOR(uint) bits = PASTE(as_, VECTOR(uint))(value);
    VECTOR(uint) even = (bits + (VECTOR(uint))(0xFFF) + (bits >> (VECTOR(uint))(13) & (VECTOR(uint))(1))) & (VECTOR(uint))(~0x1FFFu);
    VECTOR(float) rounded = PASTE(as_, VECTOR(float))(even);
    rounded = rounded >= (VECTOR(float))(65536.0f) ? (VECTOR(float))(INFINITY) : rounded;
    // Below 2^-14, 16-bit floats lie 2^-24 apart. So do float32 numbers from 0.5 to 1. So adding 0.5 rounds as needed.
    return value < (VECTOR(float))(0x1p-14f) ? (value + 0.5f) - 0.5f : rounded;
}

// What a buffer of 8 bits stores of a number that is not negative, both in steps of 1/255.
INLINE VECTOR(float) to_step(VECTOR(float) value)
{
    return CONVERT(float, STRIP, CONVERT(int, STRIP, MIN(value + 0.5f, (VECTOR(float))(255.0f))));
}

#if PRECISION == 1
#define KEPT(value) to_half(value)
#elif PRECISION == 2
#define KEPT(value) to_step(value)
#else
#define KEPT(value) (value)
#endif

// A buffer before anything is blended into it: nothing is there, and everything behind is seen. In a buffer for sums,
// alpha is a sum too, and begins at 0.
INLINE void clear_buffer(Colors *buffer)
{
    buffer->red = buffer->green = buffer->blue = (VECTOR(float))(0.0f);
    buffer->alpha = (VECTOR(float))(FULL);
}
// The same as numbers. The fields are set one by one: of an initializer that is mostly zeros, clang makes a fill and a
// store, and Mesa's rusticl loses the store (docs/drivers.md).
INLINE void clear_layer(Colors *layer)
{
    layer->red = layer->green = layer->blue = (VECTOR(float))(0.0f);
    layer->alpha = (VECTOR(float))(1.0f);
}
INLINE void clear_sums(Colors *buffer) { buffer->red = buffer->green = buffer->blue = buffer->alpha = (VECTOR(float))(0.0f); }

// Stores a colour, 0..1, as a buffer keeps it.
INLINE void store_color(Colors *buffer, const Colors *color)
{
    buffer->red = KEPT(color->red * FULL), buffer->green = KEPT(color->green * FULL);
    buffer->blue = KEPT(color->blue * FULL), buffer->alpha = KEPT(color->alpha * FULL);
}

// One channel of a buffer as a number 0..1, and all four channels.
INLINE VECTOR(float) read_channel(VECTOR(float) kept) { return PRECISION == 2 ? UNIT_OF(kept) : kept; }
INLINE void read_color(const Colors *buffer, Colors *color)
{
    color->red = read_channel(buffer->red), color->green = read_channel(buffer->green);
    color->blue = read_channel(buffer->blue), color->alpha = read_channel(buffer->alpha);
}

// --- blending -------------------------------------------------------------------------------------------------------
// Under blending, front to back (Bavoil and Myers 2008, "Under Blending"). Adst is the transmittance, at first 1:
//   Cdst = Adst (Asrc Csrc) + Cdst,   Adst = (1 - Asrc) Adst.
INLINE void blend_under(Colors *destination, const Colors *source)
{
    destination->red = KEPT(destination->red + destination->alpha * (source->alpha * source->red));
    destination->green = KEPT(destination->green + destination->alpha * (source->alpha * source->green));
    destination->blue = KEPT(destination->blue + destination->alpha * (source->alpha * source->blue));
    destination->alpha = KEPT(destination->alpha * (1.0f - source->alpha));
}

// After how many layers blending may stop: as many as one lane has in registers. It is the same for several lanes. Where
// an alpha is interpolated, it may exceed 1 by a rounding. Then the transmittance is less than zero, and one layer more
// changes a bit.
#define SEEN_EVERY 8

// Whether any pixel of a strip has more transmittance than `least_seen`.
INLINE bool is_seen(VECTOR(float) transmittance, float least_seen)
{
    bool seen = false;
    STRIP_LOOP for (int k = 0; k < STRIP; ++k) seen |= ((const float *)&transmittance)[k] > least_seen;
    return seen;
}

// Over blending, back to front (Bavoil and Myers 2008, first equation of "Under Blending"). Tdst is the transmittance:
//   Cdst = Asrc Csrc + (1 - Asrc) Cdst,   Tdst = (1 - Asrc) Tdst.
INLINE void blend_over(Colors *destination, const Colors *source)
{
    VECTOR(float) through = 1.0f - source->alpha;
    destination->red = KEPT(source->alpha * source->red * FULL + through * destination->red);
    destination->green = KEPT(source->alpha * source->green * FULL + through * destination->green);
    destination->blue = KEPT(source->alpha * source->blue * FULL + through * destination->blue);
    destination->alpha = KEPT(through * destination->alpha);
}

// Additive blending, both factors one, with a source whose colour is premultiplied:
//   Cdst = Cdst + Asrc Csrc,   Adst = Adst + Asrc.
INLINE void blend_add(Colors *destination, const Colors *source)
{
    destination->red = KEPT(destination->red + source->alpha * source->red * FULL);
    destination->green = KEPT(destination->green + source->alpha * source->green * FULL);
    destination->blue = KEPT(destination->blue + source->alpha * source->blue * FULL);
    destination->alpha = KEPT(destination->alpha + source->alpha * FULL);
}

// Puts a front layer over all that is behind it. Both are numbers, not buffers: premultiplied colour and transmittance.
INLINE void put_over(Colors *front, const Colors *behind)
{
    front->red += front->alpha * behind->red;
    front->green += front->alpha * behind->green;
    front->blue += front->alpha * behind->blue;
    front->alpha *= behind->alpha;
}

#endif
