"""The device: OpenCL alone. Nothing here knows a triangle."""
