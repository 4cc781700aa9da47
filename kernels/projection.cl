// Projection: scene triangles to snapped screen triangles (projection.h).
//
//   project_vertices    one work-item a vertex: clip space in float pairs, then snapped to 1/256 pixel
//   setup_triangles     one work-item a face: a record, or nothing, or a count of those that need clipping (clipping.cl)
#include "projection.h"

// Which planes a vertex is outside of. Rounded once more than plane_distance(): a vertex on a plane to within a rounding
// may be called outside by one and inside by the other, and is then cut at its own place.
INLINE uint outcode_of(ClipVertex v, DepthRange depth)
{
    float guard = v.w.hi * GUARD_BAND;
    return (v.z.hi > v.w.hi * depth.near ? OUT_NEAR : 0u) | (v.z.hi < v.w.hi * depth.far ? OUT_FAR : 0u) |
           (v.x.hi < -guard ? OUT_LEFT : 0u) | (v.x.hi > guard ? OUT_RIGHT : 0u) |
           (v.y.hi < -guard ? OUT_TOP : 0u) | (v.y.hi > guard ? OUT_BOTTOM : 0u);
}

// No branches, so that items run side by side: past the end the last vertex is done again, into padding.
kernel void project_vertices(global const float *positions, global const float *low_positions,
                             global const float *matrix, float depth_near, float depth_far, uint vertex_count,
                             global Vertex *vertices)
{
    const DepthRange depth = {depth_near, depth_far};
    uint i = get_global_id(0), from = MIN(i, vertex_count - 1);
    ClipVertex c;
    to_clip_space(matrix, positions, low_positions, from, &c);
    // A NaN or infinity anywhere makes this sum one: positions are below 2^61, so it cannot overflow by itself.
    float3 p = load3(positions, from);
    // Field by field: the copy of a whole struct keeps a CPU compiler from running items side by side.
    Vertex v;
    to_screen(&c, &v);
    vertices[i].x = v.x;
    vertices[i].y = v.y;
    vertices[i].offset_x = v.offset_x;
    vertices[i].offset_y = v.offset_y;
    vertices[i].depth = v.depth;
    vertices[i].outcode = is_finite((p.x + p.y) + p.z) ? outcode_of(c, depth) : NOT_FINITE;
}

kernel void setup_triangles(global const uint *faces, uint face_count, uint vertex_count, global const Vertex *vertices,
                            int width, int height, global Triangle *triangles, global ushort4 *bounds,
                            global float *weights, volatile global uint *counters)
{
    uint i = get_global_id(0);
    if (i >= face_count) return;
    uint3 face = load_face(faces, i);
    bounds[i] = (ushort4)(1, 0, 1, 0);
    // The host refuses such faces; this guard is for memory's sake.
    if (MAX(face.x, MAX(face.y, face.z)) >= vertex_count) return;
    Vertex corner[3] = {vertices[face.x], vertices[face.y], vertices[face.z]};
    uint any = corner[0].outcode | corner[1].outcode | corner[2].outcode;
    if (any) {
        if (any & NOT_FINITE) atomic_inc(counters);  // Counters.discarded
        else if (!(corner[0].outcode & corner[1].outcode & corner[2].outcode)) atomic_inc(counters + 1);
        return;
    }
    float moved[3][3];
    int order[3];
    if (!make_triangle(corner, i, width, height, triangles + i, bounds + i, moved, order)) return;
#if FRAGMENT_COLOR
    float share[3][3] = {{0}};
    for (int k = 0; k < 3; ++k) share[k][k] = PERSPECTIVE ? corner[k].depth : 1.0f;
    store_weights(weights, i, moved, order, share);
#endif
}
