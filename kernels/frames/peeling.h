// Peeling: the frame of techniques that make several geometry passes, for the execution that is asked for.
//
//   PASSES 0   "tiles": all passes of a tile in one kernel
//   PASSES 1   "passes": a kernel launch for each step of each pass
#ifndef PEELING_FRAME_H
#define PEELING_FRAME_H

// What both have in common stands here, outside of the conditions, because a file is put in only where it is first
// asked for.
#include "stages/opaque.h"
#include "fragments/targets.h"
#include "frames/merging.h"

#if PASSES
#include "frames/peel_passes.h"
#else
#include "frames/many_passes.h"
#endif

#endif
