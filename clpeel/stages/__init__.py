"""Stages: a scene to a picture, one file a stage. They alone launch kernels."""
