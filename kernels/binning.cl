// Binning: for each tile the records that may cover it, in submission order.
//
//   bin_count    one work-item a chunk of the list: how many records of the chunk meet each tile
//   bin_offsets  one work-item a tile: chunk counts to offsets within the tile's list, and the list's length
//   bin_emit     one work-item a chunk: writes the lists of the tiles of one batch
//
//   counts[chunk * tile_count + tile]      chunks in submission order, so lists are too: nothing to sort, no atomics
#include "common.h"

// Whether a sample of the tile can lie inside: no edge has all of the tile's samples on its outer side.
INLINE bool meets_tile(global const Triangle *t, int column, int row, int width, int height)
{
    int x0 = SAMPLE_AT(column * TILE, width), x1 = x0 + (TILE - 1) * SUBPIXELS;
    int y0 = SAMPLE_AT(row * TILE, height), y1 = y0 + (TILE - 1) * SUBPIXELS;
    for (int a = 0; a < 3; ++a) {
        int b = a < 2 ? a + 1 : 0;
        int dx = t->x[b] - t->x[a], dy = t->y[b] - t->y[a];
        // E grows with y where dx > 0 and falls with x where dy > 0: the sample farthest inside.
        int x = dy > 0 ? x0 : x1, y = dx > 0 ? y1 : y0;
        if ((long)dx * (y - t->y[a]) - (long)dy * (x - t->x[a]) < 0) return false;
    }
    return true;
}

// Runs BODY for each (record, tile) of the chunk's records with first_row <= tile row <= last_row.
#define FOR_EACH_PAIR(BODY)                                                                                     \
    for (uint place = first; place < last; ++place) {                                                              \
        ushort4 reach = bounds[place];                                                                           \
        bool fan = reach.x == CLIPPED_FACE && reach.y == 0;                                                     \
        uint record = fan ? record_count + CLIP_TRIANGLES * (reach.z | (uint)reach.w << 16) : place;               \
        uint end = fan ? record + CLIP_TRIANGLES : record + 1;                                                  \
        for (; record < end; ++record) {                                                                        \
            ushort4 box = bounds[record];                                                                       \
            if (box.x > box.y) continue;                                                                        \
            box /= (ushort)TILE;                                                                                \
            int row = MAX((int)box.z, first_row), row_end = MIN((int)box.w, last_row);                          \
            /* up to four tiles the test costs more than the pairs it saves */                                  \
            bool test = (box.y - box.x + 1) * (box.w - box.z + 1) > 4;                                          \
            for (; row <= row_end; ++row)                                                                       \
                for (int column = box.x; column <= box.y; ++column) {                                           \
                    if (test && !meets_tile(triangles + record, column, row, width, height)) continue;          \
                    uint tile = row * columns + column;                                                         \
                    BODY                                                                                        \
                }                                                                                               \
        }                                                                                                       \
    }

kernel void bin_count(global const Triangle *triangles, global const ushort4 *bounds, uint record_count, uint chunk_records,
                      int width, int height, int columns, int first_row, int last_row, uint tile_count,
                      global uint *counts)
{
    uint chunk = get_global_id(0);
    uint first = chunk * chunk_records, last = MIN(first + chunk_records, record_count);
    global uint *mine = counts + (size_t)chunk * tile_count;
    for (uint tile = 0; tile < tile_count; ++tile) mine[tile] = 0;
    FOR_EACH_PAIR(++mine[tile];)
}

kernel void bin_offsets(uint chunk_count, uint tile_count, global uint *counts, global uint *tile_pairs)
{
    uint tile = get_global_id(0);
    if (tile >= tile_count) return;
    uint sum = 0;
    for (uint chunk = 0; chunk < chunk_count; ++chunk) {
        size_t at = (size_t)chunk * tile_count + tile;
        uint count = counts[at];
        counts[at] = sum;
        sum += count;
    }
    tile_pairs[tile] = sum;
}

// pair_start[tile - first_tile]: where the tile's list begins in `pairs`.
kernel void bin_emit(global const Triangle *triangles, global const ushort4 *bounds, uint record_count, uint chunk_records,
                     int width, int height, int columns, int first_row, int last_row, uint tile_count,
                     uint first_tile, uint last_tile, global const uint *pair_start, global uint *counts,
                     global uint *pairs)
{
    uint chunk = get_global_id(0);
    uint first = chunk * chunk_records, last = MIN(first + chunk_records, record_count);
    global uint *mine = counts + (size_t)chunk * tile_count;
    FOR_EACH_PAIR(if (tile >= first_tile && tile <= last_tile) pairs[pair_start[tile - first_tile] + mine[tile]++] = record;)
}
