// weighted-sum: one pass over the fragments in submission order, without sorting; not exact.
//
// Meshkin's sum (2007), as Bavoil and Myers compare it (2008, "Weighted Sum"), over a background C0:
//   C = sum(Ai Ci) + C0 (1 - sum(Ai))
// This is the first-order part of the picture, so it is right where alphas are small. Where they sum to more than one,
// the transmittance is negative. stages/composite.h counts those pixels.
#include "fragments/sums.h"

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved)
{
    add_up(fragments, begin, step, count, colors, resolved);
    resolved->alpha = 1.0f - resolved->alpha;
}

#include "frames/one_pass.h"
