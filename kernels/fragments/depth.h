// Depths as buffers keep them: unsigned keys whose ascending order is front to back, and back again.
//
// What rasterization gives is reversed depth (larger is nearer): near / distance, or (far - distance) / (far - near) in
// parallel projection. DEPTH_FORMAT says what is kept of it (layout.py, DEPTH_FORMATS):
//
//   FLOAT32_REVERSED   that number, as it is
//   FLOAT32            OpenGL's window depth z, 0 at the near plane .. 1 at the far one, a float
//   UNORM24            the nearest of 2^24 - 1 steps of z
//   RGBA8              four bytes of z, each what the one before leaves of it ("a false color whose 4 bytes represents in some
//                      form the depth", GlowScript): 2^-32 of z
//
// z = scale (1 - reversed depth), scale = far / (far - near), or 1 in parallel projection. Keys of z are one more than it, as
// nothing may be as near as the key 0 (peeling.h); what the planes' margins leave outside of 0..1 is clamped.
#ifndef DEPTH_H
#define DEPTH_H

#include "base/common.h"

// The usual monotone map of floats, complemented: -0.0 and negative values keep their place. (The sign bit, less one, is all
// ones for what is not negative.)
INLINE VECTOR(uint) depth_key(VECTOR(float) depth, float scale)
{
#if DEPTH_FORMAT == FLOAT32_REVERSED
    VECTOR(uint) bits = PASTE(as_, VECTOR(uint))(depth);
    return bits ^ (((bits >> (VECTOR(uint))(31u)) - (VECTOR(uint))(1u)) & (VECTOR(uint))(0x7FFFFFFFu));
#else
    VECTOR(float) z = (1.0f - depth) * scale;
    z = z > (VECTOR(float))(0.0f) ? z : (VECTOR(float))(0.0f);
    z = MIN(z, (VECTOR(float))(1.0f));
#if DEPTH_FORMAT == FLOAT32
    VECTOR(uint) kept = PASTE(as_, VECTOR(uint))(z);
#elif DEPTH_FORMAT == UNORM24
    VECTOR(float) steps = z * 16777215.0f;
    VECTOR(int) below = CONVERT(int, STRIP, steps);
    VECTOR(uint) kept = PASTE(as_, VECTOR(uint))(below - (steps - CONVERT(float, STRIP, below) >= (VECTOR(float))(0.5f)));
#else
    // Two bytes, then two of what these leave; the last but one of 2^32 for 1.
    VECTOR(float) high = z * 65536.0f, low;
    VECTOR(int) first = CONVERT(int, STRIP, high);
    low = (high - CONVERT(float, STRIP, first)) * 65536.0f;
    VECTOR(uint) bytes = PASTE(as_, VECTOR(uint))(first << (VECTOR(int))(16) | CONVERT(int, STRIP, low));
    VECTOR(uint) kept = z < (VECTOR(float))(1.0f) ? bytes : (VECTOR(uint))(0xFFFFFFFDu);
#endif
    return kept + (VECTOR(uint))(1u);
#endif
}

// The reversed depth of a key; where z may have lost all of it, 2^-40, so that distances are finite.
INLINE VECTOR(float) depth_of(VECTOR(uint) key, float scale)
{
#if DEPTH_FORMAT == FLOAT32_REVERSED
    VECTOR(int) negative = (key & (VECTOR(uint))(0x80000000u)) != (VECTOR(uint))(0u);
    return PASTE(as_, VECTOR(float))(negative ? key : ~key & (VECTOR(uint))(0x7FFFFFFFu));
#else
    key -= (VECTOR(uint))(1u);
#if DEPTH_FORMAT == FLOAT32
    VECTOR(float) z = PASTE(as_, VECTOR(float))(key);
#elif DEPTH_FORMAT == UNORM24
    VECTOR(float) z = CONVERT(float, STRIP, PASTE(as_, VECTOR(int))(key)) / 16777215.0f;
#else
    VECTOR(float) z = CONVERT(float, STRIP, PASTE(as_, VECTOR(int))(key >> (VECTOR(uint))(16u))) * 0x1p-16f;
    z += CONVERT(float, STRIP, PASTE(as_, VECTOR(int))(key & (VECTOR(uint))(0xFFFFu))) * 0x1p-32f;
#endif
    return MAX(1.0f - z / scale, (VECTOR(float))(0x1p-40f));
#endif
}

#endif
