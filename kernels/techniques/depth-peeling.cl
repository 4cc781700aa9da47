// depth-peeling: the nearest layer beyond the one before, pass by pass, blended under those in front (Everitt 2001; Bavoil and
// Myers 2008, "Depth Peeling", "Under Blending").
//
//   slot[0]   the depth buffer of this pass, by a test for nearer; z_near that of the pass before: they take turns
//
// It is multi-layer peeling of one layer a pass.
#define LAYERS_A_PASS 1
#include "techniques/multi-layer-peeling.cl"
