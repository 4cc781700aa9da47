// Binning: lists for each tile the records that may cover it, in submission order.
//
//   bin_count    a chunk of records a work-item: counts how many records of the chunk meet each tile
//   bin_offsets  a tile a work-item: turns the chunks' counts into offsets in the tile's list, and gives its length
//   bin_emit     a chunk of records a work-item: writes the lists of the tiles of one batch
//
// The counts are at  counts[chunk * COUNTS_APART + tile].  Chunks are in submission order, so the lists are too.
// Nothing has to be sorted, and no atomics are needed.
#include "base/common.h"

// Whether a sample of the tile may lie inside: no edge has all samples of the tile on its outer side. column, row: of
// tiles.
INLINE bool meets_tile(global const Triangle *t, int column, int row, int width, int height, uint pattern)
{
    // The box of all places in the tile where samples lie in the pattern.
    int x0 = PLACE_AT(column * TILE, width, FIRST_X(pattern)), x1 = x0 + TILE * SUBPIXELS - 2 * FIRST_X(pattern);
    int y0 = PLACE_AT(row * TILE, height, FIRST_Y(pattern)), y1 = y0 + TILE * SUBPIXELS - 2 * FIRST_Y(pattern);
    for (int a = 0; a < 3; ++a) {
        int b = a < 2 ? a + 1 : 0;
        int dx = t->x[b] - t->x[a], dy = t->y[b] - t->y[a];
        // E grows with y where dx > 0 and falls with x where dy > 0. So this is the box's corner farthest inside
        // of the edge.
        int x = dy > 0 ? x0 : x1, y = dx > 0 ? y1 : y0;
        if ((long)dx * (y - t->y[a]) - (long)dy * (x - t->x[a]) < 0) return false;
    }
    return true;
}

// Runs BODY for each tile that a record of the chunk meets, in rows first_row .. last_row of tiles, with `record` and
// `tile`. It may also run for other tiles: for some with `present` 0, and for some above or below those rows. Most
// records of a fine mesh meet one tile or its neighbours. For these it runs four times without a branch to mispredict,
// and `present` says which of the four count. `counts` has room for the neighbours of the last tile.
#define FOR_EACH_PAIR(BODY)                                                                                     \
    for (uint place = first; place < last; ++place) {                                                           \
        ushort4 reach = bounds[place];                                                                          \
        bool fan = reach.x == CLIPPED_FACE && reach.y == 0;                                                     \
        uint record = fan ? record_count + CLIP_TRIANGLES * (reach.z | (uint)reach.w << 16) : place;            \
        uint end = fan ? record + CLIP_TRIANGLES : record + 1;                                                  \
        for (; record < end; ++record) {                                                                        \
            ushort4 box = bounds[record];                                                                       \
            if (box.x > box.y) continue;                                                                        \
            box /= (ushort)TILE;                                                                                \
            uint right = box.y - box.x, down = box.w - box.z;                                                   \
            if ((right | down) < 2) {                                                                           \
                uint corner = box.z * columns + box.x;                                                          \
                { uint tile = corner, present = 1; BODY }                                                       \
                { uint tile = corner + 1, present = right; BODY }                                               \
                { uint tile = corner + columns, present = down; BODY }                                          \
                { uint tile = corner + columns + 1, present = right & down; BODY }                              \
                continue;                                                                                       \
            }                                                                                                   \
            for (int row = MAX((int)box.z, first_row); row <= MIN((int)box.w, last_row); ++row)                 \
                for (int column = box.x; column <= box.y; ++column) {                                           \
                    if (!meets_tile(triangles + record, column, row, width, height, pattern)) continue;                  \
                    uint tile = row * columns + column, present = 1;                                            \
                    BODY                                                                                        \
                }                                                                                               \
        }                                                                                                       \
    }

// The counts of consecutive chunks lie this far apart: tiles, and room for the neighbours of the last one.
#define COUNTS_APART (tile_count + columns + 1)

kernel void bin_count(global const Triangle *triangles, global const ushort4 *bounds, uint record_count, uint chunk_records,
                      int width, int height, uint pattern, int columns, int first_row, int last_row, uint tile_count,
                      global uint *counts)
{
    uint chunk = get_global_id(0);
    uint first = chunk * chunk_records, last = MIN(first + chunk_records, record_count);
    global uint *mine = counts + (size_t)chunk * COUNTS_APART;
    for (uint tile = 0; tile < COUNTS_APART; ++tile) mine[tile] = 0;
    FOR_EACH_PAIR(mine[tile] += present;)
}

kernel void bin_offsets(uint chunk_count, int columns, uint tile_count, global uint *counts, global uint *tile_pairs)
{
    uint tile = get_global_id(0);
    if (tile >= tile_count) return;
    uint sum = 0;
    for (uint chunk = 0; chunk < chunk_count; ++chunk) {
        size_t at = (size_t)chunk * COUNTS_APART + tile;
        uint count = counts[at];
        counts[at] = sum;
        sum += count;
    }
    tile_pairs[tile] = sum;
}

// pair_start[tile - first_tile]: where the tile's list begins in `pairs`. What is not wanted is written too, so that
// no branch is needed. It goes behind the last list, where each chunk has a cache line of its own.
kernel void bin_emit(global const Triangle *triangles, global const ushort4 *bounds, uint record_count, uint chunk_records,
                     int width, int height, uint pattern, int columns, int first_row, int last_row, uint tile_count,
                     uint first_tile, uint last_tile, global const uint *pair_start, global uint *counts,
                     global uint *pairs)
{
    uint chunk = get_global_id(0);
    uint first = chunk * chunk_records, last = MIN(first + chunk_records, record_count);
    uint nowhere = (pair_start[last_tile - first_tile + 1] / PADDING + 1 + chunk) * PADDING;
    global uint *mine = counts + (size_t)chunk * COUNTS_APART;
    for (uint tile = first_tile; tile <= last_tile; ++tile) mine[tile] += pair_start[tile - first_tile];
    FOR_EACH_PAIR(
        uint listed = present & (uint)(tile - first_tile <= last_tile - first_tile);
        uint at = mine[tile];
        mine[tile] = at + listed;
        pairs[listed ? at : nowhere] = record;)
}
