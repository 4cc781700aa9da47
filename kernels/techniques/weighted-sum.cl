// weighted-sum: one pass over the fragments in submission order, without sorting; not exact.
//
// Meshkin's sum (2007), as Bavoil and Myers compare it (2008, "Weighted Sum"), over a background C0:
//   C = sum(Ai Ci) + C0 (1 - sum(Ai))
// This is the first-order part of the picture, so it is right where alphas are small. Where they sum to more than one,
// the transmittance is negative. stages/composite.h counts those pixels.
#include "fragments/blending.h"

INLINE void weigh(VECTOR(uint) count, Colors *resolved) { resolved->alpha = 1.0f - resolved->alpha; }

#include "frames/adding.h"
