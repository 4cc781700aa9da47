// depth-peeling: each pass peels the nearest layer behind the one before, and blends it under those in front (Everitt
// 2001; Bavoil and Myers 2008, "Depth Peeling", "Under Blending").
//
//   slot[0]   the depth buffer of this pass, with a test for nearer
//   z_near    the depth buffer of the pass before; the two take turns
//
// It is multi-layer peeling with one layer in each pass.
#define LAYERS_A_PASS 1
#include "techniques/multi-layer-peeling.cl"
