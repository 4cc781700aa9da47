"""Twins: obviously right float64 versions of what kernels compute, and the scenes to try both on."""
