"""Inputs: makes the scene and the camera that the command's options ask for."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from clpeel.checks import AXES
from clpeel.command.pieces import colorings, read
from clpeel.command.values import Vector
from clpeel.errors import InputError

if TYPE_CHECKING:
    from clpeel.scene.camera import Camera
    from clpeel.scene.scene import Scene


def _view_up(options: argparse.Namespace, view: Sequence[float]) -> Vector:
    """Return `--camera-view-up`, else `--up`. If neither is given, return Y, or Z if the camera looks along Y."""
    up: Vector = options.camera_view_up or options.up or AXES["Y"]
    if options.camera_view_up or options.up:
        return up
    x, y, z = view
    if max(abs(x), abs(z)) > 1e-6 * abs(y):
        return up
    return (0.0, 0.0, -1.0) if y < 0 else (0.0, 0.0, 1.0)


def make_camera(options: argparse.Namespace, scene: Scene) -> Camera:
    """Return the camera that the options ask for.

    It is made of a position and a focal point, or it has everything in view. Then azimuth, elevation and zoom are
    applied.
    """
    from clpeel.scene.camera import Camera

    width, height = options.resolution
    orthographic = options.camera_orthographic
    if options.camera_position:
        low, high = scene.bounds
        focal_point = options.camera_focal_point or tuple(float(value) for value in low / 2 + high / 2)
        view: Sequence[float] = [to - at for at, to in zip(options.camera_position, focal_point, strict=True)]
        camera = Camera(
            options.camera_position,
            focal_point,
            _view_up(options, view),
            options.camera_view_angle,
            orthographic=orthographic,
        )
    else:
        direction = options.camera_direction
        named = isinstance(direction, str)  # a view, whose name says what is up
        camera = Camera.frame(
            scene,
            direction,
            _view_up(options, direction) if direction and not named else options.up or (None if named else AXES["Y"]),
            options.camera_view_angle,
            aspect=width / height,
            orthographic=orthographic,
        )
        if options.camera_view_up:
            camera = replace(camera, view_up=options.camera_view_up)
        if options.camera_focal_point:
            x, y, z = (
                float(point + at - to)
                for point, at, to in zip(options.camera_focal_point, camera.position, camera.focal_point, strict=True)
            )
            camera = replace(camera, position=(x, y, z), focal_point=options.camera_focal_point)
    if options.clipping_range:
        camera = replace(camera, clipping_range=options.clipping_range)
    if options.camera_azimuth_angle:
        camera = camera.azimuth(options.camera_azimuth_angle)
    if options.camera_elevation_angle:
        camera = camera.elevation(options.camera_elevation_angle)
    if options.camera_zoom_factor:
        camera = camera.zoom(options.camera_zoom_factor)
    return camera


def load_files(options: argparse.Namespace) -> tuple[Callable[[], Scene], str]:
    """Return a function that reads the named files, and a name for them. Raises InputError if an option is wrong."""
    colorings(options.pieces)

    def load() -> Scene:
        scene = read(options.pieces, options.drop_duplicates)
        return replace(scene, lights=(*scene.lights, *options.lights)) if options.lights else scene

    return load, ", ".join(os.path.basename(name) for name in options.files)


def load_demo(options: argparse.Namespace) -> tuple[Callable[[], Scene], str]:
    """Return a function that makes the built-in scene that the options ask for, and a name for it.

    Without camera options, the options get those that show the demo well. Raises InputError if an option is wrong.
    """
    from clpeel.scene.demo import DIRECTION, ZOOM

    if options.transparent_every is not None and not options.boxes:
        raise InputError("--transparent-every: expected --boxes with it, got none")

    def load() -> Scene:
        import clpeel

        if options.boxes:
            from clpeel.scene.boxes import boxes_scene

            scene = boxes_scene(options.transparent_every or 2)
        else:
            from clpeel.scene.demo import demo_scene

            scene = demo_scene()
        opacity, color = (options.pieces[0].options.get(name) for name in ("opacity", "color"))
        return scene if opacity is None and color is None else clpeel.load(scene, opacity=opacity, color=color)

    if not (options.camera_position or options.camera_direction or options.up):
        options.camera_direction = DIRECTION
        options.camera_zoom_factor = options.camera_zoom_factor or (None if options.boxes else ZOOM)
    return load, "the boxes" if options.boxes else "the demo"
