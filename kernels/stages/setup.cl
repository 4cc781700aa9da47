// What every picture needs, whatever the technique, in one program: a compiler takes longer to start than to compile these.
#include "stages/projection.cl"
#include "stages/binning.cl"
