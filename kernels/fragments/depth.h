// Depths as buffers keep them: unsigned keys, 32 bits, that grow from front to back; and depths back from keys.
//
// Rasterization gives reversed depths, where larger is nearer: near / distance, or (far - distance) / (far - near) in
// parallel projection. DEPTH_FORMAT says what is kept of them (clpeel/device/layout.py, DEPTH_FORMATS):
//
//   FLOAT32_REVERSED   that number, as it is
//   FLOAT32            OpenGL's window depth z, from 0 at the near plane to 1 at the far plane, as a float
//   UNORM24            z in the nearest of 2^24 - 1 steps
//   RGBA8              z in four bytes, each of what the byte before leaves, so in steps of 2^-32 ("a false color whose
//                      4 bytes represents in some form the depth", GlowScript)
//
// z = scale (1 - reversed depth), with scale = far / (far - near), or 1 in parallel projection. The clipping planes
// have margins, so z can lie slightly outside of 0..1, and is clamped. A key is one more than what is kept of z. So no
// fragment has the key 0, which peeling uses for "in front of all" (fragments/comparing.h).
#ifndef DEPTH_H
#define DEPTH_H

#include "base/common.h"

// The usual monotone map from floats to integers, complemented: the bits of negative values and of -0.0 stay as they
// are, those of the others are inverted below the sign bit. The sign bit less one is the mask for that: all ones where
// it is 0.
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
    // The upper two bytes, then two of what they leave. 1 gets a number just above the others, so that neither its key
    // nor one more exceeds FARTHEST_KEY (fragments/comparing.h).
    VECTOR(float) high = z * 65536.0f, low;
    VECTOR(int) first = CONVERT(int, STRIP, high);
    low = (high - CONVERT(float, STRIP, first)) * 65536.0f;
    VECTOR(uint) bytes = PASTE(as_, VECTOR(uint))(first << (VECTOR(int))(16) | CONVERT(int, STRIP, low));
    VECTOR(uint) kept = z < (VECTOR(float))(1.0f) ? bytes : (VECTOR(uint))(0xFFFFFFFDu);
#endif
    return kept + (VECTOR(uint))(1u);
#endif
}

// The reversed depth of a key. Where the rounding of z leaves nothing of it, 2^-40 is returned, so that distances are
// finite.
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
