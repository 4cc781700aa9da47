"""Scenes for tests: seeded random soups, stacks, grids, fans, quads, and the bench scenes where they are at hand."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import clpeel

ROOT = Path(__file__).resolve().parents[2]
SHARED = Path(os.environ.get("CLPEEL_SHARED", ROOT.parent / "shared"))
COLORS = ("flat8", "flat", "vertex8", "vertex")  # uint8 or float32, one a face or one a vertex
SIZES = {"small": (0.02, 0.15), "large": (0.5, 1.5), "mixed": (0.01, 1.5)}  # radius of a triangle, drawn log-uniformly


@dataclass(frozen=True)
class Soup:
    """Triangles with the fields of clpeel.Scene, so that the twin can be tested without clpeel."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    face_colors: NDArray[Any] | None = None
    vertex_colors: NDArray[Any] | None = None
    color: NDArray[Any] | None = None
    materials: tuple[Any, ...] = ()
    face_materials: NDArray[np.int64] | None = None
    uv: NDArray[np.float64] | None = None
    single_sided: NDArray[np.bool_] | None = None

    def scene(self) -> clpeel.Scene:
        """The same as a clpeel.Scene."""
        import clpeel

        return clpeel.Scene.from_arrays(
            self.vertices,
            self.faces,
            self.face_colors,
            self.vertex_colors,
            self.color,
            materials=self.materials,
            face_materials=self.face_materials,
            uv=self.uv,
            single_sided=self.single_sided,
        )

    def take(self, order: Any) -> Soup:
        """Only these faces, in this order."""
        names = ("faces", "face_colors", "face_materials", "single_sided")
        return replace(self, **{name: each[order] for name in names if (each := getattr(self, name)) is not None})


@dataclass(frozen=True)
class Eye:
    """A view with the fields of clpeel.Camera."""

    position: tuple[float, float, float] = (0.0, 0.0, 4.0)
    focal_point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    view_up: tuple[float, float, float] = (0.0, 1.0, 0.0)
    view_angle: float = 30.0
    clipping_range: tuple[float, float] | None = (2.0, 6.0)
    orthographic: bool = False

    def camera(self) -> clpeel.Camera:
        """The same as a clpeel.Camera."""
        import clpeel

        return clpeel.Camera(**self.__dict__)


BENCH = Eye()  # the camera of the bench scenes
# One world unit is one pixel of an image 2 h high when the view is h away: the origin is the image's middle.
AHEAD = Eye(position=(0.0, 0.0, 0.0), focal_point=(0.0, 0.0, -1.0), view_angle=90.0, clipping_range=(0.5, 8.0))


def pixel_view(height: int) -> Eye:
    """An orthographic view in which one world unit is one pixel; the origin is the image's middle, z = 0 is 1 away."""
    angle = float(np.degrees(2 * np.arctan(height / 2)))
    return Eye((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), view_angle=angle, clipping_range=(0.25, 4.0), orthographic=True)


def merge(*soups: Soup) -> Soup:
    """All soups in one, in order; all coloured by face."""
    faces, base = [], 0
    for soup in soups:
        faces.append(soup.faces + base)
        base += len(soup.vertices)
    colors = [soup.face_colors for soup in soups if soup.face_colors is not None]
    return Soup(np.concatenate([soup.vertices for soup in soups]), np.concatenate(faces), np.concatenate(colors))


def paint(vertices: Any, faces: Any, rgba: Any) -> Soup:
    """Vertices and faces with one colour for all, or one a face: integers 0..255 or floats 0..1."""
    vertices = np.asarray(vertices, np.float64).reshape(-1, 3)
    faces = np.asarray(faces, np.int64).reshape(-1, 3)
    colors = np.asarray(rgba)
    colors = colors.astype(np.uint8 if colors.dtype.kind in "iu" else np.float32)
    return Soup(vertices, faces, np.ascontiguousarray(np.broadcast_to(colors, (len(faces), 4))))


def separate(triangles: Any, rgba: Any) -> Soup:
    """Triangles [n, 3, 3] that share no vertex."""
    triangles = np.asarray(triangles, np.float64)
    return paint(triangles, np.arange(3 * len(triangles)), rgba)


def random(
    seed: int, count: int = 200, size: str = "mixed", colors: str = "flat8", alpha: tuple[float, float] = (0.1, 0.9)
) -> Soup:
    """Random triangles of mixed winding within about 1 of the origin."""
    rng = np.random.default_rng(seed)
    low, high = np.log(SIZES[size])
    radius = np.exp(rng.uniform(low, high, (count, 1, 1)))
    vertices = (rng.uniform(-0.8, 0.8, (count, 1, 3)) + radius * rng.uniform(-1, 1, (count, 3, 3))).reshape(-1, 3)
    vertices = vertices.astype(np.float32).astype(np.float64)
    faces = np.arange(3 * count).reshape(count, 3)
    values = rng.random((count if colors.startswith("flat") else 3 * count, 4))
    values[:, 3] = alpha[0] + (alpha[1] - alpha[0]) * values[:, 3]
    painted = np.round(values * 255).astype(np.uint8) if colors.endswith("8") else values.astype(np.float32)
    if colors.startswith("flat"):
        return Soup(vertices, faces, face_colors=painted)
    return Soup(vertices, faces, vertex_colors=painted)


def stack(distances: Sequence[float] | NDArray[Any], rgba: Any, reach: float = 4.0) -> Soup:
    """One triangle a distance, facing AHEAD and covering `reach` times half the view, in x and in y."""
    d = np.asarray(distances, np.float64)
    shape = np.array([[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]]) * reach
    corners = np.empty((len(d), 3, 3))
    corners[..., :2] = shape * d[:, None, None]
    corners[..., 2] = -d[:, None]
    return separate(corners, rgba)


def with_opaque(soup: Soup) -> Soup:
    """The same to be seen, with an opaque face behind BENCH and AHEAD: kernels for all that has some are enough."""
    behind = separate([[[0.1, 0.2, 5.1], [0.3, 0.2, 5.1], [0.1, 0.4, 5.1]]], np.ones(4))
    return merge(soup, behind)


def grid(
    columns: int,
    rows: int,
    low: tuple[float, float],
    high: tuple[float, float],
    rgba: Any,
    jitter: float = 0.0,
    seed: int = 0,
) -> Soup:
    """A flat grid of columns x rows quads at z = 0, its diagonals mixed, its inner vertices jittered (in cells)."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(low[0], high[0], columns + 1), np.linspace(low[1], high[1], rows + 1))
    moves = rng.uniform(-jitter, jitter, (2, rows + 1, columns + 1))
    moves[:, [0, -1]] = 0
    moves[:, :, [0, -1]] = 0
    x = x + moves[0] * (high[0] - low[0]) / columns
    y = y + moves[1] * (high[1] - low[1]) / rows
    vertices = np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3)
    a = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    b, c, d = a + 1, a + columns + 2, a + columns + 1
    turned = rng.random(len(a)) < 0.5
    first = np.where(turned[:, None], np.stack([a, b, d], -1), np.stack([a, b, c], -1))
    second = np.where(turned[:, None], np.stack([b, d, c], -1), np.stack([a, c, d], -1))
    return paint(vertices, rng.permutation(np.concatenate([first, second])), rgba)


def fan(corners: int, radius: float, rgba: Any, centre: tuple[float, float] = (0.0, 0.0), phase: float = 0.1) -> Soup:
    """A disc of triangles about one vertex at z = 0, windings alternating."""
    angle = phase + 2 * np.pi * np.arange(corners) / corners
    rim = np.stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle), np.zeros(corners)], -1)
    k = np.arange(corners)
    faces = np.stack([np.zeros_like(k), 1 + k, 1 + (k + 1) % corners], -1)
    faces[1::2] = faces[1::2, ::-1]
    return paint(np.concatenate([[[*centre, 0.0]], rim]), faces, rgba)


def quad(angle: float, half: float, rgba: Any, centre: tuple[float, float] = (0.0, 0.0)) -> Soup:
    """A square of two triangles at z = 0, turned by an angle in radians."""
    turn = angle + np.pi / 4 + np.pi / 2 * np.arange(4)
    reach = half * np.sqrt(2)
    points = np.stack([centre[0] + reach * np.cos(turn), centre[1] + reach * np.sin(turn), np.zeros(4)], -1)
    return paint(points, [[0, 1, 2], [0, 2, 3]], rgba)


def sphere(
    radius: float, rgba: Any, columns: int = 24, rows: int = 12, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Soup:
    """A closed sphere of latitude and longitude."""
    u = 2 * np.pi * np.arange(columns) / columns
    v = np.pi * np.arange(rows + 1) / rows
    points = np.stack(
        [np.outer(np.sin(v), np.cos(u)), np.outer(np.sin(v), np.sin(u)), np.outer(np.cos(v), np.ones(columns))], -1
    )
    i, j = (part.reshape(-1) for part in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    a, b = i * columns + j, i * columns + (j + 1) % columns
    upper = np.stack([a, b, a + columns], -1)[i > 0]
    lower = np.stack([b, b + columns, a + columns], -1)[i < rows - 1]
    return paint(points.reshape(-1, 3) * radius + np.asarray(centre), np.concatenate([upper, lower]), rgba)


def bench(name: str, **options: Any) -> Soup | None:
    """A scene of the shared bench, or None where that is missing."""
    path = SHARED / "bench" / "scenes.py"
    if not path.is_file():
        return None
    spec = importlib.util.spec_from_file_location("clpeel_bench_scenes", path)
    if spec is None or spec.loader is None:
        return None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    vertices, faces, colors = getattr(module, name)(**options)
    return Soup(vertices.astype(np.float64), faces, colors)
