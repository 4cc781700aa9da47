"""The device: OpenCL alone. Nothing here knows what a triangle is."""
