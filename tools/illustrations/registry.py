"""The registry: each picture of the documentation, and the command that makes it. No other place lists them all."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from illustrations.examples import DOCS, ROOT, examples_of

Kind = Literal["drawn", "peers", "measured", "by hand"]
KINDS: dict[Kind, str] = {
    "drawn": "by clpeel, with the same pixels each time",
    "peers": "with the help of other programs, whose versions change pixels",
    "measured": "of times, which differ from run to run; the same command renews the numbers of the page",
    "by hand": "once, by hand",
}
"""What a picture is made of. The tool makes anew what is `drawn` or made with `peers`."""

SUFFIXES = (".png", ".jpg", ".svg", ".webp")


@dataclass(frozen=True)
class Entry:
    """Pictures that one command makes.

    name: for the tool's command line. pictures: patterns of their files below docs. command: as it is typed in the
    root of the repository; for a picture made by hand, what was done. needs: keys of NEEDS.
    """

    name: str
    pictures: tuple[str, ...]
    command: str
    kind: Kind = "drawn"
    needs: tuple[str, ...] = ()

    def has(self, file: str) -> bool:
        """Return whether this makes the picture, a path below docs."""
        return any(fnmatchcase(file, pattern) for pattern in self.pictures)

    def files(self) -> list[str]:
        """Return the pictures that are there, as paths below docs, in order."""
        return [file for file in pictures() if self.has(file)]

    def lacks(self) -> str:
        """Return why this cannot be made here, or nothing if it can."""
        if self.kind in ("measured", "by hand"):
            return f"made {KINDS[self.kind]}"
        return "; ".join(NEEDS[need].lacks for need in self.needs if not NEEDS[need].there())


@dataclass(frozen=True)
class Need:
    """What a command needs besides clpeel. what: for the table. lacks: what to say if it is not there."""

    what: str
    lacks: str
    there: Callable[[], bool]


def _shared(folder: str) -> Callable[[], bool]:
    """Return whether the folder is in the one that CLPEEL_SHARED names."""
    return lambda: (Path(os.environ.get("CLPEEL_SHARED", ROOT.parent / "shared")) / folder).is_dir()


def _modules(*names: str) -> Callable[[], bool]:
    """Return whether all these can be imported."""
    return lambda: all(find_spec(name) for name in names)


NEEDS = {
    "models": Need("the folder `models`", "no folder models in the one that CLPEEL_SHARED names", _shared("models")),
    "bench": Need("the folder `bench`", "no folder bench in the one that CLPEEL_SHARED names", _shared("bench")),
    "maps": Need("matplotlib", "matplotlib is not installed", _modules("matplotlib")),
    "pyvista": Need("PyVista", "PyVista is not installed", _modules("pyvista")),
    "peers": Need("PyVista and f3d", "PyVista or f3d is not installed", _modules("pyvista", "f3d")),
}

TOOLS = (
    Entry("demo", ("demo.png",), "clpeel demo -o docs/demo.png"),
    Entry(
        "techniques",
        (
            *(f"techniques/{name}.png" for name in ("sort", "glowscript", "thickness", "translucency", "layer-count")),
            *(f"techniques/{name}.png" for name in ("k-buffer", "wavelet", "moments")),
            "techniques/*peeling*.png",
            "techniques/weighted-*.png",
            *(f"techniques/{name}.png" for name in ("multi-layer-alpha-blending", "adaptive")),
            "techniques/stochastic*.png",
            "complexity/demo.png",
        ),
        "python tools/technique_pictures.py",
    ),
    Entry(
        "kept-layers",
        ("techniques/kept-layers.png",),
        "python tools/plot_kept_layers.py",
        "peers",
        ("maps", "bench"),
    ),
    Entry(
        "order",
        tuple(f"order/{name}*.png" for name in ("exact", "un", "by", "weighted", "peels")),
        "python tools/draw_order.py",
    ),
    Entry(
        "command",
        ("command/rings.png",),
        "clpeel render docs/command/rings.toml, beside the torus of test_scene_file.py, which compares them",
        "by hand",
    ),
    Entry("min-max", ("techniques/min-max.png",), "python tools/min_max_picture.py"),
    Entry("samples", ("samples/patterns.png", "samples/lines.png"), "python tools/sample_patterns.py"),
    Entry("blending-space", ("looks/blending-space.png",), "python tools/draw_blending_spaces.py", needs=("models",)),
    Entry("ecosystem", ("ecosystem/*.png",), "python tools/draw_ecosystem.py", "peers", ("pyvista",)),
    Entry(
        "extremes",
        ("extremes/*.png",),
        "python tools/plot_extremes.py --output docs/extremes --report docs/extremes.md",
        "peers",
        ("maps", "bench"),
    ),
    Entry(
        "materials",
        tuple(f"materials/{name}.*" for name in ("alpha-*", "truck*", "duck", "texture-transform", "morph", "skin"))
        + tuple(f"materials/{name}.*" for name in ("engine", "fuze*", "chair", "counter")),
        "python tools/contact_sheet.py",
        "peers",
        ("models", "peers"),
    ),
    Entry(
        "looks",
        tuple(f"looks/{name}*" for name in ("bunny", "suzanne", "sensor", "chair", "fuze", "truck", "duck"))
        + tuple(f"looks/{name}*" for name in ("board", "engine", "morph")),
        "python tools/contact_sheet.py --looks",
        "peers",
        ("models", "peers"),
    ),
    Entry(
        "models",
        ("techniques/thickness-*.png", "techniques/translucency-*.png", "scalars/*.png", "looks/ground.png"),
        "python tools/draw_models.py",
        needs=("models",),
    ),
    Entry(
        "turntable",
        ("turntable/bunny.webp",),
        "clpeel turntable bunny.ply ...: docs/turntable.md has the whole command",
        "by hand",
    ),
    Entry("performance", ("performance/*.png",), "python tools/bench.py --report docs", "measured"),
    Entry(
        "auto",
        ("auto/*.png",),
        "python tools/bench.py --only auto,errors,features --rounds 3 --report docs/auto.md",
        "measured",
    ),
    Entry(
        "compare",
        ("compare/dragon.png",),
        "clpeel compare dragon.ply.gz --opacity 0.4 --html page.html; a browser showed the page",
        "by hand",
    ),
    Entry("suite", ("compare/scenes.png",), "python tools/draw_suite.py"),
    Entry(
        "outputs",
        ("outputs/maps.png",),
        "clpeel demo --map depth=depth.png --map normal=normal.png --map ...; an image editor put them side by side",
        "by hand",
    ),
    Entry("view", ("view/*.png",), "clpeel view FILE, in a browser, a window and a notebook", "by hand"),
    Entry("house", ("house/way.svg",), "drawn in a text editor", "by hand"),
)
"""All pictures but those of examples in pages."""


def entries() -> list[Entry]:
    """Return all entries: those of tools, and one for each page with marked examples."""
    return [*TOOLS, *_of_pages()]


def _of_pages() -> Iterator[Entry]:
    """Yield an entry for each page with marked examples."""
    for page in sorted(DOCS.glob("*.md")):
        if found := examples_of(page):
            shown = tuple(example.picture for example in found)
            yield Entry(page.name, shown, f"python tools/draw_examples.py docs/{page.name}")


def pictures() -> list[str]:
    """Return all picture files below docs, as paths from there, in order."""
    return sorted(str(path.relative_to(DOCS).as_posix()) for path in DOCS.rglob("*") if path.suffix in SUFFIXES)
