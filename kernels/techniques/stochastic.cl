// stochastic: each fragment covers a random part of a pixel's samples, as large as its alpha; not exact.
//
// Enderton, Sintorn, Shirley and Luebke (2010, "Stochastic Transparency") give a pixel S samples. A fragment covers R of
// them, chosen at random, and each sample keeps the nearest depth that covers it:
//   R = floor(alpha S + xi),   0 <= xi < 1 at random
// So a sample is covered with the probability alpha. Then the share of samples with nothing nearer than a fragment is, in
// the mean, the transmittance in front of it. This is the fragment's visibility v. The colour is accumulated with it:
//   C = sum(vi Ai Ci)
// With CORRECTED, alpha correction makes the total opacity that of all layers:
//   C = sum(vi Ai Ci) (1 - T) / sum(vi Ai) + C0 T,   T = product of (1 - Ai)
// Else C0 is seen through the samples that nothing covers.
//
// The paper's hardware goes through the geometry for T, for the samples' depths, and for the colours. Here a pixel's
// fragments are in memory, so one go from the nearest to the farthest finds all three. The samples that anything nearer
// covers are a mask of S bits (MASK_BITS).
//
// The paper takes random numbers by pixel and triangle. Here they are a hash of the sample's place in the picture and of
// the fragment's place in the order of depths. All of a pixel's masks are independent, as in the paper. But no order of
// submission changes them, and they stay as they are when the scene moves.
#include "fragments/sorting.h"

#define PLACED 1

#ifndef MASK_BITS
#define MASK_BITS 8
#endif
#ifndef CORRECTED
#define CORRECTED 1
#endif

#define MASK_WORDS ((MASK_BITS + 31) / 32)
#define GOLDEN 0x9E3779B9u  // 2^32 times the golden section: its multiples lie well apart

// A hash of 32 bits: each bit of the number may change each bit of the result.
INLINE VECTOR(uint) hash(VECTOR(uint) number)
{
    number = (number ^ number >> (VECTOR(uint))(16)) * 0x7FEB352Du;
    number = (number ^ number >> (VECTOR(uint))(15)) * 0x846CA68Bu;
    return number ^ number >> (VECTOR(uint))(16);
}

INLINE VECTOR(uint) bits_set(VECTOR(uint) word)
{
    word -= word >> (VECTOR(uint))(1) & (VECTOR(uint))(0x55555555u);
    word = (word & (VECTOR(uint))(0x33333333u)) + (word >> (VECTOR(uint))(2) & (VECTOR(uint))(0x33333333u));
    word = (word + (word >> (VECTOR(uint))(4))) & (VECTOR(uint))(0x0F0F0F0Fu);
    return word * 0x01010101u >> (VECTOR(uint))(24);
}

// How many samples nothing covers so far.
INLINE VECTOR(uint) uncovered(const VECTOR(uint) *covered)
{
    VECTOR(uint) left = (VECTOR(uint))(MASK_BITS);
    UNROLL for (int word = 0; word < MASK_WORDS; ++word) left -= bits_set(covered[word]);
    return left;
}

// Covers R samples of each pixel, R = floor(alpha S + xi) with alpha and xi in steps of 2^-24. Sample after sample is
// chosen with the probability (how many are still to be chosen) / (how many samples there still are), so all sets of R
// samples are equally likely. Numbers below 2^7 are compared by the sign of their difference.
INLINE void cover_some(VECTOR(uint) seed, VECTOR(float) alpha, VECTOR(uint) *covered)
{
    const VECTOR(uint) fraction = (VECTOR(uint))(24), byte = (VECTOR(uint))(8), sign = (VECTOR(uint))(31);
    alpha = MAX(alpha, (VECTOR(float))(0.0f)), alpha = MIN(alpha, (VECTOR(float))(1.0f));
    VECTOR(uint) share = PASTE(as_, VECTOR(uint))(CONVERT(int, STRIP, alpha * 0x1p24f));
    VECTOR(uint) to_choose = (share * (uint)MASK_BITS + (hash(seed) >> byte)) >> fraction;
    UNROLL for (int word = 0; word < MASK_WORDS; ++word) {
        VECTOR(uint) chosen = (VECTOR(uint))(0);
        PLAIN_LOOP for (uint bit = 0; bit < MIN(MASK_BITS, 32); ++bit) {
            uint sample = word * 32 + bit;
            seed += (VECTOR(uint))(GOLDEN);
            VECTOR(uint) place = (hash(seed) >> byte) * ((uint)MASK_BITS - sample) >> fraction;
            VECTOR(uint) taken = (place - to_choose) >> sign;
            to_choose -= taken;
            chosen |= taken << (VECTOR(uint))(bit);
        }
        covered[word] |= chosen;
    }
}

// place: of each sample in the picture.
INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved, VECTOR(uint) place)
{
    VECTOR(float) through = (VECTOR(float))(FULL);
    VECTOR(uint) covered[MASK_WORDS];
    UNROLL for (int word = 0; word < MASK_WORDS; ++word) covered[word] = (VECTOR(uint))(0);
    Colors buffer;
    clear_sums(&buffer);
    place = hash(place);
    uint deepest = sort_deep(fragments, scratch, begin, step, count);
    for (uint first = 0; first < deepest; first += RUN) {
        VECTOR(ulong) all[RUN];
        uint row_count = load_sorted(fragments, begin, step, count, first, deepest, all);
        for (uint row = 0; row < row_count; row += ROWS) {
            Colors source[ROWS];
            uint fetched = MIN(deepest - first - row, (uint)ROWS);
            fetch_colors(all + row, fetched, colors, source);
            for (uint k = 0; k < fetched; ++k) {
                VECTOR(float) alpha = source[k].alpha;
                source[k].alpha = alpha * (CONVERT(float, STRIP, CONVERT(int, STRIP, uncovered(covered))) * (1.0f / MASK_BITS));
                blend_add(&buffer, source + k);
                through = KEPT(through * (1.0f - alpha));
                cover_some(hash(place ^ (VECTOR(uint))((first + row + k) * GOLDEN)), alpha, covered);
            }
        }
    }
    read_color(&buffer, resolved);
#if CORRECTED
    VECTOR(float) seen = resolved->alpha;
    resolved->alpha = read_channel(through);
    VECTOR(float) scale = seen > (VECTOR(float))(0.0f) ? (1.0f - resolved->alpha) / seen : (VECTOR(float))(0.0f);
    resolved->red *= scale, resolved->green *= scale, resolved->blue *= scale;
#else
    resolved->alpha = CONVERT(float, STRIP, CONVERT(int, STRIP, uncovered(covered))) * (1.0f / MASK_BITS);
#endif
}

#include "frames/one_pass.h"
