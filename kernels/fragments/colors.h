// Where a fragment's colour comes from.
//
//   palette          the scene's colours, 4 bytes or 4 floats each: one for all, or one for each face or vertex
//   FRAGMENT_COLOR   colours vary over a face: each fragment has a colour of its own, and its payload says where it is
//   otherwise        the payload is the face, whose colour is in the palette
#ifndef SHADING_H
#define SHADING_H

#include "fragments/blending.h"

#define ABSENT (~0ul)  // a place without a fragment; as an integer it is behind every fragment

// How many rows of fragments are in registers at once. A lane that works alone has vectors for eight. Several lanes wait
// for memory in turns, and the fewer registers each takes, the more of them there can be.
#if LANES == 1
#define ROWS 8
#else
#define ROWS 1
#endif

// A colour of the palette, straight, 0..1.
INLINE float4 palette_color(global const void *palette, uint index)
{
#if PACKED_COLOR
    float4 bytes = CONVERT(float, 4, ((global const uchar4 *)palette)[index]);
    return UNIT_OF(bytes);
#else
    return ((global const float4 *)palette)[index];
#endif
}

// The colour of one fragment, straight, 0..1. colors: the fragments' own colours, or the palette.
INLINE float4 fragment_color(global const void *colors, uint payload)
{
    if (FRAGMENT_COLOR) return ((global const float4 *)colors)[payload];
    return palette_color(colors, COLOR_RATE_FACE ? payload : 0);
}

// --- fragments of a strip -------------------------------------------------------------------------------------------
// Eight fragments, anywhere in memory: vectors usually begin at multiples of their own size.
typedef ulong8 Octet __attribute__((aligned(8)));

#if STRIP == 16 && ROWS == 8
// Loads eight fragments of each pixel, and turns lists into rows: a transposition of 8 x 8 in three steps, by halves,
// pairs and single ones. Up to seven fragments beyond a list are read, and ignored later. Buffers have room for that
// (FRAGMENT_PADDING). Pixels without fragments read the first ones there are.
#define TURN_1(a, b)                                                                                            \
    {                                                                                                           \
        ulong8 low = (ulong8)(a.s0, b.s0, a.s2, b.s2, a.s4, b.s4, a.s6, b.s6);                                  \
        b = (ulong8)(a.s1, b.s1, a.s3, b.s3, a.s5, b.s5, a.s7, b.s7), a = low;                                  \
    }
#define TURN_2(a, b)                                                                                            \
    {                                                                                                           \
        ulong8 low = (ulong8)(a.s01, b.s01, a.s45, b.s45);                                                      \
        b = (ulong8)(a.s23, b.s23, a.s67, b.s67), a = low;                                                      \
    }
#define TURN_4(a, b)                                                                                            \
    {                                                                                                           \
        ulong8 low = (ulong8)(a.lo, b.lo);                                                                      \
        b = (ulong8)(a.hi, b.hi), a = low;                                                                      \
    }
INLINE void load_from_lists(global const ulong *fragments, VECTOR(uint) begin, VECTOR(uint) count, VECTOR(ulong) *rows)
{
    ulong8 list[STRIP];
    VECTOR(uint) at = count > (VECTOR(uint))(0) ? begin : (VECTOR(uint))(0);
    UNROLL for (int k = 0; k < STRIP; ++k) list[k] = *(global const Octet *)(fragments + ((const uint *)&at)[k]);
    UNROLL for (int side = 0; side < STRIP; side += 8) {
        ulong8 *l = list + side;
        UNROLL for (int k = 0; k < 4; ++k) TURN_4(l[k], l[k + 4])
        UNROLL for (int k = 0; k < 8; k += 4) { TURN_2(l[k], l[k + 2]) TURN_2(l[k + 1], l[k + 3]) }
        UNROLL for (int k = 0; k < 8; k += 2) TURN_1(l[k], l[k + 1])
    }
    UNROLL for (int k = 0; k < 8; ++k) rows[k] = (VECTOR(ulong))(list[k], list[k + 8]);
}
#else
INLINE void load_from_lists(global const ulong *fragments, VECTOR(uint) begin, VECTOR(uint) count, VECTOR(ulong) *rows)
{
    STRIP_LOOP for (uint k = 0; k < STRIP * ROWS; ++k) {
        uint pixel = k % STRIP, row = k / STRIP;
        if (row < ((const uint *)&count)[pixel]) ((ulong *)rows)[k] = fragments[((const uint *)&begin)[pixel] + row];
    }
}
#endif

// Loads ROWS rows of a strip's fragments: those of each pixel from number `first` on, and ABSENT behind its last one.
// The fragments of pixel k begin at begin[k] and lie `step` apart: 1 in lists, STRIP in rows (stages/walk.h).
INLINE void load_rows(global const ulong *fragments, VECTOR(uint) begin, uint step, VECTOR(uint) count, uint first,
                      VECTOR(ulong) *rows)
{
    // Signed, which is possible as counts are below 2^24. Optimizers turn the unsigned form into an operation that not
    // every driver has (Oclgrind has not).
    VECTOR(int) behind = PASTE(as_, VECTOR(int))(count) - (VECTOR(int))((int)first);
    VECTOR(uint) left = PASTE(as_, VECTOR(uint))(MAX(behind, (VECTOR(int))(0)));
    if (step == STRIP) {
        global const VECTOR(ulong) *from = (global const VECTOR(ulong) *)(fragments + begin.s0) + first;
        UNROLL for (int row = 0; row < ROWS; ++row) rows[row] = from[row];
    } else
        load_from_lists(fragments, begin + first, left, rows);
    UNROLL for (uint row = 0; row < ROWS; ++row)
        rows[row] = WIDER(left > (VECTOR(uint))(row)) ? rows[row] : (VECTOR(ulong))(ABSENT);
}

// The colours of rows of fragments, one row of `fetched` for each. ABSENT fragments get alpha 0. `colors` has the
// fragments' own colours, or is the palette where they have none.
INLINE void fetch_colors(const VECTOR(ulong) *fragments, uint row_count, global const void *colors, Colors *fetched)
{
#if PACKED_COLOR && !FRAGMENT_COLOR
    for (uint row = 0; row < row_count; ++row) {
        const VECTOR(uint) byte = (VECTOR(uint))(0xFF);
        VECTOR(uint) payload = CONVERT(uint, STRIP, fragments[row]);
        VECTOR(int) present = payload != (VECTOR(uint))((uint)ABSENT);
        if (!COLOR_RATE_FACE) payload = (VECTOR(uint))(0);
        VECTOR(uint) word = gather((global const uint *)colors, payload, present);
        fetched[row].red = UNIT_OF(CONVERT(float, STRIP, word & byte));
        fetched[row].green = UNIT_OF(CONVERT(float, STRIP, word >> (VECTOR(uint))(8) & byte));
        fetched[row].blue = UNIT_OF(CONVERT(float, STRIP, word >> (VECTOR(uint))(16) & byte));
        fetched[row].alpha = UNIT_OF(CONVERT(float, STRIP, word >> (VECTOR(uint))(24)));
    }
#elif LANES == 1 && STRIP % 4 == 0
    // Four pixels at a time: a transposition of 4 x 4.
    for (uint row = 0; row < row_count; ++row) {
        VECTOR(uint) payload = CONVERT(uint, STRIP, fragments[row]);
        VECTOR(int) present = payload != (VECTOR(uint))((uint)ABSENT);
        VECTOR(uint) place = FRAGMENT_COLOR || COLOR_RATE_FACE ? payload & PASTE(as_, VECTOR(uint))(present) : (VECTOR(uint))(0);
        Colors found;
        UNROLL for (uint k = 0; k < STRIP / 4; ++k) {
            uint4 at = ((const uint4 *)&place)[k];
            global const float4 *from = (global const float4 *)colors;
            float4 a = from[at.x], b = from[at.y], c = from[at.z], d = from[at.w];
            TRANSPOSE(a, b, c, d)
            ((float4 *)&found.red)[k] = a, ((float4 *)&found.green)[k] = b;
            ((float4 *)&found.blue)[k] = c, ((float4 *)&found.alpha)[k] = d;
        }
        const VECTOR(float) zero = (VECTOR(float))(0.0f);
        fetched[row].red = present ? found.red : zero, fetched[row].green = present ? found.green : zero;
        fetched[row].blue = present ? found.blue : zero, fetched[row].alpha = present ? found.alpha : zero;
    }
#else
#if LANES == 1
    for (uint k = 0; k < row_count * STRIP; ++k) {
#else
    UNROLL for (uint k = 0; k < STRIP; ++k) {  // one row
#endif
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
