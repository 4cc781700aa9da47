"""The command line that makes the picture of a view, and the same as Python."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from clpeel.checks import checked_background, shades_of
from clpeel.options import Option, options_of
from clpeel.rendering.options import BACKGROUND
from clpeel.rendering.request import all_options
from clpeel.techniques import options_class
from clpeel.viewer.view import LAYER_COUNT, View


@dataclass(frozen=True)
class Source:
    """Where a scene came from: the words of the command that reads it.

    words: such as ("clpeel", "render", "part.stl"). scene: options of its colours, which an opacity of the view
    replaces in part. device: options of the device.
    """

    words: tuple[str, ...]
    scene: tuple[str, ...] = ()
    device: tuple[str, ...] = ()


def command_line(view: View, source: Source | None) -> str:
    """Return the text that makes the very picture of the view. source: None if the scene came from Python."""
    technique = LAYER_COUNT if view.shows == "layers" else view.technique
    if source is None:
        return _python(view, technique)
    scene: Iterable[str] = source.scene
    if view.opacity is not None:
        scene = [*(word for word in scene if not word.startswith("--opacity=")), f"--opacity={view.opacity!r}"]
    words = [*source.words, *scene, *_flags(view, technique), *source.device, "-o", "picture.png"]
    return " ".join(map(shlex.quote, words))


def _flags(view: View, technique: str) -> Iterator[str]:
    camera = view.camera
    yield f"--resolution={view.size[0]},{view.size[1]}"
    yield f"--technique={technique}"
    for name in ("position", "focal_point", "view_up"):
        yield f"--camera-{name.replace('_', '-')}={_numbers(getattr(camera, name))}"
    yield f"--camera-view-angle={float(camera.view_angle)!r}"
    if camera.orthographic:
        yield "--camera-orthographic"
    if camera.clipping_range is not None:
        yield f"--clipping-range={_numbers(camera.clipping_range)}"
    over = checked_background(view.background)
    if over is None:
        yield "--no-background"
    elif over != BACKGROUND:
        yield f"--background-color={':'.join(map(_numbers, shades_of(over)))}"
    yield "--unlit" if view.lighting == "none" else f"--lighting={view.lighting}"
    owners = (*all_options(), options_class(technique))  # the technique's own come last, as defaults may differ
    known = {each.name: each for owner in owners for each in options_of(owner)}
    given = view.keywords(technique)
    for name in ("size", "background", "lighting"):
        given.pop(name)
    for name, value in sorted(given.items()):
        if value != known[name].default or name == "samples":
            yield _flag(known[name], value)


def _flag(option: Option, value: object) -> str:
    return option.flag if option.kind is None else f"{option.flag}={value}"


def _numbers(values: Iterable[float]) -> str:
    return ",".join(repr(float(value)) for value in values)


def _python(view: View, technique: str) -> str:
    camera = view.camera
    seen = f"{camera.position}, {camera.focal_point}, {camera.view_up}, {float(camera.view_angle)!r}"
    if camera.clipping_range is not None:
        seen += f", clipping_range={camera.clipping_range}"
    if camera.orthographic:
        seen += ", orthographic=True"
    scene = "scene" if view.opacity is None else f"clpeel.load(scene, opacity={view.opacity!r})"
    options = {"technique": technique, **view.keywords(technique)}
    named = ", ".join(f"{name}={value!r}" for name, value in options.items())
    return f"clpeel.render({scene}, clpeel.Camera({seen}), {named}).save('picture.png')"
