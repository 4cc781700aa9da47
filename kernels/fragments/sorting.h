// Sorting: puts a strip's fragments in their order, (depth, submission index), nearest first. Fragments are integers
// that have this order (stages/walk.h).
//
// A lane that works alone keeps up to RUN_MAX layers of a strip in private memory, a row of vectors for each layer. One
// sorting network sorts all its pixels side by side, as its steps do not depend on the depths. A pixel with more layers
// is sorted first where its list lies, byte by byte of its keys.
//
// Several lanes have no private memory but registers: what a GPU calls private beyond these lies in its slowest memory.
// So they sort each pixel where its fragments lie, eight in registers at a time.
//
// Both give what these names stand for:
//   sort_list(list, spare, count)       sorts a long list; returns which of the two arrays has it then
//   sort_deep(...)                      sorts what must be sorted before rows are loaded
//   load_sorted(...)                    loads up to RUN layers of a strip, in their order
#ifndef SORTING_H
#define SORTING_H

#include "fragments/colors.h"

// What a network exchanges: a row of a strip, or fragments of one pixel.
#if LANES == 1
typedef VECTOR(ulong) Sorted;
#else
typedef ulong Sorted;
#endif

INLINE void exchange(Sorted *nearer, Sorted *farther)
{
    Sorted a = *nearer, b = *farther, least = MIN(a, b);
    *nearer = least, *farther = a ^ b ^ least;  // the other one: CPUs compare with fewer units than they xor
}

#define X(i, j) exchange(rows + i, rows + j);

// The networks: of 19 exchanges, which sorts eight (Knuth, The Art of Computer Programming 3, 5.3.4); and the last three
// steps of the bitonic merge (Batcher 1968), which stay among eight.
#define SORT_EIGHT                                                                                              \
    X(0, 2) X(1, 3) X(4, 6) X(5, 7) X(0, 4) X(1, 5) X(2, 6) X(3, 7) X(0, 1) X(2, 3) X(4, 5) X(6, 7) X(2, 4) X(3, 5) \
    X(1, 4) X(3, 6) X(1, 2) X(3, 4) X(5, 6)
#define MERGE_EIGHT                                                                                             \
    X(0, 4) X(1, 5) X(2, 6) X(3, 7) X(0, 2) X(1, 3) X(4, 6) X(5, 7) X(0, 1) X(2, 3) X(4, 5) X(6, 7)

#if LANES == 1
#define RUN RUN_MAX

// --- the network for up to RUN_MAX layers ---------------------------------------------------------------------------
// Sorts ROWS rows.
INLINE void sort_eight(VECTOR(ulong) *rows) { SORT_EIGHT }

// Merges sorted runs of ROWS rows two by two, `count` rows in all. This is the bitonic network (Batcher 1968). Its
// first step pairs the first row of one run with the last row of the other. It is the network for the next power of
// two. Rows that are missing would stay behind all others, so their exchanges are skipped. Most time goes into storing
// rows. So the last steps, which stay among eight rows, are made while these are in registers.
INLINE void merge_rows(VECTOR(ulong) *all, uint count)
{
    for (uint run = ROWS; run < count; run *= 2)
        for (uint first = 0; first + run < count; first += 2 * run) {
            uint end = MIN(first + 2 * run, count);
            for (uint far = first + run; far < end; ++far) exchange(all + 2 * (first + run) - 1 - far, all + far);
            for (uint step = run / 2; step >= ROWS; step /= 2)
                for (uint part = first; part + step < end; part += 2 * step)
                    for (uint k = part; k < MIN(part + step, end - step); ++k) exchange(all + k, all + k + step);
            for (uint part = first; part < end; part += ROWS) {
                VECTOR(ulong) rows[ROWS];
                UNROLL for (int k = 0; k < ROWS; ++k) rows[k] = all[part + k];
                MERGE_EIGHT
                UNROLL for (int k = 0; k < ROWS; ++k) all[part + k] = rows[k];
            }
        }
}

// --- the sort of deeper pixels --------------------------------------------------------------------------------------
// Sorts one pixel's fragments by radix, least byte of the keys first, from `list` to `spare` and back. The time for
// each fragment does not grow with their number. It sorts by the bytes of (key - least key), as the range of keys is
// often small enough to save a byte. Returns which of the two arrays has the sorted fragments. Fragments of equal depth
// keep their order.
static global ulong *sort_list(global ulong *list, global ulong *spare, uint count)
{
    ulong8 low = list[0], high = low;
    PLAIN_LOOP for (uint k = 0; k + 8 <= count; k += 8) {
        ulong8 some = *(global const Octet *)(list + k);
        low = MIN(low, some), high = MAX(high, some);
    }
    ulong least = list[count - 1], most = least;
    PLAIN_LOOP for (int k = 0; k < 8; ++k) {
        ulong one = list[MAX((int)count - 1 - k, 0)];  // signed, as in load_rows (fragments/colors.h)
        least = MIN(least, MIN(((const ulong *)&low)[k], one)), most = MAX(most, MAX(((const ulong *)&high)[k], one));
    }
    least &= 0xFFFFFFFF00000000ul;
    int digits = 0;
    while (digits < 4 && (most - least) >> (32 + 8 * digits)) ++digits;
    uint place[4][256];
    PLAIN_LOOP for (uint k = 0; k < 4 * 256; ++k) place[0][k] = 0;
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

// Sorts the pixels of a strip that have more than RUN_MAX fragments, where they lie. Returns the most fragments of any
// pixel.
OUTLINE uint sort_deep(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step, VECTOR(uint) count)
{
    uint deepest = 0;
    PLAIN_LOOP for (int k = 0; k < STRIP; ++k) {
        uint size = ((const uint *)&count)[k], from = ((const uint *)&begin)[k];
        deepest = MAX(deepest, size);
        if (size <= RUN_MAX) continue;
        global ulong *list = fragments + from;
        global const ulong *sorted = sort_list(list, scratch + from, size);
        if (sorted != list)
            PLAIN_LOOP for (uint i = 0; i < size; i += 8) *(global Octet *)(list + i) = *(global const Octet *)(sorted + i);
    }
    return deepest;
}

// Loads up to RUN_MAX layers of a strip's pixels into `all`, in their order, from number `first` on. sort_deep must
// have run before. So beyond the first RUN_MAX layers nothing has to be sorted. Returns how many rows of `all` are
// filled.
INLINE uint load_sorted(global const ulong *fragments, VECTOR(uint) begin, uint step, VECTOR(uint) count, uint first,
                        uint deepest, VECTOR(ulong) *all)
{
    uint row_count = (MIN(deepest - first, (uint)RUN_MAX) + ROWS - 1) / ROWS * ROWS;
    for (uint row = 0; row < row_count; row += ROWS) {
        VECTOR(ulong) rows[ROWS];
        load_rows(fragments, begin, step, count, first + row, rows);
        if (first == 0) sort_eight(rows);
        UNROLL for (int k = 0; k < ROWS; ++k) all[row + k] = rows[k];
    }
    if (first == 0) merge_rows(all, row_count);
    return row_count;
}

#else

#define RUN 1

#define AT(k) list[(size_t)(k) * step]

// Loads eight fragments of a list, or ABSENT behind its last one; and stores them.
INLINE void load_eight(global const ulong *list, uint step, uint first, uint count, ulong *rows)
{
    UNROLL for (uint k = 0; k < 8; ++k) rows[k] = first + k < count ? AT(first + k) : ABSENT;
}

INLINE void store_eight(global ulong *list, uint step, uint first, uint count, const ulong *rows)
{
    UNROLL for (uint k = 0; k < 8; ++k)
        if (first + k < count) AT(first + k) = rows[k];
}

// Sorts each eight fragments of a list. The list's fragments lie `step` apart.
INLINE void sort_eights(global ulong *list, uint step, uint count)
{
    PLAIN_LOOP for (uint first = 0; first < count; first += 8) {
        ulong rows[8];
        load_eight(list, step, first, count, rows);
        SORT_EIGHT
        store_eight(list, step, first, count, rows);
    }
}

INLINE void exchange_at(global ulong *nearer, global ulong *farther)
{
    ulong a = *nearer, b = *farther;
    if (a > b) *nearer = b, *farther = a;
}

// Sorts a list where it lies: eights first, then runs are merged two by two by the bitonic network (Batcher 1968). The
// first step of a merge pairs the first fragment of one run with the last one of the other. It is the network for the
// next power of two. Fragments that are missing would stay behind all others, so their exchanges are skipped.
INLINE void sort_in_place(global ulong *list, uint step, uint count)
{
    sort_eights(list, step, count);
    PLAIN_LOOP for (uint run = 8; run < count; run *= 2)
        PLAIN_LOOP for (uint first = 0; first + run < count; first += 2 * run) {
            uint end = MIN(first + 2 * run, count);
            PLAIN_LOOP for (uint far = first + run; far < end; ++far) exchange_at(&AT(2 * (first + run) - 1 - far), &AT(far));
            PLAIN_LOOP for (uint apart = run / 2; apart >= 8; apart /= 2)
                PLAIN_LOOP for (uint k = first; k + apart < end; ++k)
                    if (!((k - first) & apart)) exchange_at(&AT(k), &AT(k + apart));
            PLAIN_LOOP for (uint part = first; part < end; part += 8) {
                ulong rows[8];
                load_eight(list, step, part, end, rows);
                MERGE_EIGHT
                store_eight(list, step, part, end, rows);
            }
        }
}
#undef AT

// Sorts a list whose fragments lie side by side: eights first, then runs are merged two by two, from `list` to `spare`
// and back. Returns which of the two arrays has the sorted fragments.
static global ulong *sort_list(global ulong *list, global ulong *spare, uint count)
{
    sort_eights(list, 1, count);
    global ulong *from = list, *to = spare;
    PLAIN_LOOP for (uint run = 8; run < count; run *= 2) {
        PLAIN_LOOP for (uint first = 0; first < count; first += 2 * run) {
            uint a = first, middle = MIN(first + run, count), b = middle, end = MIN(middle + run, count);
            ulong nearer = from[a], farther = b < end ? from[b] : ABSENT;
            PLAIN_LOOP for (uint k = first; k < end; ++k) {
                bool second = farther < nearer;
                to[k] = second ? farther : nearer;
                if (second) farther = ++b < end ? from[b] : ABSENT;
                else nearer = ++a < middle ? from[a] : ABSENT;
            }
        }
        global ulong *swap = from;
        from = to, to = swap;
    }
    return from;
}

// Sorts the fragments of each pixel of a strip where they lie. Returns the most fragments of any pixel. Where one has
// more than RUN_MAX, they are in lists, and there is `scratch`.
INLINE uint sort_deep(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step, VECTOR(uint) count)
{
    PLAIN_LOOP for (int k = 0; k < STRIP; ++k) {
        uint size = ELEMENT(uint, count, k), from = ELEMENT(uint, begin, k);
        global ulong *list = fragments + from;
        if (size <= RUN_MAX) {
            if (size > 1) sort_in_place(list, step, size);
            continue;
        }
        global const ulong *sorted = sort_list(list, scratch + from, size);
        PLAIN_LOOP for (uint i = 0; sorted != list && i < size; ++i) list[i] = sorted[i];
    }
    return largest(count);
}

// Loads one layer of a strip's pixels, number `first`. sort_deep must have run before. Returns how many rows of `all`
// are filled.
INLINE uint load_sorted(global const ulong *fragments, VECTOR(uint) begin, uint step, VECTOR(uint) count, uint first,
                        uint deepest, VECTOR(ulong) *all)
{
    load_rows(fragments, begin, step, count, first, all);
    return RUN;
}

#endif
#endif
