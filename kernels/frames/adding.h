// Adding: the frame of techniques that add up a pixel's fragments in one geometry pass, for the execution that is asked
// for (PASSES, see frames/peeling.h).
//
// Before it includes this file, the technique defines
//   weigh(count, resolved)   turns the sums of a strip, and how many fragments its pixels have, into a finished layer:
//                            `resolved` comes as sum(Ai Ci) and sum(Ai), and leaves as premultiplied colour and
//                            transmittance
#ifndef ADDING_H
#define ADDING_H

#include "stages/opaque.h"
#include "fragments/sums.h"

#if PASSES
#include "frames/add_passes.h"
#else

INLINE void resolve_strip(global ulong *fragments, global ulong *scratch, VECTOR(uint) begin, uint step,
                          VECTOR(uint) count, global const void *colors, Colors *resolved)
{
    add_up(fragments, begin, step, count, colors, resolved);
    weigh(count, resolved);
}

#include "frames/one_pass.h"
#endif

#endif
