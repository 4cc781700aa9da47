"""Scenes: the input of a render. This package uses NumPy alone, and no OpenCL device."""
