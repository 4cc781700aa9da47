// weighted-average: one pass over the fragments in submission order, without sorting; not exact.
//
// Bavoil and Myers (2008, "Weighted Average") take all n fragments of a pixel to have the average colour, weighted by
// alpha, and the average alpha:
//   C = sum(Ai Ci) / sum(Ai),   A = sum(Ai) / n.
// Then n such layers over a background C0 are
//   C A (1 - (1 - A)^n) / A + C0 (1 - A)^n.
#include "fragments/averaging.h"
#include "frames/adding.h"
