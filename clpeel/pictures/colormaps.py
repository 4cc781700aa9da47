"""Colour maps: which colour stands for which number, from a name, a list of colours, or another library's map.

A scene's scalars are mapped with one (scene/scalars.py), and a scale bar shows it (scale_bar.py). matplotlib and cmap
know hundreds of names, so they are asked for all but a few. Neither is needed otherwise.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import number, whole_number
from clpeel.color import parse_color
from clpeel.errors import InputError
from clpeel.pictures.colormap import colors_at

Rgba = tuple[int, int, int, int]
"""A colour, 0..255 each."""

DEFAULT_COLORS = 256
"""How many colours a map has, unless it is a list."""

MOST_COLORS = (1 << 14) - 2
"""The most colours of a map: with those below and above, they are the texels of a row of a texture."""


@dataclass(frozen=True, eq=False)
class ColorMap:
    """Which colour stands for which number.

    colors: uint8 [k, 4], straight RGBA, from the least numbers to the greatest. Each stands for an equal part of
    `clim`.
    clim: the least and the greatest number. The latter has the last colour.
    log_scale: whether the logarithms of numbers are mapped. Then numbers of 0 or less are below all others.
    below, above: of numbers beyond `clim`; None for the first and the last colour. nan: where there is no number; None
    for nothing. label: what the numbers are. categories: names of the colours, if these stand for a kind each.
    """

    colors: NDArray[np.uint8]
    clim: tuple[float, float]
    log_scale: bool = False
    below: Rgba | None = None
    above: Rgba | None = None
    nan: Rgba | None = None
    label: str = ""
    categories: tuple[str, ...] = ()

    def places(self, values: Any) -> NDArray[np.float64]:
        """Return where numbers lie among the colours: 0 where the first begins, k where the last ends.

        Numbers outside of `clim` lie beyond these, and may be infinite. NaN stays NaN.
        """
        given, (low, high) = np.asarray(values, np.float64), self.clim
        with np.errstate(all="ignore"):
            if self.log_scale:
                given = np.where(np.isnan(given), np.nan, np.log10(np.maximum(given, 0)))
                low, high = math.log10(low), math.log10(high)
            return np.asarray((given / 2 - low / 2) / (high / 2 - low / 2) * len(self.colors))

    def __call__(self, values: Any) -> NDArray[np.uint8]:
        """Return the colours of numbers: uint8 [..., 4]."""
        places, count = self.places(values), len(self.colors)
        shown = self.row[np.clip(np.nan_to_num(np.floor(places)), -1, count).astype(np.int64) + 1]
        shown[places == count] = self.colors[-1]
        shown[np.isnan(places)] = self.nan or (0, 0, 0, 0)
        return shown

    @property
    def row(self) -> NDArray[np.uint8]:
        """The colours, with those below in front of them and those above behind: uint8 [k + 2, 4]."""
        first = self.colors[0] if self.below is None else self.below
        last = self.colors[-1] if self.above is None else self.above
        return np.vstack([first, self.colors, last]).astype(np.uint8)

    @property
    def boxes(self) -> list[tuple[str, Rgba]]:
        """The colours that stand beside the others in a scale bar, with their names."""
        named = (("above", self.above), ("below", self.below), ("no number", self.nan))
        return [(name, color) for name, color in named if color is not None and color[3] > 0]


# --- colours of a map -------------------------------------------------------------------------------------------------


def sampled(cmap: Any, count: int | None = None, kinds: bool = False) -> NDArray[np.uint8]:
    """Return the colours of a map, RGBA, uint8 [k, 4].

    cmap: a name, with "_r" behind it to turn it round; a list of colours; or a map of matplotlib or cmap. count: how
    many colours; by default those of a list, or DEFAULT_COLORS. kinds: whether they stand for kinds. Then the first
    colours of a list are taken, and the list begins again where it ends. So it is with maps that are lists themselves
    ("tab10").

    Raises InputError for anything else.
    """
    if count is not None:
        count = whole_number("n_colors", count, MOST_COLORS)
    if isinstance(cmap, str):
        found = _named(cmap)
    elif callable(cmap):
        found = cmap
    else:
        return _of_list(cmap, count, kinds)
    own = _own_list(found) if kinds else None
    if own is not None:
        return _of_list(own, count, kinds)
    levels = np.asarray(found(np.linspace(0, 1, count or DEFAULT_COLORS)), np.float64)
    rgba = np.ones((len(levels), 4))
    rgba[:, : levels.shape[1]] = levels
    return np.rint(np.clip(rgba, 0, 1) * 255).astype(np.uint8)


def checked_rgba(name: str, value: Any) -> Rgba | None:
    """Return a colour as RGBA 0..255; None stays. value: text, or 3 or 4 numbers 0..1. Raises InputError."""
    if value is None:
        return None
    try:
        parts = [*parse_color(value, alpha=True)] if isinstance(value, str) else [number(part) for part in value]
    except TypeError:
        parts = []
    except InputError as error:
        raise InputError(f"{name}: {error}") from None
    if len(parts) not in (3, 4) or not all(0 <= part <= 1 for part in parts):
        raise InputError(f"{name}: expected text, or 3 or 4 numbers 0..1, got {value!r}")
    red, green, blue, alpha = (round(part * 255) for part in (*parts, 1.0)[:4])
    return red, green, blue, alpha


def _of_list(given: Any, count: int | None, kinds: bool) -> NDArray[np.uint8]:
    """Return the colours of a list, or as many between them as are asked for."""
    if not isinstance(given, Iterable):
        raise InputError(f"cmap: expected a name, a list of colours or a map, got {type(given).__name__}")
    colors = np.array([checked_rgba("cmap", color) for color in given], np.uint8).reshape(-1, 4)
    if not 1 <= len(colors) <= MOST_COLORS:
        raise InputError(f"cmap: expected 1..{MOST_COLORS:,} colours, got {len(colors):,}")
    if count is None or count == len(colors):
        return colors
    if kinds:
        return np.resize(colors, (count, 4))
    at = np.linspace(0, len(colors) - 1, count)
    levels = [np.interp(at, np.arange(len(colors)), colors[:, channel]) for channel in range(4)]
    return np.rint(np.stack(levels, axis=-1)).astype(np.uint8)


def _own_list(cmap: Any) -> Any:
    """Return the colours of a map that is a list of a few, or None."""
    if getattr(cmap, "interpolation", None) == "nearest":  # of cmap
        return [tuple(stop.color) for stop in cmap.color_stops]
    listed = getattr(cmap, "colors", None)  # of matplotlib
    return listed if listed is not None and len(listed) < DEFAULT_COLORS // 4 else None


# --- names ------------------------------------------------------------------------------------------------------------

Sampler = Callable[[NDArray[np.float64]], Any]


def _grey(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.repeat(values[:, None], 3, axis=1)


BUILT_IN: dict[str, Sampler] = {"viridis": colors_at, "gray": _grey}
"""Maps that need no library. So they have the same bytes everywhere."""

LIBRARIES = ("matplotlib", "cmap")


def _named(name: str) -> Sampler:
    """Return the map of that name. Raises InputError, which says what to install, or which name is nearest."""
    stem = name.removesuffix("_r")
    own = BUILT_IN.get(stem)
    if own is not None:
        return own if stem == name else lambda values: own(1 - values)
    known, missing = list(BUILT_IN), list[str]()
    for library in LIBRARIES:
        try:
            module = import_module(library)
        except ImportError:
            missing.append(library)
            continue
        if library == "matplotlib":
            known += list(module.colormaps)
            if name in module.colormaps:
                found: Sampler = module.colormaps[name]
                return found
        else:
            known += [each.rpartition(":")[2] for each in module.Catalog()]
            try:
                found = module.Colormap(name)
                return found
            except Exception:  # it raises ValueError, TypeError or others on other words
                continue
    close = difflib.get_close_matches(name, known, n=1)
    hint = f"; did you mean {close[0]}?" if close else ""
    if missing and not close:
        hint = f"; more names are known after pip install {' '.join(missing)}"
    built_in = ", ".join(BUILT_IN)
    shown = f"one of {built_in}" if len(missing) == len(LIBRARIES) else f"a name of {' or '.join(LIBRARIES)}"
    raise InputError(f"cmap: expected {shown}, got {name!r}{hint}")
