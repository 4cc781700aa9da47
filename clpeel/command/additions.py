"""Additions: what a picture shows besides its scene, as the command's options ask: ground grid, axes, scale bars."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, NamedTuple

from clpeel.checks import AXES
from clpeel.command.values import Vector
from clpeel.errors import InputError

if TYPE_CHECKING:
    from clpeel.rendering.result import Result
    from clpeel.scene.camera import Camera
    from clpeel.scene.scene import Scene


class Additions(NamedTuple):
    """What to add. unit, color, up: of the grid; None for its own unit and colour. notes: what is left out, and why."""

    grid: bool = False
    axis: bool = False
    bar: bool = False
    unit: float | None = None
    color: object = None
    up: Vector = AXES["Y"]
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, options: argparse.Namespace) -> Additions:
        """Return what the options ask for. Raises InputError if an option is given without the one that it needs.

        The picture of a map shows numbers. A grid would change them, and the corner may be the map's own scale bar's.
        """
        for name in ("grid_unit", "grid_color"):
            if getattr(options, name) is not None and not options.grid:
                raise InputError(f"--{name.replace('_', '-')}: expected --grid with it, got none")
        if options.bar and all(piece.options.get("coloring_array") is None for piece in options.pieces):
            raise InputError("--bar: expected --coloring-array with it, got none")
        up = options.up or AXES["Y"]
        found = cls(options.grid, options.axis, options.bar, options.grid_unit, options.grid_color, up)
        given = [f"--{name}" for name in ("grid", "axis", "bar") if getattr(found, name)]

        from clpeel.techniques import AUTO, technique

        if not given or options.technique == AUTO or not technique(options.technique).maps:
            return found
        left_out = f"{' and '.join(given)} left out: the picture of {options.technique} is a map"
        return found._replace(grid=False, axis=False, bar=False, notes=(left_out,))

    def around(self, scene: Scene) -> Scene:
        """Return the scene with its grid. Cameras are made for the scene without it, as the grid is larger."""
        if not self.grid:
            return scene
        from clpeel.scene.grid import grid
        from clpeel.scene.scene import joined

        return joined([scene, grid(scene, self.up, self.unit, self.color)])

    def over(self, result: Result, scene: Scene, camera: Camera, options: argparse.Namespace) -> Result:
        """Return the result with the axes and the scene's scale bars over its picture. options: those of the device."""
        found = result.with_axis(camera, options.device, options.lanes) if self.axis else result
        return found.with_bar(*scene.color_maps) if self.bar else found
