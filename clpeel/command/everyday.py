"""Everyday: the options that a command's help shows. The others are there with `--help-all`."""

from __future__ import annotations

EVERYDAY = frozenset(
    "files output resolution background_color no_background opacity color unlit edges grid coloring_array colormap "
    "camera_position camera_direction camera_zoom_factor up technique samples device config help "
    "help_all".split()
)
"""Of the options of `render`, those that most pictures need. What another command has of its own is always shown."""
