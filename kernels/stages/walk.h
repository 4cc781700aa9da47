// The walk: it turns the records of a tile into fragments, exactly. Counting (stages/counting.cl), windows
// (stages/windows.cl) and drawing (frames/one_pass.h, frames/many_passes.h) share it.
//
// A pixel here is one sample: where a pixel of the picture has several samples, the image that is walked is larger by
// as much. A tile has 16 x 16 pixels, in blocks of 4 x 4. Each block is cut into strips of STRIP pixels. Strip s
// belongs to lane s % LANES, and that lane alone writes its pixels. So no atomics are needed, and the fragments of a
// pixel are always in submission order. They are written in one of two layouts:
//
//   rows     the fragments of a strip side by side, a row for each layer: room is fixed, and nothing is counted before
//   lists    those of pixel 0, first submitted .. last, then those of pixel 1, ...: each list is as long as it must be
//
// A fragment is one integer of 64 bits, key << 32 | payload. The key is that of its depth (fragments/depth.h). The
// payload is its face where faces have one colour. Where colours vary over a face, it is the fragment's own place in
// `colors`, or, when peeling, the place of its record in `pairs`. All of these grow with submission. So the order of
// the integers is that of (depth, submission index).
//
// With FACING, the lowest bit of the payload says whether the fragment is seen from behind. A technique that needs this
// defines FACING.
#ifndef RASTER_H
#define RASTER_H

#include "fragments/depth.h"
#include "fragments/colors.h"
#include "base/wide.h"
#include "shading/shade.h"

#define STRIPS_A_LANE (TILE_PIXELS / STRIP / LANES)

#ifndef FACING
#define FACING 0
#endif
#if FACING
#define PAYLOAD(number, t) ((uint)(number) << 1 | ((t)->flags & BACK_FACING) / BACK_FACING)
#define PAYLOADS_OF(numbers, t) ((numbers) << (VECTOR(uint))(1) | (VECTOR(uint))(((t)->flags & BACK_FACING) / BACK_FACING))
#else
#define PAYLOAD(number, t) (number)
#define PAYLOADS_OF(numbers, t) (numbers)
#endif

// --- strips and lanes -----------------------------------------------------------------------------------------------
// LANE_BLOCKS: the blocks that have strips of this lane, a bit each. OWN: the number of such a block among the lane's
// own. FIRST_BLOCK: the block that the lane's walk begins at. FIRST_PIXEL: the first pixel of a block, 0 .. 15, that
// belongs to this lane.
#if LANES <= TILE_BLOCKS
#define LANE_BLOCKS (((1u << TILE_BLOCKS) - 1) / ((1u << LANES) - 1) << lane)
#define OWN(block) ((block) / LANES)
#define FIRST_BLOCK 0
#define FIRST_PIXEL 0
#else
#define LANE_BLOCKS (1u << FIRST_BLOCK)
#define OWN(block) 0
#define FIRST_BLOCK (lane * STRIP / BLOCK_PIXELS)
#define FIRST_PIXEL (lane * STRIP % BLOCK_PIXELS)
#endif

// Columns and rows of a strip's pixels, relative to its first pixel. STRIP_X, STRIP_Y: how many steps their samples lie
// right of its first sample, and below it. Patterns are such that this is the same for all strips of a block.
#define STRIP_COLUMNS ((VECTOR(int))(IOTA) & (VECTOR(int))(BLOCK - 1))
#define STRIP_ROWS ((VECTOR(int))(IOTA) / (VECTOR(int))(BLOCK))
#if PATTERNED
#define QUARTERS_OF(quarters, numbers) ((VECTOR(int))((quarters) & 255) >> (numbers) * 2 & (VECTOR(int))(3))
#define STRIP_X (STRIP_COLUMNS * PIXEL_STEPS + QUARTERS_OF(PATTERN, STRIP_ROWS))
#define STRIP_Y (STRIP_ROWS * PIXEL_STEPS + QUARTERS_OF(PATTERN >> 8, STRIP_COLUMNS) - QUARTERS_DOWN(PATTERN, 0))
#else
#define STRIP_X STRIP_COLUMNS
#define STRIP_Y STRIP_ROWS
#endif

// --- records as edge functions --------------------------------------------------------------------------------------
// The edge function of the edge from corner a to corner b is  E(x, y) = dx (y - y_a) - dy (x - x_a), in square
// subpixels. Edge k lies opposite corner k. E is twice the area of the triangle between the edge and the sample, so it
// is also the barycentric weight of corner k, times twice the area of the record.
//
// A sample exactly on an edge that two triangles share must belong to one of them only. With y down and positive area,
// top edges run right and left edges run up. These own their samples. So `least` is 0 for them, and 1 for all other
// edges, and inside is  E >= least.
//
// From sample to sample E changes by STEP times whole multiples of dx and dy. So all samples have the same E modulo STEP:
//   E - least = STEP F + rest,   0 <= rest < STEP,   covered: F >= 0
// For records below SMALL_EXTENT (SMALL_EXTENT_IN_PATTERNS), F fits 32 bits everywhere in the tile. Larger records take 64 bits, with the same
// integers F and so the same weights.
//
// Where lanes have several strips, WIDE records are prepared at a time (Walks). Then they are visited one by one (Walk).
// Where each lane has one strip, nothing is prepared, as all of it would have to be kept in registers.
#if LANES <= TILE_BLOCKS
typedef struct {
    Longs first[3];  // F of each edge at the lane's first sample of the tile's first block
    Ints dx[3], dy[3];  // for each step further down F grows by dx; for each step further right it falls by dy
    Floats rest[3];  // rest + least, 0 .. STEP
    Ints small;
    Uints blocks;  // the blocks of the tile that the record's bounds reach, a bit each
    Ints many;  // not 0 where these are more than 4: then it pays to test each block
} Walks;

// Prepares the records pairs[at] .. pairs[end - 1], WIDE of them at most, and returns how many. Elements past the last
// one repeat it. Prefetches the records of the next call. x, y: the lane's first sample of the tile's first block, in
// subpixels from the image's centre. tile_x, tile_y: the tile's first pixel.
OUTLINE uint ready_walks(global const Triangle *triangles, global const uint *pairs, uint at, uint end, int x, int y,
                        int tile_x, int tile_y, Walks *w)
{
    for (uint ahead = at + WIDE; ahead < MIN(at + 2 * WIDE, end); ++ahead) PREFETCH(triangles + pairs[ahead]);
    Uints field[RECORD_FIELDS];
    load_records(triangles, pairs, at, end - 1, field);
    Ints corner_x[3], corner_y[3];
    UNROLL for (int j = 0; j < 3; ++j) corner_x[j] = AS_INTS(field[j]), corner_y[j] = AS_INTS(field[3 + j]);
    w->small = AS_INTS(field[13] & SMALL);
    Ints left = AS_INTS(field[14] & 0xFFFF), right = AS_INTS(field[14] >> (Uints)(16));
    Ints top = AS_INTS(field[15] & 0xFFFF), bottom = AS_INTS(field[15] >> (Uints)(16));
    UNROLL for (int k = 0; k < 3; ++k) {
        int a = k < 2 ? k + 1 : 0, b = k > 0 ? k - 1 : 2;
        Ints dx = corner_x[b] - corner_x[a], dy = corner_y[b] - corner_y[a];
        Ints least = (dy < (Ints)(0)) | ((dy == (Ints)(0)) & (dx > (Ints)(0))) ? (Ints)(0) : (Ints)(1);
        Longs e = TO(Longs, dx) * TO(Longs, y - corner_y[a]) - TO(Longs, dy) * TO(Longs, x - corner_x[a]) - TO(Longs, least);
        w->first[k] = e >> (Longs)(STEP_BITS);
        w->rest[k] = TO(Floats, (TO(Ints, e) & (Ints)(STEP - 1)) + least);
        w->dx[k] = dx, w->dy[k] = dy;
    }
    left = MAX(left - tile_x, (Ints)(0)) / BLOCK, right = MIN(right - tile_x, (Ints)(TILE - 1)) / BLOCK;
    top = MAX(top - tile_y, (Ints)(0)) / BLOCK, bottom = MIN(bottom - tile_y, (Ints)(TILE - 1)) / BLOCK;
    // A row of blocks takes BLOCKS_A_ROW bits. `columns` has the bits of one such row. `rows`, after the mask, has the
    // first bit of each row that is reached. The product repeats the columns in each of these rows.
    Uints columns = ((Uints)(2) << TO(Uints, right)) - ((Uints)(1) << TO(Uints, left));
    Uints rows = ((Uints)(2) << TO(Uints, bottom * BLOCKS_A_ROW)) - ((Uints)(1) << TO(Uints, top * BLOCKS_A_ROW));
    w->blocks = columns * (rows & (Uints)(0x1111u));
    w->many = (right - left + 1) * (bottom - top + 1) > (Ints)(4);
    return MIN(end - at, (uint)WIDE);
}

// One record of a Walks, in registers.
typedef struct {
    long first[3];
    int dx[3], dy[3];
    float rest[3];
    VECTOR(int) step[3];  // F at each pixel of a strip, less F at its first pixel
    bool small;
} Walk;

#define LONG_OF(vector) (((const long *)&(vector))[k])

INLINE void walk_of(const Walks *walks, uint k, Walk *w)
{
    w->small = INT_OF(walks->small);
    UNROLL for (int j = 0; j < 3; ++j) {
        w->first[j] = LONG_OF(walks->first[j]);
        w->dx[j] = INT_OF(walks->dx[j]), w->dy[j] = INT_OF(walks->dy[j]);
        w->rest[j] = FLOAT_OF(walks->rest[j]);
        w->step[j] = (VECTOR(int))(w->dx[j]) * STRIP_Y - (VECTOR(int))(w->dy[j]) * STRIP_X;
    }
}

// The blocks of the lane that record k may cover, a bit each.
INLINE uint blocks_met(const Walks *walks, uint k, const Walk *w, int lane)
{
    uint blocks = (uint)INT_OF(walks->blocks) & LANE_BLOCKS;
#if STRIP == TILE_BLOCKS
    if (INT_OF(walks->many) && w->small) {
        // All 16 blocks at once, one in each element: blocks lie in a tile as pixels lie in a block. A record misses a
        // block if F is negative even at the block's place farthest inside of that edge.
        VECTOR(int) met = (VECTOR(int))(-1);
        UNROLL for (int j = 0; j < 3; ++j) {
            int dx = w->dx[j], dy = w->dy[j];
#if PATTERNED
            // Samples lie up to 3 quarters right and down in their pixels. The first one has some of those down.
            int above = -QUARTERS_DOWN(PATTERN, 0), beyond = (BLOCK - 1) * PIXEL_STEPS + 3;
            int inside = (int)w->first[j] + MAX(dx * above, dx * (beyond + above)) - MIN(dy * beyond, 0);
            VECTOR(int) to_block = (VECTOR(int))(BLOCK * PIXEL_STEPS * dx) * STRIP_ROWS - (VECTOR(int))(BLOCK * PIXEL_STEPS * dy) * STRIP_COLUMNS;
#else
            int inside = (int)w->first[j] + (BLOCK - 1) * (MAX(dx, 0) - MIN(dy, 0));
            VECTOR(int) to_block = w->step[j] * BLOCK;
#endif
            met &= to_block + (VECTOR(int))(inside) >= (VECTOR(int))(0);
        }
        blocks &= BITS_OF(met);
    }
#endif
    return blocks;
}

// Which pixels of the lane's strip of a block are covered: -1, or 0 where not. weight: the barycentric weights there,
// times twice the area in square subpixels.
INLINE VECTOR(int) cover(const Walk *w, int block, VECTOR(float) weight[3])
{
    VECTOR(int) covered = (VECTOR(int))(-1);
    int column = block % BLOCKS_A_ROW * (BLOCK * PIXEL_STEPS), row = block / BLOCKS_A_ROW * (BLOCK * PIXEL_STEPS);
    if (w->small) {
        UNROLL for (int k = 0; k < 3; ++k) {
            VECTOR(int) f = (VECTOR(int))((int)w->first[k] + row * w->dx[k] - column * w->dy[k]) + w->step[k];
            covered &= f >= (VECTOR(int))(0);
            weight[k] = CONVERT(float, STRIP, f) * (float)STEP + w->rest[k];
        }
    } else {
        UNROLL for (int k = 0; k < 3; ++k) {
            long first = w->first[k] + (long)row * w->dx[k] - (long)column * w->dy[k];
            VECTOR(long) f = (VECTOR(long))(first) + CONVERT(long, STRIP, w->step[k]);
            covered &= CONVERT(int, STRIP, f >= (VECTOR(long))(0));
            weight[k] = CONVERT(float, STRIP, f) * (float)STEP + w->rest[k];
        }
    }
    return covered;
}
#else
// Whether the bounds of a record reach a block, which has its first pixel at this column and row of the picture.
INLINE bool reaches(global const Triangle *t, int column, int row)
{
    int left = (int)(t->left_right & 0xFFFF), right = (int)(t->left_right >> 16);
    int top = (int)(t->top_bottom & 0xFFFF), bottom = (int)(t->top_bottom >> 16);
    return left < column + BLOCK && right >= column && top < row + BLOCK && bottom >= row;
}

// Which pixels of the lane's strip are covered: -1, or 0 where not. weight: the barycentric weights there, times twice
// the area in square subpixels. x, y: the strip's first sample.
INLINE VECTOR(int) cover(global const Triangle *t, int x, int y, VECTOR(float) weight[3])
{
    VECTOR(int) covered = (VECTOR(int))(-1);
    UNROLL for (int k = 0; k < 3; ++k) {
        int a = k < 2 ? k + 1 : 0, b = k > 0 ? k - 1 : 2, dx = t->x[b] - t->x[a], dy = t->y[b] - t->y[a];
        int least = dy < 0 || (dy == 0 && dx > 0) ? 0 : 1;
        long e = (long)dx * (y - t->y[a]) - (long)dy * (x - t->x[a]) - least, first = e >> STEP_BITS;
        float rest = (float)(((int)e & (STEP - 1)) + least);
        VECTOR(int) step = dx * STRIP_Y - dy * STRIP_X;
        if (t->flags & SMALL) {
            VECTOR(int) f = (VECTOR(int))((int)first) + step;
            covered &= f >= (VECTOR(int))(0);
            weight[k] = CONVERT(float, STRIP, f) * (float)STEP + rest;
        } else {
            PLAIN_LOOP for (int i = 0; i < STRIP; ++i) {  // rare, and 64 bits side by side take many registers
                long f = first + ELEMENT(int, step, i);
                if (f < 0) SET_ELEMENT(int, covered, i, 0);
                SET_ELEMENT(float, weight[k], i, (float)f * (float)STEP + rest);
            }
        }
    }
    return covered;
}
#endif

#if FRAGMENT_COLOR
// Between VISITS and END_VISITS: the weights at which to shade SHADED pixels of the strip, from number `first` on. face:
// of the record.
#if PATTERNED && LANES == 1
#define WEIGHTS_TO_SHADE(first, face, at) to_shade(&w, block, weight, first, face, at)
INLINE void to_shade(const Walk *w, int block, const VECTOR(float) weight[3], int first, const Face *face, Reals at[3])
{
    int column = block % BLOCKS_A_ROW * (BLOCK * PIXEL_STEPS), row = block / BLOCKS_A_ROW * (BLOCK * PIXEL_STEPS);
    bool samples = shades_samples(face);
    UNROLL for (int k = 0; k < 3; ++k) {
        long f = w->first[k] + (long)row * w->dx[k] - (long)column * w->dy[k];
        if (samples) at[k] = SAMPLES_OF(weight[k], first);
        else at[k] = weight_at_centre(f, w->rest[k], w->dx[k], w->dy[k], w->small, first);
    }
}
#elif PATTERNED
#define WEIGHTS_TO_SHADE(first, face, at)                                                                       \
    to_shade(t, tile_x + block % BLOCKS_A_ROW * BLOCK, tile_y + block / BLOCKS_A_ROW * BLOCK, width, height, weight, \
             first, FIRST_PIXEL, face, at)
INLINE void to_shade(global const Triangle *t, int column, int row, int width, int height, const VECTOR(float) weight[3],
                     int first, int first_pixel, const Face *face, Reals at[3])
{
    if (shades_samples(face)) {
        UNROLL for (int k = 0; k < 3; ++k) at[k] = SAMPLES_OF(weight[k], first);
    } else {
        int x = SAMPLE_X(column, 0, width, PATTERN), y = SAMPLE_Y(0, row, height, PATTERN);
        weights_at_centres(t, x, y, first_pixel + first, at);
    }
}
#else
#define WEIGHTS_TO_SHADE(first, face, at) UNROLL for (int j = 0; j < 3; ++j) at[j] = SAMPLES_OF(weight[j], first)
#endif

// Where these pixels are seen.
#define SIGHT(first, face)                                                                                      \
    sight_of(shades_samples(face), tile_x + block % BLOCKS_A_ROW * BLOCK, tile_y + block / BLOCKS_A_ROW * BLOCK, \
             FIRST_PIXEL + (first), width, height)

#if PATTERNED && LANES == 1
// Numbers of colours for a block's samples: one for each of the picture's pixels of which `corners` has the upper left
// sample, from `painted` on. Each byte of `before` says how many are before a pixel.
INLINE VECTOR(uint) numbers_of(uint corners, uint painted)
{
    const uint across = BLOCK / SHOWN_COLUMNS, pixels = across * (BLOCK / SHOWN_ROWS);
    uint before = 0;
    UNROLL for (uint p = 0; p + 1 < pixels; ++p)
        before += (corners >> (p / across * SHOWN_ROWS * BLOCK + p % across * SHOWN_COLUMNS) & 1) * (0x01010100u << 8 * p);
    VECTOR(int) pixel = STRIP_ROWS / SHOWN_ROWS * (int)across + STRIP_COLUMNS / SHOWN_COLUMNS;
    return ((VECTOR(uint))(before) >> PASTE(as_, VECTOR(uint))(pixel * 8) & (VECTOR(uint))(255)) + painted;
}
#endif
#endif

// Which pixels of a strip are in the image: -1, or 0 where not. A tile at the right or lower border may reach beyond
// the image, and so may a triangle. columns_left, rows_left: pixels from the tile's first pixel to the border.
INLINE VECTOR(int) in_image(int block, int lane, int columns_left, int rows_left)
{
    int column = block % BLOCKS_A_ROW * BLOCK + FIRST_PIXEL % BLOCK, row = block / BLOCKS_A_ROW * BLOCK + FIRST_PIXEL / BLOCK;
#if CPU_TARGET
    return STRIP_COLUMNS < (VECTOR(int))(columns_left - column) & STRIP_ROWS < (VECTOR(int))(rows_left - row);
#else
    uint bits = 0;
    UNROLL for (int k = 0; k < STRIP; ++k)
        bits |= (uint)(k % BLOCK < columns_left - column && k / BLOCK < rows_left - row) << k;
    return MASK_OF(bits);
#endif
}

// --- the walk itself ------------------------------------------------------------------------------------------------
// The records of a batch of tiles: those of a tile are triangles[pairs[pair_start[tile]]] and so on.
typedef struct {
    global const Triangle *triangles;
    global const uint *pair_start, *pairs;
    Screen screen;
} Batch;

#define VIEW(batch) ((float3)((batch)->screen.view[0], (batch)->screen.view[1], (batch)->screen.view[2]))

// What every walk begins with. batch: a pointer to its records. tile: its number in the batch. It sets list_begin and list_end, the places in `pairs` to
// visit; tile_x and tile_y, the tile's first pixel; first_x and first_y, those of FIRST_BLOCK in the tile; x and y, the
// lane's first sample in it, in subpixels from the image's centre; and `beyond`, whether the tile reaches beyond the
// image.
#define ENTER_TILE                                                                                              \
    int lane = LANE_IN(tile), width = batch->screen.width, height = batch->screen.height;                                \
    uint list_begin = batch->pair_start[tile], list_end = batch->pair_start[tile + 1];                          \
    uint tile_number = batch->screen.first_tile + tile;                                                         \
    int tile_x = (int)(tile_number % batch->screen.columns) * TILE;                                             \
    int tile_y = (int)(tile_number / batch->screen.columns) * TILE;                                             \
    int first_x = FIRST_BLOCK % BLOCKS_A_ROW * BLOCK, first_y = FIRST_BLOCK / BLOCKS_A_ROW * BLOCK;              \
    int x = SAMPLE_X(tile_x + first_x + FIRST_PIXEL % BLOCK, FIRST_PIXEL / BLOCK, width, PATTERN);              \
    int y = SAMPLE_Y(FIRST_PIXEL % BLOCK, tile_y + first_y + FIRST_PIXEL / BLOCK, height, PATTERN);             \
    bool beyond = tile_x + TILE > width || tile_y + TILE > height;

// Visits the `wanted` blocks (a bit each) that a record of the tile may cover, record by record in submission order.
// The code between VISITS and END_VISITS has these names:
//   place      of the record in `pairs`
//   t          the record
//   block      the block's number, 0 .. 15
//   covered    which pixels of the lane's strip of this block the record covers: -1, or 0 where not
//   weight     their barycentric weights, times twice the area
#if LANES <= TILE_BLOCKS
#define VISITS(wanted)                                                                                          \
    for (uint at = list_begin; at < list_end; at += WIDE) {                                                     \
        Walks walks;                                                                                            \
        uint ready = ready_walks(batch->triangles, batch->pairs, at, list_end, x, y, tile_x, tile_y, &walks);   \
        for (uint n = 0; n < ready; ++n) {                                                                      \
            if (!((uint)((const int *)&walks.blocks)[n] & (wanted) & LANE_BLOCKS)) continue;                    \
            Walk w;                                                                                             \
            walk_of(&walks, n, &w);                                                                             \
            uint place = at + n;                                                                                \
            global const Triangle *t = batch->triangles + batch->pairs[place];                                  \
            for (uint left = blocks_met(&walks, n, &w, lane) & (wanted); left; left &= left - 1) {              \
                int block = LOWEST_BIT(left);                                                                   \
                VECTOR(float) weight[3];                                                                        \
                VECTOR(int) covered = cover(&w, block, weight);                                                 \
                if (beyond) covered &= in_image(block, lane, width - tile_x, height - tile_y);
#define END_VISITS                                                                                              \
            }                                                                                                   \
        }                                                                                                       \
    }
#else
#define VISITS(wanted)                                                                                          \
    for (uint place = list_begin; place < list_end; ++place) {                                                  \
        global const Triangle *t = batch->triangles + batch->pairs[place];                                      \
        if (!(LANE_BLOCKS & (wanted)) || !reaches(t, tile_x + first_x, tile_y + first_y)) continue;             \
        const int block = FIRST_BLOCK;                                                                          \
        VECTOR(float) weight[3];                                                                                \
        VECTOR(int) covered = cover(t, x, y, weight);                                                           \
        if (beyond) covered &= in_image(block, lane, width - tile_x, height - tile_y);
#define END_VISITS }
#endif

// The depth keys of a strip's pixels. The depth is that of the record's plane, clamped to the depths of the exact
// triangle.
INLINE VECTOR(uint) keys_of(global const Triangle *t, const VECTOR(float) weight[3], float depth_scale)
{
    VECTOR(float) depth = t->depth[0] + (weight[1] * t->depth[1] + weight[2] * t->depth[2]) * t->inverse_area;
    depth = MAX(depth, (VECTOR(float))(t->depth_min));
    depth = MIN(depth, (VECTOR(float))(t->depth_max));
    return depth_key(depth, depth_scale);
}

// The colours of a strip's fragments whose colours are not stored with them. payload: the fragment's face, where faces
// have one colour; else the place of its record in `pairs`, and the colour is computed here. Pixels whose payload is
// that of ABSENT get 0, alpha too.
INLINE void colors_of(VECTOR(uint) payload, int strip, int tile_x, int tile_y, const Batch *batch, const Shading *shading,
                      Colors *colors)
{
#if FRAGMENT_COLOR
    for (int first = 0; first < STRIP; first += SHADED) {
        uint left = 0;
        for (int k = 0; k < SHADED; ++k) {
            int own = first + k;
            SET_ELEMENT(float, colors->red, own, 0.0f), SET_ELEMENT(float, colors->green, own, 0.0f);
            SET_ELEMENT(float, colors->blue, own, 0.0f), SET_ELEMENT(float, colors->alpha, own, 0.0f);
            left |= (uint)(ELEMENT(uint, payload, own) != (uint)ABSENT) << k;
        }
        while (left) {  // one record a turn; mostly there is only one
            uint at = ELEMENT(uint, payload, first + LOWEST_SHADED(left)), same = 0;
            global const Triangle *t = batch->triangles + batch->pairs[at];
            for (int k = 0; k < SHADED; ++k) same |= (uint)(ELEMENT(uint, payload, first + k) == at) << k;
            int pixel = strip * STRIP + first, block = pixel / BLOCK_PIXELS, in_block = pixel % BLOCK_PIXELS;
            int column = tile_x + block % BLOCKS_A_ROW * BLOCK, row = tile_y + block / BLOCKS_A_ROW * BLOCK;
            Face face;
            face_of(t, batch->pairs[at], shading, &face);
            Reals weight[3];
            bool samples = shades_samples(&face);
            int right = samples ? in_block % BLOCK : 0, down = samples ? in_block / BLOCK : 0;
            int x = SAMPLE_X(column + right, row + down, batch->screen.width, PATTERN);
            int y = SAMPLE_Y(column + right, row + down, batch->screen.height, PATTERN);
#if PATTERNED
            if (!samples) weights_at_centres(t, x, y, in_block, weight);
            else
#endif
                weights_at(t, x, y, weight);
            OnFace on_face;
            place_on_face(weight, &face, &on_face);
            float4 colors_there[SHADED];
            left &= ~same;
#if PATTERNED && SHADED > 1
            uint alike = samples ? 1 : FIRST_SHOWN, wanted = same;  // samples that have the same colour as a wanted one
            if (!samples) wanted = corners_of(same);
#else
            uint alike = 1, wanted = same;
#endif
            Sight sight = sight_of(samples, column, row, in_block, batch->screen.width, batch->screen.height);
            wanted = shade(&face, &on_face, shading, VIEW(batch), &sight, wanted, colors_there);
            for (const float4 *next = colors_there; wanted; wanted &= wanted - 1, ++next) {
                float4 color = *next;
                for (uint bits = alike << LOWEST_SHADED(wanted) & same; bits; bits &= bits - 1) {
                    int own = first + LOWEST_SHADED(bits);
                    SET_ELEMENT(float, colors->red, own, color.x), SET_ELEMENT(float, colors->green, own, color.y);
                    SET_ELEMENT(float, colors->blue, own, color.z), SET_ELEMENT(float, colors->alpha, own, color.w);
                }
            }
        }
    }
#else
    VECTOR(ulong) fragment = CONVERT(ulong, STRIP, payload);
    fetch_colors(&fragment, 1, shading->palette, colors);
#endif
}

// --- fragments to memory --------------------------------------------------------------------------------------------
// Where a walk writes fragments. Each pixel has a counter, `next`: the place of its next fragment, relative to where
// its strip begins. It grows by `step`. Strip s begins at s * strip_room. A fragment whose place is not below `room` is
// skipped, so a `next` that starts beyond it, or below zero, skips all fragments of its pixel.
//
//   rows     next = IOTA, step = STRIP, room = strip_room = what a strip has room for
//   lists    next = where the pixel's list begins, step = 1, room = what all lists have room for, strip_room = 0
typedef struct { uint step, room, strip_room; } Layout;

// Emits the fragments of a tile's records, from place `begin` of `pairs` on, in these blocks (a bit each). If surfaces
// are MIXED, only those in front of z_far are emitted (stages/opaque.h); with BEHIND, those of edges behind it. At the end
// each `next` is what it would be with room for all, so it tells how many fragments there are. sources: where fragments
// have colours of their own, receives their faces; NULL if nobody wants them.
//
// Fragments of a record in one of the picture's pixels may share a colour (shades_samples). Where a lane works alone, it
// computes that once, and numbers colours as they come, from 0 on. So they grow with submission, too, and there are no
// more of them than fragments. Several lanes compute it for each fragment, which gives the same bits.
INLINE void emit_tile(const Batch *batch, const Shading *shading, uint tile, uint begin, uint blocks,
                      KEPT_MEMORY const VECTOR(ulong) *z_far, const Layout *layout, VECTOR(uint) *next, global ulong *fragments,
                      global float4 *colors, global uint *sources)
{
    ENTER_TILE
    list_begin = begin;
#if FRAGMENT_COLOR
    Face face;
    uint prepared = ~0u;  // the place of the record whose face it is
    uint asked_for = list_begin;  // the end of those whose faces are on their way
#endif
#if PAINTED && LANES == 1
    Waiting waiting;
    waiting.count = 0, waiting.material = 0;
#endif
#if PATTERNED && LANES == 1
    uint painted = 0;  // how many colours there are
#endif
    VISITS(blocks)
    VECTOR(ulong) value = CONVERT(ulong, STRIP, keys_of(t, weight, batch->screen.depth_scale)) << (VECTOR(ulong))(32);
#if MIXED
    VECTOR(ulong) submitted = value | (VECTOR(ulong))((ulong)t->source), far = z_far[OWN(block) * LANES + lane];
    covered &= CONVERT(int, STRIP, BEHIND ? submitted > far : submitted < far);
#endif
    VECTOR(uint) *places = next + OWN(block);
    uint strip_start = (uint)(OWN(block) * LANES + lane) * layout->strip_room;
#if FRAGMENT_COLOR
    uint all = BITS_OF(covered), there = all;
    if (LANES == 1 && place >= asked_for) {
        asked_for = MIN(place + WIDE, list_end);
        prefetch_faces(batch->triangles, batch->pairs, place, asked_for, shading);
    }
    if (!all) continue;  // before anything is done for a face that is nowhere in front
    if (LANES > 1 || place != prepared) face_of(t, batch->pairs[place], shading, &face), prepared = place;
#if BEHIND
    if (!IS_WIRED(&face)) continue;
#endif
    VECTOR(uint) own = *places + (VECTOR(uint))(strip_start);
    uint fits = BITS_OF(*places < (VECTOR(uint))(layout->room));
#if PATTERNED && LANES == 1
    bool samples = shades_samples(&face);
    uint wanted = samples ? all : corners_of(all & fits);
    if (!samples) own = numbers_of(wanted, painted), painted += POPCOUNT(wanted);
#else
    uint wanted = all;
#endif
    for (int first = 0; first < STRIP; first += SHADED) {
        uint bits = wanted >> first & SHADED_BITS;
        if (!bits) continue;
        Reals to_shade_at[3];
        WEIGHTS_TO_SHADE(first, &face, to_shade_at);
        OnFace on_face;
        place_on_face(to_shade_at, &face, &on_face);
        Sight sight = SIGHT(first, &face);
#if PAINTED && LANES == 1
        bool plain = !IS_WIRED(&face);
        if (plain && face.material && WAITS(face.material)) {
            if (face.material != waiting.material || waiting.count > WAITING - SHADED)
                paint_all(&waiting, shading, colors);
            Words to = ((const Words *)&own)[first / SHADED];
#if !PATTERNED
            bits &= fits >> first;
#endif
            Light light = light_on(&face, &on_face, shading, VIEW(batch), &sight);
            let_wait(&face, &on_face, &light, bits, to, &waiting);
            continue;
        }
#endif
#if PAINTED | WIRES
        float4 colors_there[SHADED];
        uint seen = shade(&face, &on_face, shading, VIEW(batch), &sight, bits, colors_there);
        there &= ~((bits & ~seen) << first);
        for (const float4 *color = colors_there; seen; seen &= seen - 1, ++color) {
            uint k = first + LOWEST_SHADED(seen);
#if PATTERNED && LANES == 1
            if (samples && !(fits >> k & 1)) continue;
            if (samples) SET_ELEMENT(uint, own, k, painted++);
#else
            if (!(fits >> k & 1)) continue;
#endif
            colors[ELEMENT(uint, own, k)] = *color;
        }
#else
        Light light = light_on(&face, &on_face, shading, VIEW(batch), &sight);
#if !PATTERNED || LANES > 1
        bits &= fits >> first;
#endif
        for (; bits; bits &= bits - 1) {
            int k = LOWEST_SHADED(bits);
            colors[ELEMENT(uint, own, first + k)] = plain_color(&face, &on_face, &light, k);
        }
#endif
    }
    for (uint left = sources ? there & fits : 0; left; left &= left - 1)
        sources[ELEMENT(uint, own, LOWEST_BIT(left))] = t->source;
    if (ROUTED) covered = MASK_OF(there);
    VECTOR(uint) to = *places;
    value |= CONVERT(ulong, STRIP, PAYLOADS_OF(own, t));
    *places += PASTE(as_, VECTOR(uint))(covered) & layout->step;
    scatter(fragments + strip_start, to, covered & (to < (VECTOR(uint))(layout->room)), value);
#else
    VECTOR(uint) to = *places;
    *places += PASTE(as_, VECTOR(uint))(covered) & layout->step;
    value |= (VECTOR(ulong))((ulong)PAYLOAD(t->source, t));
    scatter(fragments + strip_start, to, covered & (to < (VECTOR(uint))(layout->room)), value);
#endif
    END_VISITS
#if PAINTED && LANES == 1
    paint_all(&waiting, shading, colors);
#endif
}

#endif
