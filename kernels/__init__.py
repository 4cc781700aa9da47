"""The OpenCL C sources; one file a stage, one a technique in `techniques`; installed as `clpeel.kernels`."""
