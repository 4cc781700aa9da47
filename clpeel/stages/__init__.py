"""Stages: the steps from a scene to a picture, one file for each. Only stages launch kernels."""
