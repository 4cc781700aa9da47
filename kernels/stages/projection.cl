// Projection: turns scene triangles into records of snapped screen triangles (stages/projection.h).
//
//   project_vertices    WIDE vertices a work-item: to clip space in pairs of floats, then snapped to 1/256 pixel
//   (stages/expand.cl then writes the corners of lines and points, behind the vertices)
//   cull_triangles      WIDE faces a work-item: finds what each needs, which is DRAWN where it may cover a sample
//   count_states        a chunk of faces a work-item: counts faces that are DRAWN or CLIPPED, CLIPPED, and DISCARDED
//   list_triangles      a chunk of faces a work-item: lists faces that are DRAWN or CLIPPED, and which are CLIPPED
//   setup_triangles     WIDE listed faces a work-item: writes their records, in the order of the list
//
// The list has the opaque faces first, then the transparent ones, each kind in submission order. The lists of tiles
// have the same order, so opaque surfaces can be drawn first.
//
// Most faces of a fine mesh lie between the samples. Their corners are examined once, and they cost nothing after that.
// A work-item's elements past the last item repeat the last one, and write into padding.
#include "stages/projection.h"

// --- vertices -------------------------------------------------------------------------------------------------------
// Which planes vertices are outside of, a bit each. This rounds once more than plane_distance() in stages/clipping.cl.
// So for a vertex within a rounding of a plane, one of them may say outside and the other inside. Clipping then cuts at
// the vertex.
INLINE Uints outcode_of(const ClipVertex *v, DepthRange depth)
{
    Floats guard = v->w.hi * GUARD_BAND;
    const Uints zero = (Uints)(0);
    return (v->z.hi > v->w.hi * depth.near ? (Uints)(OUT_NEAR) : zero) |
           (v->z.hi < v->w.hi * depth.far ? (Uints)(OUT_FAR) : zero) | (v->x.hi < -guard ? (Uints)(OUT_LEFT) : zero) |
           (v->x.hi > guard ? (Uints)(OUT_RIGHT) : zero) | (v->y.hi < -guard ? (Uints)(OUT_TOP) : zero) |
           (v->y.hi > guard ? (Uints)(OUT_BOTTOM) : zero);
}

kernel void project_vertices(global const float *positions, global const float *low_positions,
                             global const float *matrix, float depth_near, float depth_far, uint vertex_count,
                             global Vertex *vertices)
{
    const DepthRange depth = {depth_near, depth_far};
    uint first = get_global_id(0) * WIDE;
    if (first >= vertex_count) return;
    Point point;
    Uints vertex = items_from(first, vertex_count);
    UNROLL for (int j = 0; j < 3; ++j) {
        point.high[j] = AS_FLOATS(GATHER(positions + j, 1, 3 * vertex));
        if (LOW_POSITIONS) point.low[j] = AS_FLOATS(GATHER(low_positions + j, 1, 3 * vertex));
    }
    ClipVertex v;
    to_clip_space(matrix, &point, &v);
    Corner corner;
    to_screen(&v, &corner);
    // A NaN or infinity in any coordinate makes this sum one. Positions are below 2^61, so the sum itself cannot
    // overflow.
    Uints outcode = IS_FINITE((point.high[0] + point.high[1]) + point.high[2]) ? outcode_of(&v, depth) : (Uints)(NOT_FINITE);
    FOR_EACH_ELEMENT {
        vertices[first + k].x = INT_OF(corner.x);
        vertices[first + k].y = INT_OF(corner.y);
        vertices[first + k].offset_x = FLOAT_OF(corner.offset_x);
        vertices[first + k].offset_y = FLOAT_OF(corner.offset_y);
        vertices[first + k].depth = FLOAT_OF(corner.depth);
        vertices[first + k].outcode = (uint)INT_OF(outcode);
    }
}

// --- faces ----------------------------------------------------------------------------------------------------------
// Whether triangles cover a sample, for those whose bounds have at most 2 x 2 samples: their edge functions
// (stages/walk.h) are evaluated at each. For larger triangles the result means nothing. flip: where the corners run the
// other way.
OUTLINE Ints covers_a_sample(const Ints *x, const Ints *y, Ints flip, const Reach *reach, int width, int height,
                             uint pattern)
{
    Ints covers = (Ints)(0), right_of[2], below[2];  // where samples lie in these rows, and in these columns
    UNROLL for (int s = 0; s < 2; ++s) {
        right_of[s] = below[s] = (Ints)(0);
        if (pattern == (uint)REGULAR) continue;
        Ints row = (reach->top + s & 3) * 2, column = (reach->left + s & 3) * 2 + 8;
        right_of[s] = ((Ints)((int)(pattern & 0xFFFF)) >> row & 3) * (SUBPIXELS / 4);
        below[s] = ((Ints)((int)(pattern & 0xFFFF)) >> column & 3) * (SUBPIXELS / 4);
    }
    UNROLL for (int s = 0; s < 4; ++s) {
        Ints column = reach->left + (Ints)(s % 2), row = reach->top + (Ints)(s / 2);
        Ints here = (column <= reach->right) & (row <= reach->bottom);
        UNROLL for (int a = 0; a < 3; ++a) {
            int b = a < 2 ? a + 1 : 0;
            Ints dx = x[b] - x[a], dy = y[b] - y[a];
            dx = flip ? -dx : dx, dy = flip ? -dy : dy;
            // Unsigned, because the products may wrap for larger triangles, whose result is not used.
            Uints down = AS_UINTS(PLACE_AT(row, height, FIRST_Y(pattern)) + below[s % 2] - y[a]);
            Uints right = AS_UINTS(PLACE_AT(column, width, FIRST_X(pattern)) + right_of[s / 2] - x[a]);
            Ints e = AS_INTS(AS_UINTS(dx) * down - AS_UINTS(dy) * right);
            Ints owned = (dy < (Ints)(0)) | ((dy == (Ints)(0)) & (dx > (Ints)(0)));
            here &= (e > (Ints)(0)) | ((e == (Ints)(0)) & owned);
        }
        covers |= here;
    }
    return covers;
}

// A field of vertices. A vertex is three times two numbers long, and GATHER takes steps of two.
#define VERTEX_FIELD(name, at) GATHER(&vertices->name, 2, 3 * (at))

// Whether all alphas of faces are one. colors: of which the palette has the colours, of all faces together (0), of each face
// (1), or of each vertex (3). packed: it has 4 bytes for each, instead of 4 floats. vertex: the vertices at the faces'
// corners.
OUTLINE Ints is_opaque(global const void *palette, int colors, int packed, Uints face, const Uints *vertex)
{
    Ints opaque = (Ints)(-1);
    PLAIN_LOOP for (int j = 0; j < MAX(colors, 1); ++j) {
        Uints place = colors == 3 ? vertex[j] : colors == 1 ? face : (Uints)(0);
        if (packed) opaque &= GATHER(palette, 1, place) >> (Uints)(24) == (Uints)(255);
        else opaque &= AS_FLOATS(GATHER((global const float *)palette + 3, 2, 2 * place)) == (Floats)(1.0f);
    }
    return opaque;
}

// first_band: the first face that is a band (stages/wires.cl): these are not opaque, and have two sides.
kernel void cull_triangles(global const uint *faces, uint face_count, uint first_band, uint vertex_count,
                           global const Vertex *vertices, int width, int height, uint pattern, global const void *palette, int colors, int packed,
                           global const uchar *single_sided, int all_single_sided, global uchar *states)
{
    uint first = get_global_id(0) * WIDE;
    if (first >= face_count) return;
    Ints x[3], y[3];
    Uints outcode[3], corner[3], face = items_from(first, face_count);
    UNROLL for (int j = 0; j < 3; ++j) {
        Uints given = GATHER(faces + j, 1, 3 * face), vertex = MIN(given, (Uints)(vertex_count - 1));
        corner[j] = vertex;
        x[j] = AS_INTS(VERTEX_FIELD(x, vertex)), y[j] = AS_INTS(VERTEX_FIELD(y, vertex));
        // The host refuses faces whose vertices do not exist. Here the index is limited only so that no foreign memory
        // is read.
        outcode[j] = given == vertex ? VERTEX_FIELD(outcode, vertex) : (Uints)(NOT_FINITE);
    }
    Reach reach;
    reach_of(x, y, width, height, pattern, &reach);
    Longs area = area_of(x, y);
    Ints drawn = (reach.left <= reach.right) & (reach.top <= reach.bottom) & TO(Ints, area != (Longs)(0));
    Ints few = (reach.right - reach.left < (Ints)(2)) & (reach.bottom - reach.top < (Ints)(2));
    drawn &= !few | covers_a_sample(x, y, TO(Ints, area < (Longs)(0)), &reach, width, height, pattern);
    Uints any = outcode[0] | outcode[1] | outcode[2], all = outcode[0] & outcode[1] & outcode[2];
    const Uints zero = (Uints)(0);
    Uints state = (any & (Uints)(NOT_FINITE)) != zero ? (Uints)(DISCARDED)
                  : all != zero                       ? zero
                  : any != zero                       ? (Uints)(CLIPPED)
                  : drawn                             ? (Uints)(DRAWN)
                                                      : zero;
    Ints listed = (state == (Uints)(DRAWN)) | (state == (Uints)(CLIPPED));
    Ints band = face >= (Uints)(first_band);
    if (palette) {
        UNROLL for (int j = 0; j < 3; ++j) corner[j] = band ? zero : corner[j];
        Ints opaque = is_opaque(palette, colors, packed, band ? zero : face, corner);
        state |= (opaque & listed & !band) ? (Uints)(OPAQUE) : zero;
    }
    // Corners that run clockwise show the face from behind. Of clipped faces each piece is examined (stages/clipping.cl).
    if (single_sided || all_single_sided) {
        Ints behind = TO(Ints, area > (Longs)(0)) & !band & ((state & (Uints)(DRAWN | CLIPPED | DISCARDED)) == (Uints)(DRAWN));
        FOR_EACH_ELEMENT
            if (INT_OF(behind) && (all_single_sided || single_sided[INT_OF(face)])) ((uint *)&state)[k] = 0;
    }
    FOR_EACH_ELEMENT states[first + k] = (uchar)INT_OF(state);
}

// --- lists of faces -------------------------------------------------------------------------------------------------
// Five numbers for each chunk: opaque faces to be listed, and how many of them are CLIPPED (both 0 unless surfaces are
// MIXED); other faces to be listed, and how many of them are CLIPPED; and DISCARDED faces.
kernel void count_states(global const uchar *states, uint face_count, uint chunk_faces, global uint *chunk_counts)
{
    uint chunk = get_global_id(0), first = chunk * chunk_faces, last = MIN(first + chunk_faces, face_count);
    uint opaque_listed = 0, opaque_clipped = 0, listed = 0, clipped = 0, discarded = 0;
    for (uint face = first; face < last; ++face) {
        uint state = states[face];
        opaque_listed += state == (DRAWN | OPAQUE) || state == (CLIPPED | OPAQUE);
        opaque_clipped += state == (CLIPPED | OPAQUE);
        listed += state == DRAWN || state == CLIPPED;
        clipped += state == CLIPPED;
        discarded += state == DISCARDED;
    }
    global uint *counts = chunk_counts + 5 * chunk;
    counts[0] = opaque_listed, counts[1] = opaque_clipped, counts[2] = listed, counts[3] = clipped, counts[4] = discarded;
}

// kind: OPAQUE, or 0 for the transparent faces. chunk_starts: where the chunk's faces of that kind begin in the two
// lists, `listed` and `clipped`. listed: faces. clipped: places in `listed`.
kernel void list_triangles(global const uchar *states, uint face_count, uint chunk_faces, uint kind,
                           global const uint2 *chunk_starts, global uint *listed, global uint *clipped)
{
    uint chunk = get_global_id(0), first = chunk * chunk_faces, last = MIN(first + chunk_faces, face_count);
    uint2 next = chunk_starts[chunk];
#if LANES > 1
    for (uint face = first; face < last; ++face) {
        uint state = states[face];
        if (state != (DRAWN | kind) && state != (CLIPPED | kind)) continue;
        if (state == (CLIPPED | kind)) clipped[next.y++] = next.x;
        listed[next.x++] = face;
    }
#else
    for (uint from = first; from < last; from += LIST_RUN) {
        // Every face is written, and the next one overwrites it if it is not wanted. So there is no branch to
        // mispredict.
        uint run[LIST_RUN + 1], count = 0;
        for (uint face = from; face < MIN(from + LIST_RUN, last); ++face) {
            run[count] = face;
            count += states[face] == (DRAWN | kind) || states[face] == (CLIPPED | kind);
        }
        for (uint k = 0; k < count; ++k) {
            if (states[run[k]] == (CLIPPED | kind)) clipped[next.y++] = next.x + k;
            listed[next.x + k] = run[k];
        }
        next.x += count;
    }
#endif
}

// Along lines colours are interpolated by place, from one end to the other, wherever the corners are that a line was given
// (stages/expand.cl). So a corner of a line's triangle has a share of both ends, which any two corners of the triangle
// stand for that belong to these. line_vertex: the first vertex of lines. ends: how many vertices an end has.
INLINE void line_shares(const uint vertex[3], const float depth[3], int perspective, uint line_vertex, uint ends,
                        global const float *places, float share[3][3])
{
    int of[2] = {-1, -1};
    for (int j = 0; j < 3; ++j) of[(vertex[j] - line_vertex) / ends % 2] = j;
    if (of[0] < 0 || of[1] < 0) return;  // all of them belong to one end
    for (int i = 0; i < 3; ++i) {
        float there = places[vertex[i] - line_vertex], scale = perspective ? depth[i] : 1.0f;
        for (int j = 0; j < 3; ++j) share[i][j] = j == of[0] ? (1.0f - there) * scale : j == of[1] ? there * scale : 0.0f;
    }
}

// --- records --------------------------------------------------------------------------------------------------------
// first_line, first_point, first_ball: the first face of lines, of points, and of points that are balls. places: of the
// vertices of lines, how far along they are, 0 .. 1; NULL if there are none.
kernel void setup_triangles(global const uint *faces, uint vertex_count, global const Vertex *vertices,
                            global const uint *listed, uint listed_count, uint opaque_count, int width, int height, uint pattern,
                            int perspective, uint first_line, uint first_point, uint first_ball, uint line_vertex, uint ends,
                            global const float *places, global Triangle *triangles, global ushort4 *bounds,
                            global float *weights)
{
    uint first = get_global_id(0) * WIDE;
    if (first >= listed_count) return;
    Uints place = items_from(first, listed_count), source = GATHER(listed, 1, place);
    Corner corner[3];
    UNROLL for (int j = 0; j < 3; ++j) {
        Uints vertex = MIN(GATHER(faces + j, 1, 3 * source), (Uints)(vertex_count - 1));
        corner[j].x = AS_INTS(VERTEX_FIELD(x, vertex)), corner[j].y = AS_INTS(VERTEX_FIELD(y, vertex));
        corner[j].offset_x = AS_FLOATS(VERTEX_FIELD(offset_x, vertex));
        corner[j].offset_y = AS_FLOATS(VERTEX_FIELD(offset_y, vertex));
        corner[j].depth = AS_FLOATS(VERTEX_FIELD(depth, vertex));
    }
    Arrangement arrangement;
    Uints flags = place < (Uints)(opaque_count) ? (Uints)(OPAQUE) : (Uints)(0);
    Uints turned = source < (Uints)(first_ball) ? (Uints)(TURNED) : (Uints)(0);
    flags |= source < (Uints)(first_line) ? (Uints)(0) : turned;
    make_triangles(corner, source, flags, width, height, pattern, first, triangles, bounds, &arrangement);
    if (!weights) return;
    Floats share[3][3];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            share[i][j] = i != j ? (Floats)(0.0f) : perspective ? corner[i].depth : (Floats)(1.0f);
    if (places) FOR_EACH_ELEMENT {
        uint face = INT_OF(source);
        if (face < first_line || face >= first_point) continue;
        uint vertex[3] = {faces[3 * face], faces[3 * face + 1], faces[3 * face + 2]};
        float depth[3], own[3][3];
        for (int i = 0; i < 3; ++i) {
            depth[i] = FLOAT_OF(corner[i].depth);
            for (int j = 0; j < 3; ++j) own[i][j] = FLOAT_OF(share[i][j]);
        }
        line_shares(vertex, depth, perspective, line_vertex, ends, places, own);
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) FLOAT_OF(share[i][j]) = own[i][j];
    }
    store_weights(weights, first, &arrangement, share);
}
