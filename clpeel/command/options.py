"""Options: the flags of each command. The fields of the option classes define the flags of pictures and techniques."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

from clpeel.command import values
from clpeel.command.coloring import add_coloring_options
from clpeel.options import Option, options_of
from clpeel.rendering.options import BACKGROUND, SAMPLES, VIEW_MAPS, PictureOptions
from clpeel.techniques import TECHNIQUES, AutoOptions

PICTURE = {each.name: each for each in options_of(PictureOptions)}

EDGES = ("edges", "feature_edges", "silhouettes", "edge_color", "edge_opacity", "hidden_edges")
"""Options of all pictures that say which edges of faces are drawn, and how."""

METHOD = ("opaque", "depth_format", "execution", "backface_type", "anisotropy", "blending_space")
"""Options of all pictures whose flags stand beside those of the techniques."""

MARKS = ("line_width", "point_size", "point_type")
"""Options of all pictures that say how lines and points are drawn. All commands that show a scene have them."""


def add_files(parser: argparse.ArgumentParser, done: str, none: Literal["+", "*"] = "+") -> None:
    """Add the options of all commands that read files. none: "*" if there may be no file."""
    group = parser.add_argument_group("files")
    group.add_argument(
        "files", nargs=none, metavar="FILE", help=f"mesh file, or scene file (.toml); several are {done} together"
    )
    text = "leave out faces whose corners are those of an earlier face"
    group.add_argument("--drop-duplicates", "--merge-coincident", action="store_true", help=text)
    text = "show an animation of glTF files, counted from 0 (default: the pose at rest, or 0 if a time is given)"
    group.add_argument("--animation-index", type=values.index, metavar="N", help=text)
    text = "show this moment of it (default: its start)"
    group.add_argument("--animation-time", type=values.number, metavar="SECONDS", help=text)
    add_coloring_options(parser)


def _add_output(group: argparse._ArgumentGroup, output: str, metavar: str, text: str) -> None:
    group.add_argument("--output", "-o", default=output, metavar=metavar, help=f"{text} (default: {output})")


def add_picture_options(
    parser: argparse.ArgumentParser, output: str, resolution: str, samples: int | None = None
) -> None:
    """Add the options that `render` and `demo` share."""
    group = parser.add_argument_group("picture")
    text = "picture to write: .png, .jpg, .webp, .tif, .exr or .npz; or - for standard output, a PNG"
    _add_output(group, output, "OUT.png", text)
    text = "bits a channel: 8 or 16 of .png, 8, 16 or 32 of .tif, 16 or 32 of .exr (default: the least)"
    group.add_argument("--bit-depth", type=values.bit_depth, metavar="N", help=text)
    _add_view_options(parser, group, resolution, samples)
    _add_additions(group)


def _add_additions(group: argparse._ArgumentGroup) -> None:
    """Add the options of what a picture shows besides its scene."""
    add = group.add_argument
    add("--grid", action="store_true", help="a grid on the ground: across --up, at the bottom of the scene")
    text = "with --grid: side of its cells, in scene units (default: 1, 2 or 5 times a power of ten)"
    add("--grid-unit", type=values.positive, metavar="SIZE", help=text)
    add("--grid-color", type=values.color, metavar="COLOR", help="with --grid: colour of its lines (default: a grey)")
    add("--axis", action="store_true", help="the axes X, Y and Z in the lower right corner")
    add("--bar", action="store_true", help="with --coloring-array: a scale bar beside the model")


def add_layers_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `layers`: those of `render`, and how a layer is shown."""
    group = parser.add_argument_group("pictures")
    _add_output(
        group,
        "layers",
        "DIR|FILE.exr",
        "folder for layer-01.png, layer-02.png, ... and layers.npz; or one file: .exr (deep), .npz",
    )
    group.add_argument(
        "--keep-alpha",
        action="store_true",
        help="show each layer with its own alpha (default: opaque, as papers do: alone, a thin layer is hard to see)",
    )
    _add_view_options(parser, group, "1024,1024", samples=1)


def add_live_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `view`: those of `render` that say what is seen, and where it is shown."""
    add_files(parser, "shown", none="*")
    add = parser.add_argument_group("built-in scenes, in place of files").add_argument
    add("--demo", action="store_true", help="nested, intersecting, translucent surfaces")
    _add_boxes(add)
    add = parser.add_argument_group("screen").add_argument
    text = "window, browser or notebook (default: a window where there is a display, else a page for a browser)"
    add("--backend", metavar="NAME", help=text)
    text = "address that the page is served on (default: 127.0.0.1, this machine alone)"
    add("--host", default="127.0.0.1", metavar="ADDRESS", help=text)
    add("--port", type=values.port, default=0, metavar="N", help="of the page (default: any that is free)")
    add("--no-open", action="store_true", help="do not open the page, only print its address")
    add("--turn", action="store_true", help="turn the scene from the start (default with --boxes); Space stops it")
    group = parser.add_argument_group("picture")
    _add_scene_options(group, "1024,768", "of a window; a page fills its browser")
    _add_edge_options(group)
    group.add_argument("--no-background", action="store_true", help="a transparent background, shown over grey")
    _add_camera_options(parser)
    group = parser.add_argument_group("method")
    _add_technique_options(group)
    add_option(group, PICTURE["samples"], 1)
    _add_device_options(group)
    group = parser.add_argument_group("messages")
    _add_messages_options(group)


def add_turntable_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `turntable`: those of `render` that say what is seen, and those of the film."""
    add_files(parser, "shown")
    group = parser.add_argument_group("film")
    _add_output(group, "turntable.gif", "FILE", "film to write: .gif, .webp or .mp4; or PNGs, as frames/####.png")
    add = group.add_argument
    add("--frames", type=values.count, default=90, metavar="N", help="how many pictures (default: 90)")
    text = "how far the camera turns, about --up; below 0 the other way round (default: 360)"
    add("--degrees", type=values.number, default=360.0, metavar="DEGREES", help=text)
    add("--fps", type=values.positive, default=30.0, metavar="NUMBER", help="pictures a second (default: 30)")
    add("--quality", type=values.index, default=90, metavar="0..100", help="of .webp and .mp4 (default: 90)")
    add("--lossless", action="store_true", help="of .webp: keep every bit")
    group = parser.add_argument_group("picture")
    _add_scene_options(group, "800,600")
    _add_edge_options(group)
    group.add_argument("--no-background", action="store_true", help="a transparent background, of .webp and .png")
    _add_additions(group)
    _add_camera_options(parser)
    group = parser.add_argument_group("method")
    _add_technique_options(group)
    each = PICTURE["samples"]
    add_option(group, replace(each, help=f"{each.help} (default: {SAMPLES}, or 1 for a map)"))
    _add_device_options(group)
    _add_messages_options(parser.add_argument_group("messages"))


def add_boxes_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `demo` that choose another scene."""
    _add_boxes(parser.add_argument_group("scene").add_argument)


def _add_boxes(add: Callable[..., object]) -> None:
    add("--boxes", action="store_true", help="10 x 10 x 10 boxes, some of them transparent")
    text = "of the boxes, each N-th is transparent; 1 makes all so (default: 2)"
    add("--transparent-every", type=values.count, metavar="N", help=text)


def _add_view_options(
    parser: argparse.ArgumentParser, group: argparse._ArgumentGroup, resolution: str, samples: int | None
) -> None:
    """Add the options of all commands that render one picture. `group` receives those of the picture."""
    _add_scene_options(group, resolution)
    _add_edge_options(group)
    group.add_argument("--no-background", action="store_true", help="write a transparent background (straight alpha)")
    _add_camera_options(parser)
    _add_method_options(parser, samples)
    group = parser.add_argument_group("messages")
    group.add_argument(
        "--stats", metavar="FILE.json", help="print times, passes, fragments and bytes, or write them to a file"
    )
    _add_messages_options(group)


def _add_scene_options(group: argparse._ArgumentGroup, resolution: str, of: str = "in pixels") -> None:
    """Add the options of the picture's size and of the scene's colours."""
    add = group.add_argument
    shown = "#" + "".join(f"{round(level * 255):02x}" for level in BACKGROUND)
    add(
        "--resolution",
        type=values.resolution,
        default=resolution,
        metavar="W,H",
        help=f"width and height {of} (default: {resolution})",
    )
    add(
        "--background-color",
        type=values.background,
        default=BACKGROUND,
        metavar="COLOR",
        help=f"{PICTURE['background'].help} (default: {shown})",
    )
    text = "{} of every surface; once for all, or before each file ('file': its own)"
    add("--opacity", type=values.opacity, metavar="0..1", help=text.format("opacity"))
    add("--color", type=values.surface_color, metavar="COLOR", help=text.format("colour"))
    for name in MARKS:
        add_option(group, PICTURE[name])
    lighting = PICTURE["lighting"]
    text = "kit (lights that move with the camera), headlight (a light there), scene (the file's own lights) or none"
    default = "(default: scene if the file has lights, else kit)"
    add(lighting.flag, metavar="|".join(map(str, lighting.choices)), help=f"{text} {default}")
    add("--unlit", action="store_true", help="the colours as given, as --lighting none")
    add_option(group, PICTURE["light_intensity"])
    add_option(group, PICTURE["highlights"])


def _add_edge_options(group: argparse._ArgumentGroup) -> None:
    """Add the options that say which edges of faces are drawn, and how."""
    for name in EDGES:
        add_option(group, PICTURE[name])


def _add_camera_options(parser: argparse.ArgumentParser) -> None:
    """Add the camera options of all commands that show a scene."""
    group = parser.add_argument_group("camera")
    add = group.add_argument
    add("--camera-position", type=values.vector, metavar="X,Y,Z", help="where the camera stands (default: all in view)")
    add(
        "--camera-focal-point",
        type=values.vector,
        metavar="X,Y,Z",
        help="what it looks at (default: the centre)",
    )
    add("--camera-view-up", type=values.direction, metavar="X,Y,Z", help="what is up in the picture (default: --up)")
    add("--camera-view-angle", type=values.number, default=30.0, metavar="DEGREES", help="vertical (default: 30)")
    add(
        "--camera-direction",
        type=values.view_direction,
        metavar="X,Y,Z",
        help="where it looks; also an axis: +X, -Z, or a view: iso, xy, -xz (default: front)",
    )
    add("--camera-azimuth-angle", type=values.number, default=0.0, metavar="DEGREES", help="then turn about the up")
    add("--camera-elevation-angle", type=values.number, default=0.0, metavar="DEGREES", help="then rise")
    add("--camera-zoom-factor", type=values.positive, metavar="FACTOR", help="last, above 1 shows less, larger")
    add("--camera-orthographic", action="store_true", help="parallel projection")
    add("--up", type=values.direction, metavar="AXIS", help="the scene's up, an axis or X,Y,Z (default: +Y)")
    add(
        "--clipping-range",
        type=values.clipping_range,
        metavar="NEAR,FAR",
        help="distances to draw (default: all)",
    )


def _add_method_options(parser: argparse.ArgumentParser, samples: int | None) -> None:
    """Add the options of all commands that render: how they do it, and what they say.

    samples: a pixel; None for SAMPLES where the technique makes no map.
    """
    group = parser.add_argument_group("method")
    _add_technique_options(group)
    text = "with auto: what it chose, why, and what others would have cost"
    group.add_argument("--explain", action="store_true", help=text)
    text = f"write a map: {', '.join(VIEW_MAPS)} or the technique's own, to .npy, .npz, .exr, .tif or .png; repeatable"
    group.add_argument("--map", action="append", metavar="NAME=FILE", help=text)
    text = "do not write into the files how they were made, which the names of the mesh files are a part of"
    group.add_argument("--no-provenance", action="store_true", help=text)
    each = PICTURE["samples"]
    if samples is None:
        each = replace(each, help=f"{each.help} (default: {SAMPLES}, or 1 for a map)")
    add_option(group, each, samples)
    _add_device_options(group)


def _add_technique_options(group: argparse._ArgumentGroup) -> None:
    """Add the technique, and the options of techniques and of all pictures that stand beside it."""
    text = "default: sort, exact; auto: what it takes; 'clpeel techniques' lists them"
    group.add_argument("--technique", default="sort", metavar="NAME", help=text)
    for each in (*technique_options().values(), *(PICTURE[name] for name in METHOD)):
        add_option(group, each)


def technique_options() -> dict[str, Option]:
    """Return the options, by name, that some techniques have besides those of all pictures."""
    found: dict[str, Option] = {}
    for each in (*(technique.options for technique in TECHNIQUES.values()), AutoOptions):
        for own in options_of(each):
            found.setdefault(own.name, own)
    return found


def add_option(group: argparse._ArgumentGroup, each: Option, default: object = None) -> None:
    """Add the flag of an option. An option that is not given is None, so that the technique's own default applies."""
    if each.kind is None:
        group.add_argument(
            each.flag, dest=each.name, action="store_const", const=each.default is False, help=each.flag_help
        )
        return
    text = each.flag_help if default is None else f"{each.flag_help} (default: {default})"
    read = values.for_argparse(each.kind.parse)
    group.add_argument(each.flag, dest=each.name, type=read, default=default, metavar=each.kind.metavar, help=text)


def _add_device_options(group: argparse._ArgumentGroup) -> None:
    """Add the device options of all commands that compute."""
    add_option(group, PICTURE["memory"])
    _add_which_device(group)


def _add_which_device(group: argparse._ActionsContainer) -> None:
    """Add the options of the device that kernels are compiled for."""
    add = group.add_argument
    add("--device", metavar="DEVICE", help="number, or part of a name, as 'clpeel devices' shows them")
    add(
        "--lanes",
        type=values.count,
        metavar="N",
        help="work-items a tile: 1, 16, 32, 64 or 128 (default: 1 on a CPU, else 64)",
    )


def _add_messages_options(group: argparse._ActionsContainer) -> None:
    """Add the message options of all commands that compute."""
    add = group.add_argument
    add("--no-progress", action="store_true", help="no progress bar (it shows on a terminal, on long work)")
    add("--quiet", action="store_true", help="print errors only")
    add("--verbose", action="store_true", help="say what is done; on an error, show the whole trace")


def add_settings_options(parser: argparse.ArgumentParser, scene: bool = False) -> None:
    """Add the options that all commands have: where their defaults come from. scene: of one that draws a scene file."""
    add = parser.add_argument
    text = "defaults of options, in place of those of your ~/.config/clpeel/config.toml"
    add("--config", metavar="FILE.toml", help=text)
    add("--no-config", action="store_true", help="no such defaults")
    if scene:
        text = "write what this command line says as a scene file, which clpeel render reads, too"
        add("--write-scene", metavar="FILE.toml", help=text)


def add_complexity_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `complexity`: those of `render` that apply to counting."""
    group = parser.add_argument_group("picture")
    _add_output(group, "complexity.png", "OUT.png", "PNG file of the heat map, or - for standard output")
    group.add_argument("--json", metavar="FILE", help="write the figures, too")
    group.add_argument("--no-scale-bar", action="store_true", help="no scale bar in the heat map")
    _add_scene_options(group, "1024,1024")
    group.add_argument("--no-background", action="store_true", help="write a transparent background (straight alpha)")
    _add_camera_options(parser)
    group = parser.add_argument_group("method")
    text = "count what is in front of opaque surfaces alone (default), or all"
    group.add_argument("--opaque", metavar="first|blend", default="first", help=text)
    _add_device_options(group)
    _add_messages_options(parser.add_argument_group("messages"))


def add_warm_up_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `warm-up`: what to compile, and for which device."""
    add = parser.add_argument
    add("--techniques", type=values.names, metavar="NAME,...", help="only these (default: all)")
    add("--jobs", type=values.count, metavar="N", help="processes that compile side by side (default: one a core)")
    _add_which_device(parser)
    _add_messages_options(parser)


def add_check_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `devices`."""
    add = parser.add_argument
    add("--check", action="store_true", help="test the devices, compiling kernels where needed")
    add("--device", metavar="DEVICE", help="with --check: only this one, by number or part of a name")
    add("--techniques", type=values.names, metavar="NAME,...", help="with --check: only these (default: all)")
    text = "with --check: the most that a test may take (default: 60)"
    add("--timeout", type=values.positive, default=60.0, metavar="SECONDS", help=text)
    add("--no-progress", action="store_true", help="no progress bar (it shows on a terminal)")


def add_compare_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of `compare`: what to compare, and the scene, camera and device options of `render`."""
    group = parser.add_argument_group("comparison")
    add = group.add_argument
    add("--techniques", type=values.names, metavar="NAME,...", help="only these (default: all that make this picture)")
    text = "of colour buffers: float32, half, unorm8 (default: float32 and that of the technique's paper)"
    add("--precisions", type=values.names, metavar="NAME,...", help=text)
    add(
        "--budgets",
        type=values.counts,
        default=(),
        metavar="N,...",
        help="passes to stop after, of those that peel, such as 1,2,4 (default: none, beside no limit)",
    )
    add("--frames", type=values.count, default=5, metavar="N", help="timed of each, after one that is not (default: 5)")
    add = parser.add_argument_group("a standard set of scenes, in place of files").add_argument
    add("--suite", action="store_true", help="compare on eight scenes, over white, and rank the techniques")
    text = "with --suite: only these of dragon, spheres, boxes, grass, hair, smoke, shells, foliage"
    add("--scenes", type=values.names, metavar="NAME,...", help=text)
    text = "with --suite: folder that has the dragon, dragon_vrip.ply.gz (default: $CLPEEL_SHARED/models)"
    add("--models", metavar="DIR", help=text)
    group = parser.add_argument_group("output, besides the table on standard output")
    add = group.add_argument
    add("--json", metavar="FILE", help="write all figures, and each frame's time, or - for standard output")
    add("--csv", metavar="FILE", help="write a line of figures for each row")
    add("--html", metavar="FILE", help="write a page with the pictures, maps of errors, and time against error")
    group = parser.add_argument_group("picture")
    _add_scene_options(group, "1024,1024")
    _add_camera_options(parser)
    group = parser.add_argument_group("method")
    add_option(group, PICTURE["opaque"])
    _add_device_options(group)
    _add_messages_options(parser.add_argument_group("messages"))
