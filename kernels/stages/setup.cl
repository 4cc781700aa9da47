// What every picture needs, whatever the technique. It is one program, because starting a compiler takes longer than
// compiling these kernels.
#include "stages/projection.cl"
#include "stages/binning.cl"
