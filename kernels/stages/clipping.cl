// Clipping: cuts the faces that cross a clipping plane or the guard band into fans of screen triangles
// (stages/projection.h).
//
//   clip_triangles      a clipped face a work-item: writes its fan, in records of its own behind those of the list
#undef WIDE
#define WIDE 1  // clipped faces are few, and each has corners of its own to go through
#include "stages/planes.h"

// weight: the weights of the face's three vertices at this corner.
typedef struct { ClipVertex at; float weight[3]; } PolygonCorner;

// Clips a polygon against one plane (Sutherland and Hodgman). Cuts are always made from inside to outside, so two faces
// that share an edge share its cut. Returns how many corners are left. A convex polygon gains one corner at most.
// Rounding can let a sliver gain more, which `room` bounds.
static int clip_polygon(const PolygonCorner *in, int count, int plane, DepthRange depth, PolygonCorner *out)
{
    int kept = 0, room = MAX_CLIP_VERTICES - 1;
    for (int k = 0; k < count && kept < room; ++k) {
        const PolygonCorner *a = in + k, *b = in + (k + 1 < count ? k + 1 : 0);
        Pair da, db;
        plane_distance(plane, &a->at, depth, GUARD_BAND, &da);
        plane_distance(plane, &b->at, depth, GUARD_BAND, &db);
        bool a_in = da.hi >= 0.0f, b_in = db.hi >= 0.0f;
        if (a_in) out[kept++] = *a;
        if (a_in == b_in) continue;
        if (!a_in) {
            const PolygonCorner *c = a;
            Pair d = da;
            a = b, b = c, da = db, db = d;
        }
        Pair t;
        pair_sub(&da, &db, &t);
        pair_div(&da, &t, &t);
        PolygonCorner *cut = out + kept++;
        along(&a->at, &b->at, &t, &cut->at);
        for (int j = 0; j < 3; ++j) cut->weight[j] = a->weight[j] + t.hi * (b->weight[j] - a->weight[j]);
        put_on_plane(plane, &cut->at, depth, GUARD_BAND);
    }
    return kept;
}

// clipped: places in `listed`. The fans are in the records behind those of the list, CLIP_TRIANGLES for each clipped
// face.
kernel void clip_triangles(global const uint *clipped, uint clipped_count, global const uint *listed, uint listed_count,
                           uint opaque_count, global const uint *faces, global const float *positions,
                           global const float *low_positions, global const float *matrix, float depth_near, float depth_far,
                           int width, int height, uint pattern, int perspective, global const uchar *single_sided, int all_single_sided,
                           global Triangle *triangles, global ushort4 *bounds, global float *weights)
{
    uint n = get_global_id(0);
    if (n >= clipped_count) return;
    const DepthRange depth = {depth_near, depth_far};
    uint source = listed[clipped[n]], first = listed_count + n * CLIP_TRIANGLES;
    PolygonCorner polygon[MAX_CLIP_VERTICES], other[MAX_CLIP_VERTICES];
    for (int i = 0; i < 3; ++i) {
        uint vertex = faces[3 * source + i];
        Point point;
        for (int j = 0; j < 3; ++j) {
            point.high[j] = positions[3 * vertex + j];
            if (LOW_POSITIONS) point.low[j] = low_positions[3 * vertex + j];
            polygon[i].weight[j] = i == j ? 1.0f : 0.0f;
        }
        to_clip_space(matrix, &point, &polygon[i].at);
    }
    int count = 3;
    for (int plane = 0; plane < 6; ++plane) {
        count = clip_polygon(polygon, count, plane, depth, other);
        for (int k = 0; k < count; ++k) polygon[k] = other[k];
    }
    for (int k = 0; k < CLIP_TRIANGLES; ++k) {
        uint record = first + k;
        bounds[record] = (ushort4)(1, 0, 1, 0);
        if (k + 2 >= count) continue;
        Corner corner[3];
        for (int i = 0; i < 3; ++i) to_screen(&polygon[i == 0 ? 0 : k + i].at, corner + i);
        Arrangement arrangement;
        make_triangles(corner, source, clipped[n] < opaque_count ? OPAQUE : 0, width, height, pattern, record, triangles, bounds, &arrangement);
        bool one_sided = all_single_sided || (single_sided && single_sided[source]);
        if (one_sided && triangles[record].flags & BACK_FACING) bounds[record] = (ushort4)(1, 0, 1, 0);
        if (!weights) continue;
        float share[3][3];
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                share[i][j] = polygon[i == 0 ? 0 : k + i].weight[j] * (perspective ? corner[i].depth : 1.0f);
        store_weights(weights, record, &arrangement, share);
    }
    // The face itself has no record. Its bounds say where its fan is instead (stages/binning.cl, FOR_EACH_PAIR).
    bounds[clipped[n]] = (ushort4)(CLIPPED_FACE, 0, n & 0xFFFF, n >> 16);
}
