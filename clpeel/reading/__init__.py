"""Reading: turns other people's files into scenes. Nothing here uses an OpenCL device."""
