"""Pictures: the output, as arrays and as files. Nothing here uses an OpenCL device."""
