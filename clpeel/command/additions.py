"""Additions: what a picture shows besides its scene, the ground grid and the axes, as the command's options ask."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from clpeel.checks import AXES
from clpeel.command.values import Vector
from clpeel.errors import InputError

if TYPE_CHECKING:
    from clpeel.rendering.result import Result
    from clpeel.scene.camera import Camera
    from clpeel.scene.scene import Scene


@dataclass(frozen=True)
class Additions:
    """What to add. unit, color, up: of the grid; None for its own unit and colour. notes: what is left out, and why."""

    grid: bool = False
    axis: bool = False
    unit: float | None = None
    color: object = None
    up: Vector = AXES["Y"]
    notes: tuple[str, ...] = ()

    @classmethod
    def of(cls, options: argparse.Namespace) -> Additions:
        """Return what the options ask for. Raises InputError if options of the grid are given without it.

        The picture of a map shows numbers. A grid would change them, and the corner may be the scale bar's.
        """
        for name in ("grid_unit", "grid_color"):
            if getattr(options, name) is not None and not options.grid:
                raise InputError(f"--{name.replace('_', '-')}: expected --grid with it, got none")
        found = cls(options.grid, options.axis, options.grid_unit, options.grid_color, options.up or AXES["Y"])
        given = [f"--{name}" for name in ("grid", "axis") if getattr(found, name)]

        from clpeel.techniques import AUTO, technique

        if not given or options.technique == AUTO or not technique(options.technique).maps:
            return found
        left_out = f"{' and '.join(given)} left out: the picture of {options.technique} is a map"
        return replace(found, grid=False, axis=False, notes=(left_out,))

    def around(self, scene: Scene) -> Scene:
        """Return the scene with its grid. Cameras are made for the scene without it, as the grid is larger."""
        if not self.grid:
            return scene
        from clpeel.scene.grid import grid
        from clpeel.scene.scene import joined

        return joined([scene, grid(scene, self.up, self.unit, self.color)])

    def over(self, result: Result, camera: Camera, options: argparse.Namespace) -> Result:
        """Return the result with the axes over its picture. options: those of the device."""
        return result.with_axis(camera, options.device, options.lanes) if self.axis else result
