// Planes: the six that clip space is cut by, near, far, left, right, top and bottom. Faces and lines are cut by the same
// code, but at bands of different width: |x|, |y| <= band * w.
#ifndef PLANES_H
#define PLANES_H

#include "stages/projection.h"

// The signed distance from a plane, 0 .. 5, positive inside, linear in clip space. The plane's outcode is 1 << plane.
INLINE void plane_distance(int plane, const ClipVertex *v, DepthRange depth, float band, Pair *distance)
{
    Pair guard = {v->w.hi * band, v->w.lo * band}, bound = {plane == 0 ? depth.near : depth.far, 0.0f};
    pair_mul(&v->w, &bound, &bound);
    switch (plane) {
    case 0: pair_sub(&bound, &v->z, distance); break;
    case 1: pair_sub(&v->z, &bound, distance); break;
    case 2: pair_add(&guard, &v->x, distance); break;
    case 3: pair_sub(&guard, &v->x, distance); break;
    case 4: pair_add(&guard, &v->y, distance); break;
    default: pair_sub(&guard, &v->y, distance);
    }
}

// Puts a point exactly on a plane, which it misses only by rounding. Far outside the picture, rounding can be larger
// than the picture.
INLINE void put_on_plane(int plane, ClipVertex *v, DepthRange depth, float band)
{
    Pair guard = {v->w.hi * band, v->w.lo * band}, negative = {-guard.hi, -guard.lo};
    Pair bound = {plane == 0 ? depth.near : depth.far, 0.0f};
    switch (plane) {
    case 0:
    case 1: pair_mul(&v->w, &bound, &v->z); break;
    case 2: v->x = negative; break;
    case 3: v->x = guard; break;
    case 4: v->y = negative; break;
    default: v->y = guard;
    }
}

INLINE void along_one(const Pair *from, const Pair *to, const Pair *t, Pair *there)
{
    Pair step;
    pair_sub(to, from, &step);
    pair_mul(t, &step, &step);
    pair_add(from, &step, there);
}

// The point from + t (to - from).
INLINE void along(const ClipVertex *from, const ClipVertex *to, const Pair *t, ClipVertex *there)
{
    along_one(&from->x, &to->x, t, &there->x);
    along_one(&from->y, &to->y, t, &there->y);
    along_one(&from->z, &to->z, t, &there->z);
    along_one(&from->w, &to->w, t, &there->w);
}

#endif
