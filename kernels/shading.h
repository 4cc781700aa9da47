// Where a fragment's colour comes from.
//
//   palette          colours as given: one for the scene, for each face or for each vertex; 4 bytes or 4 floats each
//   FRAGMENT_COLOR   colours vary over a face: each fragment has its own, in `colors`, and its payload says where
//   otherwise        the payload is the face, whose colour is in the palette
#ifndef SHADING_H
#define SHADING_H

#include "blending.h"

#define ABSENT (~0ul)  // a place without a fragment: behind every fragment there is
#define FETCH_ROWS 16

INLINE float4 palette_color(global const void *palette, uint index)
{
#if PACKED_COLOR
    float4 bytes = CONVERT(float, 4, ((global const uchar4 *)palette)[index]);
    return UNIT_OF(bytes);
#else
    return ((global const float4 *)palette)[index];
#endif
}

// The next `row_count` of each of a strip's pixels' fragments, from number `first` on; ABSENT behind a pixel's last.
INLINE void load_rows(global const ulong *fragments, VECTOR(uint) begin, VECTOR(uint) count, uint first, uint row_count,
                      VECTOR(ulong) *rows)
{
    for (int k = 0; k < STRIP; ++k) {
        global const ulong *from = fragments + ((const uint *)&begin)[k];
        uint size = ((const uint *)&count)[k], held = size > first ? MIN(size - first, row_count) : 0;
        SCALAR_LOOP
        for (uint row = 0; row < held; ++row) ((ulong *)(rows + row))[k] = from[first + row];
        SCALAR_LOOP
        for (uint row = held; row < row_count; ++row) ((ulong *)(rows + row))[k] = ABSENT;
    }
}

// The colours of a strip's next fragments, a row of `fetched` for each row of fragments; ABSENT ones have alpha 0.
// `colors` is the fragments' own colours, or the palette where they have none.
INLINE void fetch_colors(const VECTOR(ulong) *fragments, uint row_count, global const void *colors, Colors *fetched)
{
#if PACKED_COLOR && !FRAGMENT_COLOR
    for (uint row = 0; row < row_count; ++row) {
        const VECTOR(uint) byte = (VECTOR(uint))(0xFF);
        VECTOR(uint) payload = CONVERT(uint, STRIP, fragments[row]);
        VECTOR(int) present = payload != (VECTOR(uint))((uint)ABSENT);
        if (!COLOR_RATE_FACE) payload = (VECTOR(uint))(0);
        VECTOR(uint) word = gather_uint((global const uint *)colors, payload, present, (VECTOR(uint))(0));
        fetched[row].red = UNIT_OF(CONVERT(float, STRIP, word & byte));
        fetched[row].green = UNIT_OF(CONVERT(float, STRIP, word >> (VECTOR(uint))(8) & byte));
        fetched[row].blue = UNIT_OF(CONVERT(float, STRIP, word >> (VECTOR(uint))(16) & byte));
        fetched[row].alpha = UNIT_OF(CONVERT(float, STRIP, word >> (VECTOR(uint))(24)));
    }
#else
    for (uint k = 0; k < row_count * STRIP; ++k) {
        uint payload = (uint)((const ulong *)fragments)[k];
        float4 color = (float4)(0.0f);
        if (payload != (uint)ABSENT)
            color = ((global const float4 *)colors)[FRAGMENT_COLOR || COLOR_RATE_FACE ? payload : 0];
        float *elements = (float *)(fetched + k / STRIP) + k % STRIP;
        elements[0] = color.x, elements[STRIP] = color.y, elements[2 * STRIP] = color.z, elements[3 * STRIP] = color.w;
    }
#endif
}

#endif
