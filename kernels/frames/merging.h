// Merging: what every technique of many passes does when a strip's last pass is done.
//
// more: where layers were left unpeeled. layers: how many were peeled. merged: comes as what lies behind, and leaves as
// the finished layer. found: see stages/composite.h. ends: sums over the lane's strips.
#ifndef MERGING_H
#define MERGING_H

#include "stages/composite.h"
#include "fragments/comparing.h"

typedef struct { uint truncated, deepest, hidden; } Ends;  // PEEL_TRUNCATED, PEEL_LAYERS, PEEL_HIDDEN

INLINE void merge_strip(const Buffers *buffers, VECTOR(int) more, VECTOR(uint) layers, Colors *merged, Ends *ends
#if VALUES
                        , global const float *parameters, Found *found
#endif
                        )
{
    VECTOR(float) seen = seen_through(buffers);
#if VALUES && !BOUNDED
    merge(buffers, merged, parameters, found);
#else
    merge(buffers, merged);
#endif
#if BOUNDED
    *found = PASTE(as_, VECTOR(float))(PASTE(as_, VECTOR(int))(seen) & more);
#endif
    STRIP_LOOP for (int k = 0; k < STRIP; ++k) {
        float through = ((const float *)&seen)[k];
        ends->deepest = MAX(ends->deepest, ((const uint *)&layers)[k]);
        if (!((const int *)&more)[k] || !(through > 0.0f)) continue;
        ++ends->truncated;
        ends->hidden = MAX(ends->hidden, as_uint(through));
    }
}

#endif
