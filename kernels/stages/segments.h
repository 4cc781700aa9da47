// Segments: lines in clip space, cut by its planes, and where they are on the screen. Lines (stages/expand.cl) and edges
// (stages/wires.cl) share them. Work-items that use them take one item each.
#ifndef SEGMENTS_H
#define SEGMENTS_H

#undef WIDE
#define WIDE 1
#include "stages/planes.h"

// Segments are cut at a band that leaves room for their width up to the guard band: the tip of a mitre, or of a band, is at
// most four halves of a width away from its joint (stages/expand.cl, MITRE_LIMIT; stages/wires.cl, TIP_LIMIT).
#define CUT_BAND (GUARD_BAND / 4 * 3)
#define MOST_HALF (MOST_WIDTH / 2 * SUBPIXELS)

// A place on the screen: subpixels from the image's centre, and depth.
typedef struct { Pair x, y; float depth; } Place;

// The way from one place to another: its direction, of length 1, and how long it is. Ways, widths and joints are counted in
// subpixels of a pixel's height. `across` times as many make the same length across, where samples lie closer together.
typedef struct { float x, y, length; } Way;

// A vertex of the scene in clip space.
INLINE void vertex_in_clip_space(global const float *positions, global const float *low_positions, global const float *matrix,
                                 uint vertex, ClipVertex *v)
{
    Point point;
    for (int j = 0; j < 3; ++j) {
        point.high[j] = positions[3 * vertex + j];
        if (LOW_POSITIONS) point.low[j] = low_positions[3 * vertex + j];
    }
    to_clip_space(matrix, &point, v);
}

INLINE void place_of(const ClipVertex *v, Place *place)
{
    Pair depth;
    pair_div(&v->x, &v->w, &place->x);
    pair_div(&v->y, &v->w, &place->y);
    pair_div(&v->z, &v->w, &depth);
    place->depth = depth.hi;
}

// The way to a point that may lie behind the eye; then it has no end. Returns whether there is a way.
INLINE bool way_to(const Place *from, const ClipVertex *to, float across, Way *way)
{
    Pair x, y;
    pair_mul(&from->x, &to->w, &x);
    pair_sub(&to->x, &x, &x);
    pair_mul(&from->y, &to->w, &y);
    pair_sub(&to->y, &y, &y);
    float level = x.hi / across, most = MAX(fabs(level), fabs(y.hi));
    if (!(most > 0.0f) || !IS_FINITE(most)) return false;
    float right = level / most, down = y.hi / most, length = sqrt(right * right + down * down);
    way->x = right / length, way->y = down / length;
    way->length = to->w.hi > 0.0f ? most * length / to->w.hi : MAXFLOAT;
    return true;
}

INLINE bool is_less(const Pair *a, const Pair *b) { return a->hi < b->hi || (a->hi == b->hi && a->lo < b->lo); }

// What is left of a segment between the planes: its ends, and their places along it, 0 .. 1. cut: whether planes made
// them.
typedef struct { ClipVertex end[2]; float place[2]; bool cut[2]; } Segment;

// Cuts a segment (Liang and Barsky). Returns whether anything is left.
static bool cut_segment(const ClipVertex *a, const ClipVertex *b, DepthRange depth, Segment *segment)
{
    Pair from = {0.0f, 0.0f}, to = {1.0f, 0.0f};
    int from_plane = -1, to_plane = -1;
    for (int plane = 0; plane < 6; ++plane) {
        Pair da, db, t;
        plane_distance(plane, a, depth, CUT_BAND, &da);
        plane_distance(plane, b, depth, CUT_BAND, &db);
        bool a_in = da.hi >= 0.0f, b_in = db.hi >= 0.0f;
        if (!a_in && !b_in) return false;
        if (a_in && b_in) continue;
        pair_sub(&da, &db, &t);
        pair_div(&da, &t, &t);
        if (a_in && is_less(&t, &to)) to = t, to_plane = plane;
        if (b_in && is_less(&from, &t)) from = t, from_plane = plane;
    }
    if (!is_less(&from, &to)) return false;
    segment->end[0] = *a, segment->end[1] = *b;
    segment->place[0] = from.hi, segment->place[1] = to.hi;
    segment->cut[0] = from_plane >= 0, segment->cut[1] = to_plane >= 0;
    if (from_plane >= 0) {
        along(a, b, &from, segment->end);
        put_on_plane(from_plane, segment->end, depth, CUT_BAND);
    }
    if (to_plane >= 0) {
        along(a, b, &to, segment->end + 1);
        put_on_plane(to_plane, segment->end + 1, depth, CUT_BAND);
    }
    return true;
}

INLINE void put(global Vertex *vertex, const Place *at, float x, float y, float across, float depth)
{
    Pair right = {x * across, 0.0f}, down = {y, 0.0f};
    float rest;
    pair_add(&at->x, &right, &right);
    pair_add(&at->y, &down, &down);
    vertex->x = snap(&right, &rest);
    vertex->offset_x = rest;
    vertex->y = snap(&down, &rest);
    vertex->offset_y = rest;
    vertex->depth = depth;
    vertex->outcode = 0;
}

#endif
