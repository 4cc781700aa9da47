// Wires: edges, drawn on the faces that meet at them. A fragment of a face is covered by an edge as far as the edge's stroke
// covers a pixel's width around it, so wires have no depth of their own that could sink into the surface, and are smooth at
// any number of samples (Baerentzen, Nielsen, Gjol, Larsen and Christensen 2006, "Single-pass Wireframe Rendering").
//
// A face has a list of edges: its own, and those that end at its corners, as a stroke may reach over a narrow face. Where
// no surface lies beside an edge, the triangles of a band do (stages/wires.cl), which show nothing but strokes.
#ifndef WIRES_H
#define WIRES_H

#include "shading/reals.h"

// Whether nothing is drawn but edges behind opaque surfaces (clpeel/rendering/hidden_edges.py).
#ifndef BEHIND
#define BEHIND 0
#endif

// The edges of all faces: lists[face] .. lists[face + 1] are where a face's own are in `lists`.
typedef struct {
    global const Wiring *wiring;
    global const uint *lists;
    global const Wire *wires;
} Wires;

// Whether a triangle is no face, but lies beside one and shows edges alone.
INLINE bool is_band(const Wires *w, uint source)
{
#if WIRES
    return source >= w->wiring->first_band;
#else
    return false;
#endif
}

#if WIRES
// The part of a stroke across a width `unit` around places at this distance from its middle, in all of that width.
INLINE Reals stroke_over(Reals distance, Reals reach, float unit)
{
    Reals last = least_of(distance + 0.5f * unit, reach), first = MAX(distance - 0.5f * unit, -reach);
    Reals share = least_of((last - first) * (1.0f / unit), (Reals)(1.0f));  // which rounding may take it beyond
    return MAX(share, (Reals)(0.0f));
}

// How much of these places an edge covers. x, y: subpixels of a sample's height from the image's centre.
INLINE Reals wire_over(global const Wire *w, Reals x, Reals y, float unit)
{
    Reals right = x - w->x, down = y - w->y;
    Reals along = (right * w->right + down * w->down) * w->inverse_length2;
    along = MAX(along, (Reals)(0.0f)), along = MIN(along, (Reals)(1.0f));
    right -= along * w->right, down -= along * w->down;
    return stroke_over(square_root(right * right + down * down), w->reach + along * w->growth, unit);
}

// How much of these places the edges of a face cover: the one that covers most of each. A stroke of width below 0 covers
// nothing. seen: FROM_FRONT or FROM_BEHIND. Foreign edges are drawn if one of their own faces is seen so. Others lie on the
// other side of the body, and the face may be in front of them.
INLINE Reals wires_over(const Wires *w, uint source, uint seen, Reals x, Reals y, float unit)
{
    global const Wiring *wiring = w->wiring;
    Reals most = (Reals)(0.0f);
    uint face = source;
    if (is_band(w, source)) {
        global const Wire *own = w->wires + wiring->bands + (source - wiring->first_band) / BAND_TRIANGLES;
        most = wire_over(own, x, y, unit), face = own->face, seen = FROM_FRONT | FROM_BEHIND;
    }
    for (uint k = w->lists[face]; k < w->lists[face + 1]; ++k) {
        uint listed = w->lists[k];
        global const Wire *wire = w->wires + (listed & ~FOREIGN);
        if (listed & FOREIGN && !(wire->face & seen)) continue;
        Reals covered = wire_over(wire, x, y, unit);
        most = MAX(most, covered);
    }
    return most;
}

// Whether anything is drawn of edges on a face.
INLINE bool has_wires(const Wires *w, uint source)
{
    if (is_band(w, source)) return true;
    return source < w->wiring->faces && w->lists[source] < w->lists[source + 1];
}

// A colour with that of edges over it, straight alpha. covered: how much of it they cover.
INLINE float4 with_wire(const Wires *w, float4 color, float covered)
{
    global const float *wire = w->wiring->color;
    float share = covered * wire[3], through = (1.0f - share) * (1.0f - color.w), alpha = 1.0f - through;
    if (!(share > 0.0f)) return color;
    float4 over = (float4)(wire[0], wire[1], wire[2], 0.0f) * (share / alpha) + color * (color.w * (1.0f - share) / alpha);
    over.w = alpha;
    return over;
}
#endif

#endif
