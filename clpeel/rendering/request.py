"""The request: a picture that is asked for. Everything in it is checked before any work is done."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

from clpeel.checks import Rgb
from clpeel.device.layout import Targets
from clpeel.errors import InputError
from clpeel.options import Options, options_of
from clpeel.rendering.options import (
    SAMPLES,
    VIEW_MAPS,
    Lighting,
    PictureOptions,
    Size,
    checked_layers,
    default_lighting,
)
from clpeel.rendering.shown_errors import may_hide
from clpeel.scene.camera import Camera, GivenCamera, checked_camera
from clpeel.scene.lights import KIT, Lamp
from clpeel.scene.scene import Scene
from clpeel.scene.textures import linear
from clpeel.stages.outlines import Length, Marks
from clpeel.stages.projection import Lit
from clpeel.techniques import AUTO, ERROR_BOUND, TECHNIQUES, AnyTechnique, AutoOptions, option_names, options_class
from clpeel.techniques import technique as technique_named
from clpeel.techniques.precision import Blending

if TYPE_CHECKING:
    from clpeel.stages.wires import Wires

Progress = Callable[[float, str], None]
"""Called with the share of the work that is done, 0..1, and a text that says what is being done."""

MAP_VALUES = 4
"""How many numbers a technique that makes maps finds for each pixel: as many as a colour has (composite.h)."""

AUTO_STANDS_FOR = "sort"
"""The technique that stands for auto until auto has chosen. It has auto's option, with the same meaning."""


@dataclass(frozen=True, kw_only=True)
class Request:
    """A picture that is asked for. All of it has been checked.

    picture: the options of all pictures. technique: for auto, AUTO_STANDS_FOR until one is chosen. options: the
    technique's own, or AutoOptions. values: how many numbers are found for each pixel besides its colour, for maps or
    for a bound of the error.
    """

    camera: Camera
    picture: PictureOptions
    technique: AnyTechnique
    options: Options
    values: int
    scene_lights: tuple[Lamp, ...] = ()
    progress: Progress | None = None

    @classmethod
    def of(
        cls,
        scene: Scene,
        camera: GivenCamera | None,
        technique: str,
        given: Mapping[str, object],
        progress: Progress | None = None,
    ) -> Request:
        """Checks the options and makes the request. Raises InputError if any is wrong.

        camera: see GivenCamera; by default `Camera.frame(scene)`. given: options of all pictures and of the technique,
        by name.
        """
        picture, options = checked_options(technique, given)
        camera = checked_camera(scene, camera, picture.size[0] / picture.size[1])
        chosen = technique_named(AUTO_STANDS_FOR if technique == AUTO else technique)
        if picture.lighting == "scene" and not scene.lights:
            raise InputError(
                "lighting: expected lights in the scene with 'scene', got none; 'kit' has lights of its own"
            )
        bounded = technique == AUTO or getattr(options, "max_error", None) is not None
        values = MAP_VALUES if chosen.maps else int(bounded)
        check_picture_fits(picture.size, 4 + 16 * picture.keep_color + 4 * values)
        return cls(
            camera=camera,
            picture=picture,
            technique=chosen,
            options=options,
            values=values,
            scene_lights=scene.lights,
            progress=progress,
        )

    def chosen(self, technique: AnyTechnique, options: Options) -> Request:
        """The same request with the technique that auto has chosen."""
        return replace(self, technique=technique, options=options)

    @property
    def of_layers(self) -> Request:
        """The same request for all layers of each pixel's centre, which is what maps are taken from."""
        sort = technique_named("sort")
        changed: dict[str, Any] = {"samples": 1, "layers": True, "maps": (), "execution": "tiles"}
        picture = replace(self.picture, **changed)
        return replace(self, picture=picture, technique=sort, options=sort.options(), values=0)

    @property
    def is_auto(self) -> bool:
        """Whether auto still has to choose the technique."""
        return isinstance(self.options, AutoOptions)

    @property
    def max_error(self) -> float | None:
        """The most that skipped layers may change a channel, 0..1; None if none are skipped."""
        found: float | None = getattr(self.options, "max_error", None)
        return found

    @property
    def linear(self) -> bool:
        """Whether colours are blended as linear light. Techniques that blend none have no use for it."""
        return self.picture.blending_space == "linear" and issubclass(self.technique.options, Blending)

    @property
    def drawn_options(self) -> Options:
        """The technique's options as it draws by them: its max_error is one of what is blended."""
        if not self.linear or self.max_error is None:
            return self.options
        light: dict[str, Any] = {"max_error": may_hide(self.max_error, True)}
        return replace(self.options, **light)

    @property
    def blending(self) -> Blending:
        """How colours are blended."""
        return self.options if isinstance(self.options, Blending) else Blending()

    @property
    def sampled(self) -> Size:
        """The picture's (width, height) in samples."""
        width, height = self.picture.size
        return width * self.picture.pattern.columns, height * self.picture.pattern.rows

    @property
    def lighting(self) -> Lighting:
        """What light there is: by default the scene's own, if it has some, else the kit.

        A technique that keeps light apart from colours has none but the headlight.
        """
        chosen = self.picture.lighting or default_lighting(bool(self.scene_lights))
        return "headlight" if self.technique.light_apart and chosen != "none" else chosen

    @property
    def lit(self) -> Lit | None:
        """The lights that fall on the scene, if there are any but the headlight."""
        lights = {"kit": KIT, "scene": self.scene_lights}.get(self.lighting)
        if lights is None:
            return None
        return Lit(lights, self.picture.light_intensity, self.picture.highlights == "full")

    @property
    def targets(self) -> Targets | None:
        """The technique's render targets if it is to be executed by passes, else None."""
        return self.technique.targets(self.options) if self.picture.execution == "passes" else None

    @property
    def opaque_first(self) -> bool:
        """Whether opaque surfaces are drawn first, so that nothing behind them is drawn."""
        return self.picture.opaque == "first" and not self.technique.all_surfaces

    @property
    def backfaces(self) -> str:
        """Which faces seen from behind are drawn. Techniques that measure all surfaces need both sides of them."""
        chosen = self.picture.backface_type
        return "visible" if chosen == "default" and self.technique.all_surfaces else chosen

    @property
    def marks(self) -> Marks:
        """How lines and points are drawn."""
        return marks_of(self.picture)

    @property
    def wants_edges(self) -> bool:
        """Whether edges of faces are asked for."""
        return self.picture.edges or self.picture.feature_edges is not None or self.picture.silhouettes

    @property
    def wires(self) -> Wires | None:
        """How edges of faces are drawn, if any are. Techniques that measure solids draw none."""
        if not self.wants_edges or self.technique.measures_solids:
            return None
        from clpeel.stages.wires import Wanted, Wires

        picture = self.picture
        color = cast(Rgb, picture.edge_color)  # as it is checked
        if self.linear:
            red, green, blue = map(float, linear(color))
            color = red, green, blue
        hidden = picture.hidden_edges
        wanted = Wanted(picture.edges, picture.feature_edges, picture.silhouettes)
        return Wires(wanted, color, picture.edge_opacity, self.marks.line_width, hidden if self.opaque_first else 0.0)

    @property
    def keep_coincident(self) -> bool:
        """Whether all fragments of equal depth are kept."""
        return getattr(self.options, "coincident", "keep") == "keep"

    def report(self, done: float, text: str) -> None:
        """Calls `progress` with the share of the work that is done, 0..1, if there is a `progress`."""
        if self.progress is not None:
            self.progress(done, text)


def marks_of(picture: PictureOptions) -> Marks:
    """How lines and points of a picture are drawn, by its options."""

    def length(value: float | str) -> Length:
        if isinstance(value, str):
            return Length(float(value.removesuffix("u")), in_scene=True)
        return Length(value * picture.pattern.rows)

    return Marks(length(picture.line_width), length(picture.point_size), picture.point_type)


def checked_options(technique: str, given: Mapping[str, object]) -> tuple[PictureOptions, Options]:
    """The options of all pictures and those of the technique, checked. Raises InputError if any is wrong."""
    check_names(technique, given)
    common = {each.name for each in options_of(PictureOptions)}
    own = {name: value for name, value in given.items() if name not in common}
    shared: dict[str, Any] = {name: value for name, value in given.items() if name in common}
    options = options_class(technique)(**own)
    if shared.get("samples") is None:
        single = shared.get("layers") or (technique != AUTO and technique_named(technique).maps)
        shared["samples"] = 1 if single else SAMPLES
    picture = PictureOptions(**shared)
    if picture.layers and technique != AUTO:
        technique_named(technique).peeled(options)  # raises InputError if layers may be lost
    check_maps(technique, picture, options)
    if picture.execution == "passes":
        check_passes(technique, options)
    elif getattr(options, "racing_writes", False):
        raise InputError("racing_writes: expected execution='passes' with it, got 'tiles', where no writes meet")
    return picture, options


def maps_of(technique: str, bounded: bool) -> tuple[str, ...]:
    """The names of the maps that a picture by the technique may have: its own, and those of all pictures.

    bounded: whether it is given a max_error.
    """
    own = () if technique == AUTO else technique_named(technique).maps
    bound = (ERROR_BOUND,) if technique == AUTO or bounded else ()
    shared = [name for name in VIEW_MAPS if name not in own and not (own and name == "transmittance")]
    return (*own, *bound, *shared)


def check_maps(technique: str, picture: PictureOptions, options: Options) -> None:
    """Raises InputError if the technique does not make one of the maps that are asked for."""
    having = maps_of(technique, getattr(options, "max_error", None) is not None)
    for name in picture.maps:
        if name not in having:
            raise InputError(f"maps: expected names that {technique!r} makes ({', '.join(having)}), got {name!r}")
    if "transmittance" in picture.maps and not picture.keep_color:
        raise InputError("maps: expected keep_color=True with transmittance, got False")


def check_passes(technique: str, options: Options) -> None:
    """Raises InputError if the technique cannot be executed by passes with these options."""
    having = [name for name, each in TECHNIQUES.items() if each.has_passes]
    if technique not in having:
        raise InputError(
            f"execution: expected 'tiles' for the technique {technique!r}, got 'passes', which {', '.join(having)} have"
        )
    technique_named(technique).targets(options)


def check_names(technique: str, given: Mapping[str, object]) -> None:
    """Raises InputError if there is no such technique, or if it lacks one of these options."""
    has = option_names(technique)
    common = tuple(each.name for each in options_of(PictureOptions) if each.name != "layers")
    for name, value in sorted(given.items()):
        if name in has or name in common:
            continue
        if name == "layers" and not value and value is not None and checked_layers(name, value) is False:
            continue  # layers=False is right with any technique
        known = ", ".join(("camera", "technique", *common, "progress", *has))
        raise InputError(f"{name}: the technique {technique!r} has no such option; it has {known}")


def check_picture_fits(size: Size, pixel_bytes: int) -> None:
    """Raises InputError if the host's memory cannot hold the picture. pixel_bytes: bytes of one pixel."""
    needed = size[0] * size[1] * pixel_bytes
    if hasattr(os, "sysconf") and needed > (held := os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")):
        raise InputError(
            f"size: expected a picture that fits the memory of {held / 2**30:.1f} GiB, "
            f"got {size[0]} x {size[1]}, which takes {needed / 2**30:.1f} GiB"
        )


def all_options() -> tuple[type[Options], ...]:
    """The classes that define all options that `render` knows."""
    return (PictureOptions, *dict.fromkeys(each.options for each in TECHNIQUES.values()), AutoOptions)
