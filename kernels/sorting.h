// Sorting a pixel's fragments that are too many for private memory, where they lie.
#ifndef SORTING_H
#define SORTING_H

#include "shading.h"

// Sorts one pixel's fragments by their depth keys' digits, the least first, between `list` and `spare`: as many steps for each
// fragment, however many there are. Digits of what keys are more than the least: often one fewer than keys have.
// Returns which of the two holds them sorted; fragments of equal depth stay as they were.
static global ulong *sort_digits(global ulong *list, global ulong *spare, uint count)
{
    ulong8 low = list[0], high = low;
    PLAIN_LOOP for (uint k = 0; k + 8 <= count; k += 8) {
        ulong8 some = *(global const Octet *)(list + k);
        low = MIN(low, some), high = MAX(high, some);
    }
    ulong least = list[count - 1], most = least;
    for (int k = 0; k < 8; ++k) {
        ulong one = list[count - 1 - MIN((uint)k, count - 1)];
        least = MIN(least, MIN(((const ulong *)&low)[k], one)), most = MAX(most, MAX(((const ulong *)&high)[k], one));
    }
    least &= 0xFFFFFFFF00000000ul;
    int digits = 0;
    while (digits < 4 && (most - least) >> (32 + 8 * digits)) ++digits;
    uint place[4][256];
    for (uint k = 0; k < 4 * 256; ++k) place[0][k] = 0;
    PLAIN_LOOP for (uint k = 0; k < count; ++k) {
        uint key = (uint)((list[k] - least) >> 32);
        ++place[0][key & 255], ++place[1][key >> 8 & 255], ++place[2][key >> 16 & 255];
        if (digits == 4) ++place[3][key >> 24];
    }
    global ulong *from = list, *to = spare;
    PLAIN_LOOP for (int digit = 0; digit < digits; ++digit) {
        int shift = 32 + 8 * digit;
        uint sum = 0;
        PLAIN_LOOP for (int k = 0; k < 256; ++k) {
            uint size = place[digit][k];
            place[digit][k] = sum;
            sum += size;
        }
        PLAIN_LOOP for (uint k = 0; k < count; ++k) {
            ulong fragment = from[k];
            to[place[digit][((fragment - least) >> shift) & 255]++] = fragment;
        }
        global ulong *swap = from;
        from = to, to = swap;
    }
    return from;
}

#endif
