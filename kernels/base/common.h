// What every kernel includes: arithmetic that gives the same bits on every device, vectors of pixels, and the sample
// grid.
#ifndef COMMON_H
#define COMMON_H

// Without this a compiler may round a * b + c once or twice, as it likes.
#pragma OPENCL FP_CONTRACT OFF

// --- what every compiler inlines --------------------------------------------------------------------------------
// A CPU driver's builtins may be calls that are never inlined (PoCL's from PyPI are). They also keep loops from being
// vectorized. Plain operators, and the compiler's own intrinsics where it has them, give the same bits without that.
#ifndef __has_builtin
#define __has_builtin(name) 0
#endif
#define PASTE_(a, b) a##b
#define PASTE(a, b) PASTE_(a, b)
#if defined(__x86_64__) || defined(__aarch64__)
#define CPU_TARGET 1
#define INLINE static inline __attribute__((always_inline))
#else
#define CPU_TARGET 0
#define INLINE static inline
#endif
#define UNROLL _Pragma("unroll")
#define PLAIN_LOOP _Pragma("clang loop vectorize(disable) unroll(disable)")
#define MIN(a, b) ((a) < (b) ? (a) : (b))
#define MAX(a, b) ((a) > (b) ? (a) : (b))
#if __has_builtin(__builtin_convertvector)
#define CONVERT(type, count, value) __builtin_convertvector(value, PASTE(type, count))
#else
#define CONVERT(type, count, value) PASTE(convert_, PASTE(type, count))(value)
#endif

// How a technique is executed: see frames/peeling.h.
#ifndef PASSES
#define PASSES 0
#endif

// --- lanes ------------------------------------------------------------------------------------------------------
// A lane that has a tile to itself waits for nobody, so it needs no barriers. Compilers take half the time then: a
// kernel without barriers is one region of code, and OUTLINE functions are compiled apart from it. OUTLINE is for what
// runs once a strip, a tile or 16 records, where a call costs nothing.
#if LANES == 1
#define LANE 0
#define BARRIER
#else
#define LANE ((int)get_local_id(0))
#define BARRIER barrier(CLK_LOCAL_MEM_FENCE)
#endif
#if LANES == 1 && CPU_TARGET
#define OUTLINE static __attribute__((noinline))
#else
#define OUTLINE INLINE
#endif

// UNIFORM: a number that all lanes of a group have alike, such as their tile. A compiler cannot know this of a number from
// local memory. AMD's keeps it, and all that is loaded with it, once for all lanes, in registers of their own.
#if LANES > 1 && __has_builtin(__builtin_amdgcn_readfirstlane)
#define UNIFORM(number) (uint)__builtin_amdgcn_readfirstlane((int)(number))
#else
#define UNIFORM(number) (number)
#endif

// KEPT_MEMORY: where what a lane knows of its strips is kept until its tile is done. A lane that works alone has it in private
// memory. Several lanes use local memory, which has the strips of all of them, so that their registers are free for what
// changes. Strip `own` of a lane is number own * LANES + lane in both.
#if LANES == 1
#define KEPT_MEMORY
#define KEPT_STRIPS STRIPS_A_LANE
#else
#define KEPT_MEMORY local
#define KEPT_STRIPS (TILE_PIXELS / STRIP)
#endif

// LANE_IN: the same as LANE, for a walk of tile after tile. Tile numbers are below 2^31, so it is LANE. But a compiler
// does not know that. Else it would compute all that follows from the lane before the first tile, and keep it in
// registers to the last.
#if LANES == 1
#define LANE_IN(tile) 0
#else
#define LANE_IN(tile) (LANE ^ (int)((tile) >> 31))
#endif

// Lists name records that lie far apart in memory. PREFETCH asks for one some places ahead, so that it arrives in time.
// It pays where a lane works alone. A GPU turns to other lanes while one waits.
#if LANES == 1 && CPU_TARGET && __has_builtin(__builtin_prefetch)
#define PREFETCH(address) __builtin_prefetch((const void *)(size_t)(address))
#else
#define PREFETCH(address)
#endif

INLINE float3 load3(global const float *array, uint index)
{
    return (float3)(array[3 * index], array[3 * index + 1], array[3 * index + 2]);
}

INLINE uint3 load_face(global const uint *faces, uint index)
{
    return (uint3)(faces[3 * index], faces[3 * index + 1], faces[3 * index + 2]);
}

// --- the pixels of a tile -----------------------------------------------------------------------------------------
// Pixels are numbered block by block, as triangles cover them:  pixel = 16 block + 4 (row in the block) + column in the
// block.
INLINE uint pixel_at(uint column, uint row)
{
    return (row / BLOCK * BLOCKS_A_ROW + column / BLOCK) * BLOCK_PIXELS + row % BLOCK * BLOCK + column % BLOCK;
}

// --- vectors of STRIP pixels, consecutive ones of a block -----------------------------------------------------------
#define VECTOR(type) PASTE(type, STRIP)
#if STRIP == 16
#define IOTA 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15
#elif STRIP == 8
#define IOTA 0, 1, 2, 3, 4, 5, 6, 7
#elif STRIP == 4
#define IOTA 0, 1, 2, 3
#elif STRIP == 2
#define IOTA 0, 1
#endif

// Which elements are -1 rather than 0, as bits: bit k for element k.
INLINE uint bits_of2(int2 truth) { return (uint)(truth.x & 1) | (uint)(truth.y & 2); }
INLINE uint bits_of4(int4 truth)
{
    int4 bit = truth & (int4)(1, 2, 4, 8);
    int2 either = bit.lo | bit.hi;
    return (uint)(either.x | either.y);
}
INLINE uint bits_of8(int8 truth) { return bits_of4(truth.lo) | bits_of4(truth.hi) << 4; }
INLINE uint bits_of16(int16 truth)
{
#if defined(__AVX512F__) && __has_builtin(__builtin_ia32_cmpd512_mask)
    return (ushort)__builtin_ia32_cmpd512_mask(truth, (int16)(0), 4, -1);  // the mask of "not equal"
#elif defined(__AVX__) && __has_builtin(__builtin_ia32_movmskps256)
    float16 signs = as_float16(truth);
    return (uint)__builtin_ia32_movmskps256(signs.lo) | (uint)__builtin_ia32_movmskps256(signs.hi) << 8;
#else
    int16 bit = truth & (int16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768);
    int8 a = bit.lo | bit.hi;
    int4 b = a.lo | a.hi;
    int2 c = b.lo | b.hi;
    return (uint)(c.x | c.y);
#endif
}
#define BITS_OF(truth) PASTE(bits_of, STRIP)(truth)

// The reverse: -1 where the bit of an element is set, else 0. It is made of shifts. Optimizers may
// put a constant in place of a comparison, and Oclgrind 21.10 then takes a constant that is true for 1 in place of -1.
#define MASK_OF(bits) \
    ((PASTE(as_, VECTOR(int))((VECTOR(uint))(bits) << ((VECTOR(uint))(31) - (VECTOR(uint))(IOTA)))) >> (VECTOR(int))(31))

// The bits of a strip's elements from number `from` to number `to`. Both may lie outside of the strip.
INLINE uint bits_between(int from, int to)
{
    from = MAX(from, 0), to = MIN(to, STRIP - 1);
    return from > to ? 0 : (2u << to) - (1u << from);
}
// --- elements of a vector -------------------------------------------------------------------------------------------
// ELEMENT: element k of a strip's vector, where k is known only as the kernel runs. SET_ELEMENT changes one. A lane that
// works alone addresses the vector's memory, which is its cache. A GPU has no such memory for what is in registers. So
// there all elements are looked at, and k chooses. STRIP_LOOP stands before a loop over a strip's elements. On a GPU it
// is unrolled, so that each k is a constant.
#if LANES == 1
#define STRIP_LOOP
#define ELEMENT(type, vector, k) (((const type *)&(vector))[k])
#define SET_ELEMENT(type, vector, k, value) (((type *)&(vector))[k] = (value))
#else
#define STRIP_LOOP UNROLL
// Each element that is not wanted counts as 0. Of a choice between elements a compiler may make an address again.
INLINE uint element_uint(VECTOR(uint) vector, uint k)
{
    uint found = 0;
    UNROLL for (uint j = 0; j < STRIP; ++j) found |= j == k ? ((const uint *)&vector)[j] : 0u;
    return found;
}
INLINE ulong element_ulong(VECTOR(ulong) vector, uint k)
{
    ulong found = 0;
    UNROLL for (uint j = 0; j < STRIP; ++j) found |= j == k ? ((const ulong *)&vector)[j] : 0ul;
    return found;
}
INLINE int element_int(VECTOR(int) vector, uint k) { return (int)element_uint(PASTE(as_, VECTOR(uint))(vector), k); }
INLINE float element_float(VECTOR(float) vector, uint k)
{
    return as_float(element_uint(PASTE(as_, VECTOR(uint))(vector), k));
}
#define ELEMENT(type, vector, k) PASTE(element_, type)(vector, k)
#define SET_ELEMENT(type, vector, k, value)                                                                     \
    ((vector) = (VECTOR(int))((int)(k)) == (VECTOR(int))(IOTA) ? (VECTOR(type))(value) : (vector))
#endif

// SELECT: a where the mask's elements are -1, b where they are 0. A compiler does not know that a mask has only these
// two values. Without instructions for masks of single bits it may make slow code of `?:`.
#if defined(__AVX512F__)
#define SELECT(mask, a, b) ((mask) ? (a) : (b))
#elif STRIP == 16 && defined(__AVX__) && __has_builtin(__builtin_ia32_blendvps256)
#define BLEND(mask, a, b) as_int8(__builtin_ia32_blendvps256(as_float8(b), as_float8(a), as_float8(mask)))
INLINE int16 SELECT(int16 mask, int16 a, int16 b)
{
    return (int16)(BLEND(mask.lo, a.lo, b.lo), BLEND(mask.hi, a.hi, b.hi));
}
#else
#define SELECT(mask, a, b) (((a) & (mask)) | ((b) & ~(mask)))
#endif

// Counts one more where `counted` is -1. For a CPU's compiler this is one subtraction. Elsewhere elements are counted one
// by one, as Oclgrind 21.10 takes the 1 that optimizers make of a vector's -1 for -1 again.
INLINE void count_up(VECTOR(uint) *counts, VECTOR(int) counted)
{
#if CPU_TARGET
    *counts -= PASTE(as_, VECTOR(uint))(counted);
#else
    UNROLL for (int k = 0; k < STRIP; ++k) ((uint *)counts)[k] += ((const int *)&counted)[k] != 0 ? 1 : 0;
#endif
}
// WIDER: the same mask for vectors of longs, to choose by with `?:`. Mesa's rusticl takes a long that was converted from
// an int for one that is not negative (docs/drivers.md). Whether it is zero, rusticl gets right.
#if CPU_TARGET
#define WIDER(mask) CONVERT(long, STRIP, mask)
#else
#define WIDER(mask) (CONVERT(long, STRIP, mask) != (VECTOR(long))(0))
#endif

INLINE uint largest(VECTOR(uint) values)
{
    uint found = 0;
    STRIP_LOOP for (int k = 0; k < STRIP; ++k) found = MAX(found, ((const uint *)&values)[k]);
    return found;
}

// --- a strip's elements here and there in memory --------------------------------------------------------------------
// Places `at` are below 2^31. Memory is touched only where `present` is -1. AVX-512 has instructions for this, and AVX2
// for gathering. Compilers find them for some elements at most, or never, so they are named here.
#if STRIP == 16 && defined(__AVX512VL__) && __has_builtin(__builtin_ia32_scattersiv8di) && \
    __has_builtin(__builtin_ia32_cmpd256_mask)
#define AVX512 1
#else
#define AVX512 0
#endif

#if defined(__AVX2__) && __has_builtin(__builtin_ia32_gatherd_d256)
#define AVX2_GATHER 1
#else
#define AVX2_GATHER 0
#endif

INLINE void scatter(global ulong *to, VECTOR(uint) at, VECTOR(int) present, VECTOR(ulong) value)
{
#if AVX512
    // Two masks of "not equal". To cut one of all 16 in two, compilers store it, and the next load waits for that.
    uchar low = __builtin_ia32_cmpd256_mask(present.lo, (int8)(0), 4, -1);
    uchar high = __builtin_ia32_cmpd256_mask(present.hi, (int8)(0), 4, -1);
    __builtin_ia32_scattersiv8di((void *)(size_t)to, low, as_int8(at.lo), as_long8(value.lo), sizeof(ulong));
    __builtin_ia32_scattersiv8di((void *)(size_t)to, high, as_int8(at.hi), as_long8(value.hi), sizeof(ulong));
#else
    STRIP_LOOP for (int k = 0; k < STRIP; ++k)
        if (((const int *)&present)[k]) to[((const uint *)&at)[k]] = ((const ulong *)&value)[k];
#endif
}

// Elements that are not present become 0.
INLINE VECTOR(uint) gather(global const uint *from, VECTOR(uint) at, VECTOR(int) present)
{
    VECTOR(uint) found = (VECTOR(uint))(0);
#if AVX512
    found = as_uint16(__builtin_ia32_gathersiv16si(as_int16(found), (const void *)(size_t)from, as_int16(at),
                                                       BITS_OF(present), sizeof(uint)));
#elif AVX2_GATHER && STRIP == 16
    const int *base = (const int *)(size_t)from;
    found.lo = as_uint8(__builtin_ia32_gatherd_d256((int8)(0), base, as_int8(at.lo), present.lo, sizeof(uint)));
    found.hi = as_uint8(__builtin_ia32_gatherd_d256((int8)(0), base, as_int8(at.hi), present.hi, sizeof(uint)));
#else
    STRIP_LOOP for (int k = 0; k < STRIP; ++k)
        if (((const int *)&present)[k]) ((uint *)&found)[k] = from[((const uint *)&at)[k]];
#endif
    return found;
}

// Writes a whole cache line that is not read again soon: past the caches, and without reading first what was there.
// `to` is the beginning of a line.
#if CPU_TARGET && __has_builtin(__builtin_nontemporal_store)
#define STORE_LINE(to, value) __builtin_nontemporal_store(value, to)
#else
#define STORE_LINE(to, value) (*(to) = (value))
#endif

// LOWEST_BIT: the number of the lowest bit that is set, of a number that is not zero. POPCOUNT: how many bits are set.
// Compilers for a CPU make one instruction of their own builtins. Others may accept these and then fail to translate
// them, but all of them know OpenCL's functions.
#if CPU_TARGET && __has_builtin(__builtin_ctz) && __has_builtin(__builtin_popcount)
#define LOWEST_BIT(bits) __builtin_ctz(bits)
#define POPCOUNT(bits) (uint)__builtin_popcount(bits)
#else
#define LOWEST_BIT(bits) (31 - (int)clz((bits) & (0u - (bits))))
#define POPCOUNT(bits) popcount(bits)
#endif

// --- time -----------------------------------------------------------------------------------------------------------
// A clock that ticks evenly, where the device lets kernels read one. Elsewhere 0.
#if defined(__x86_64__) && __has_builtin(__builtin_ia32_rdtsc)
#define TICKS() (ulong)__builtin_ia32_rdtsc()
#else
#define TICKS() 0ul
#endif

// Adds to a number of 64 bits that is stored as two words, the low one first.
INLINE void add_long(volatile global uint *total, ulong value)
{
    uint low = (uint)value, high = (uint)(value >> 32);
    if (atomic_add(total, low) > ~low) ++high;
    if (high) atomic_add(total + 1, high);
}

// Turns a 4 x 4 matrix: rows become columns.
#define TRANSPOSE(a, b, c, d)                                                                                   \
    {                                                                                                           \
        float4 ab = (float4)(a.x, b.x, a.y, b.y), cd = (float4)(c.x, d.x, c.y, d.y);                            \
        float4 far_ab = (float4)(a.z, b.z, a.w, b.w), far_cd = (float4)(c.z, d.z, c.w, d.w);                    \
        a = (float4)(ab.lo, cd.lo), b = (float4)(ab.hi, cd.hi);                                                 \
        c = (float4)(far_ab.lo, far_cd.lo), d = (float4)(far_ab.hi, far_cd.hi);                                 \
    }

// --- colour ---------------------------------------------------------------------------------------------------------
// byte / 255, correctly rounded for every byte. 257 / 2^16 of it is exact, and the rest is too small to be rounded
// wrongly.
#define UNIT_OF(byte) ((byte) * 0x1.01p-8f + (byte) * 0x1.0101020p-24f)

// --- the sample grid, in subpixels from the image's centre ---------------------------------------------------------
// A pixel here is one sample, and a pattern says where in it that lies (clpeel/device/samples.py). It is the same for all
// blocks: by the sample's row in its block so many quarters of a pixel right, and by its column so many down, from a
// place that all have in common. That is as far from the pixel's upper left corner as no sample comes nearer to any
// side. In a pattern's word are, from the lowest bits on: the quarters right of each of four rows, two bits each; the
// quarters down of each of four columns; and the place's distance from the left side, then from the top, a byte each.
// PATTERN: that of kernels which make fragments. Others are built once for all patterns, and have it as an argument.
#ifndef PATTERN
#define PATTERN REGULAR
#endif
#define QUARTERS_RIGHT(pattern, row) ((int)((pattern) >> 2 * ((row) & 3)) & 3)
#define QUARTERS_DOWN(pattern, column) ((int)((pattern) >> 8 >> 2 * ((column) & 3)) & 3)
#define FIRST_X(pattern) ((int)((pattern) >> 16) & 255)
#define FIRST_Y(pattern) ((int)((pattern) >> 24) & 255)

// Where the samples' common place lies in a pixel of this column (or row). first: FIRST_X (or FIRST_Y) of the pattern.
// side: the image's width (or height).
#define PLACE_AT(pixel, side, first) ((pixel) * SUBPIXELS + ((first) - (side) * (SUBPIXELS / 2)))

// The sample of a pixel.
#define SAMPLE_X(column, row, width, pattern)                                                                   \
    (PLACE_AT(column, width, FIRST_X(pattern)) + QUARTERS_RIGHT(pattern, row) * (SUBPIXELS / 4))
#define SAMPLE_Y(column, row, height, pattern)                                                                  \
    (PLACE_AT(row, height, FIRST_Y(pattern)) + QUARTERS_DOWN(pattern, column) * (SUBPIXELS / 4))

// The first pixel that may have its sample at or right of (below) the coordinate, and the last one that may have it at or
// left of (above) it.
#define FIRST_PIXEL_FROM(coordinate, side, first) (((coordinate) + ((side) * (SUBPIXELS / 2) + (first) - 1)) >> SUBPIXEL_BITS)
#define LAST_PIXEL_TO(coordinate, side, first) (((coordinate) + ((side) * (SUBPIXELS / 2) - (first))) >> SUBPIXEL_BITS)

// Samples lie whole steps apart: STEP subpixels, of which a pixel has PIXEL_STEPS on its side.
#define PATTERNED (PATTERN != REGULAR)
#if PATTERNED
#define STEP_BITS PATTERN_STEP_BITS
#else
#define STEP_BITS SUBPIXEL_BITS
#endif
#define STEP (1 << STEP_BITS)
#define PIXEL_STEPS (SUBPIXELS / STEP)

// --- pixels of the picture, where samples lie in a pattern ----------------------------------------------------------
// Each has SHOWN_COLUMNS x SHOWN_ROWS samples of a block.
#if PATTERNED
#define SHOWN_COLUMNS (SUBPIXELS / 2 / FIRST_Y(PATTERN))
#define SHOWN_ROWS (SUBPIXELS / 2 / FIRST_X(PATTERN))

// Samples of a block, a bit each: the upper left ones of all its pixels of the picture, and all of its first such pixel.
#define CORNERS ((SHOWN_COLUMNS == 2 ? 5u : 1u) * (SHOWN_ROWS == 2 ? 0x101u : 1u))
#define FIRST_SHOWN (((1u << SHOWN_COLUMNS) - 1) * (0x1111u & ((1u << SHOWN_ROWS * BLOCK) - 1)))

// The upper left samples of all pixels of the picture that have one of these samples.
INLINE uint corners_of(uint samples)
{
    UNROLL for (int k = 1; k < SHOWN_COLUMNS; k *= 2) samples |= samples >> k;
    UNROLL for (int k = 1; k < SHOWN_ROWS; k *= 2) samples |= samples >> k * BLOCK;
    return samples & CORNERS;
}

// How far the centre of the picture's pixel lies from the first sample of the block, in half steps right and down. column,
// row: of a sample of that pixel in the block; numbers or vectors.
#define CENTRE_X(column) (((column) & -SHOWN_COLUMNS) * (2 * PIXEL_STEPS) + (SHOWN_COLUMNS * SUBPIXELS / 2 - FIRST_X(PATTERN)) * 2 / STEP)
#define CENTRE_Y(row)                                                                                           \
    (((row) & -SHOWN_ROWS) * (2 * PIXEL_STEPS) +                                                                \
     (SHOWN_ROWS * SUBPIXELS / 2 - FIRST_Y(PATTERN)) * 2 / STEP - 2 * QUARTERS_DOWN(PATTERN, 0))
#else
#define SHOWN_COLUMNS 1
#define SHOWN_ROWS 1
#endif

#endif
