"""What the tests share: both machine shapes, shared models, how much hypothesis tries, and how pictures are judged."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from numpy.typing import NDArray
from twins import reference, soups
from twins.materials import Roundings

# Kernels may be compiled within an example, so no deadline; the function-scoped `lanes` and `judge` keep no state.
settings.register_profile(
    "clpeel", deadline=None, max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
settings.register_profile("ci", settings.get_profile("clpeel"), max_examples=6, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if os.environ.get("CI") else "clpeel"))

os.environ["CLPEEL_CONFIG"] = ""  # no test is drawn by the settings of whoever runs it

SLOW = ("test_drivers", "test_page", "test_notebook", "test_window", "test_bench", "test_oclgrind", "test_rusticl")
"""Files that take minutes. They come first, so that no process is left with one of them when the others are done."""

LANES = (1, 64)
Booleans = NDArray[np.bool_]
Floats = NDArray[np.float64]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts the tests of slow files first. All others keep their order."""
    items.sort(key=lambda item: SLOW.index(item.path.stem) if item.path.stem in SLOW else len(SLOW))


@pytest.fixture(params=LANES, ids=lambda lanes: f"lanes{lanes}")
def lanes(request: pytest.FixtureRequest) -> int:
    """Work-items that share a tile: both shapes of machine, on whatever device there is."""
    return int(request.param)


@pytest.fixture(scope="session")
def opened() -> Callable[..., Any]:
    """clpeel's open_device, but each device is opened, and each kernel built, once for all tests."""
    from clpeel.device.devices import open_device

    return cache(open_device)


@pytest.fixture
def shared_devices(opened: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets a test use devices that other tests have used: faster, and nothing that was left there may show."""
    import clpeel.rendering.renderer

    monkeypatch.setattr(clpeel.rendering.renderer, "open_device", opened)


@pytest.fixture
def squares(tmp_path: Path) -> Path:
    """Two nested squares, the farther one larger, so that one layer is in view beside the nearer and two through it."""
    path = tmp_path / "squares.off"
    path.write_text(
        "OFF\n8 4 0\n-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n-.5 -.5 1\n.5 -.5 1\n.5 .5 1\n-.5 .5 1\n"
        "3 0 1 2\n3 0 2 3\n3 4 5 6\n3 4 6 7\n"
    )
    return path


def printed(capfd: pytest.CaptureFixture[str]) -> tuple[list[str], list[str]]:
    """The lines on standard output and on standard error; a compiler may have added its own."""
    out, err = capfd.readouterr()
    return out.splitlines(), [line for line in err.splitlines() if "warnings generated" not in line]


@pytest.fixture
def model() -> Callable[[str], Path]:
    """model("bunny.ply") is the path of a shared model; the test is skipped where there is none."""

    def find(name: str) -> Path:
        path = soups.SHARED / "models" / name
        if not path.is_file():
            pytest.skip(f"needs the model {name} in a folder models below CLPEEL_SHARED (now {soups.SHARED})")
        return path

    return find


@pytest.fixture
def bench() -> Callable[..., soups.Soup]:
    """bench("boxes", n=4) is that scene of the shared bench; the test is skipped where there is none."""

    def make(name: str, **options: Any) -> soups.Soup:
        soup = soups.bench(name, **options)
        if soup is None:
            pytest.skip(f"needs bench/scenes.py below CLPEEL_SHARED (now {soups.SHARED})")
        return soup

    return make


class Judge:
    """Compares pictures; where they differ too much, saves both and the difference and names the folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def fail(self, reason: str, got: NDArray[np.uint8], want: NDArray[np.uint8], bad: NDArray[np.bool_]) -> None:
        """Fail with a reason; `bad` [h, w] says which pixels."""
        from PIL import Image

        difference = np.abs(got.astype(int) - want.astype(int)).max(axis=2)
        shown = np.stack([bad * 255, np.minimum(difference * 16, 255), np.minimum(difference, 255)], -1)
        pictures = {"got": got, "want": want, "difference": shown.astype(np.uint8)}
        for name, picture in pictures.items():
            Image.fromarray(np.ascontiguousarray(picture)).save(self.folder / f"{name}.png")
        row, column = np.argwhere(bad)[0]
        pytest.fail(
            f"{reason}: {bad.sum()} of {bad.size} pixels; the first is row {row}, column {column}: "
            f"got {got[row, column]}, want {want[row, column]}. Pictures: {self.folder}/got.png, want.png, "
            "difference.png (red: wrong, green: difference x 16, blue: difference)"
        )

    def same_bits(self, got: Any, want: Any, reason: str = "expected the same bits") -> None:
        """Two results of clpeel, images and colours, bit for bit."""
        color = (got.color.view(np.uint32) != want.color.view(np.uint32)).any(axis=2)
        bad = color | (got.image != want.image).any(axis=2)
        if bad.any():
            self.fail(reason, got.image, want.image, bad)

    def color(self, result: Any, want: Any, bound: Any, reason: str = "beyond the float32 bound") -> None:
        """result.color against premultiplied RGBA (broadcast to [h, w, 4]) within `bound` (broadcast to [h, w])."""
        want = np.broadcast_to(np.asarray(want, np.float64), result.color.shape)
        error = np.abs(result.color - want).max(axis=2)
        bad = ~(error <= np.broadcast_to(bound, error.shape))
        if bad.any():
            got, wanted = (reference.image(color, (0.0, 0.0, 0.0)) for color in (result.color, want))
            worst = np.unravel_index(np.nanargmax(np.where(bad, error, -1)), error.shape)
            self.fail(f"{reason}, worst {error[worst]:.3g} at {tuple(map(int, worst))}", got, wanted, bad)

    def image(self, result: Any, background: Any) -> None:
        """result.image is its result.color over the background, x 255 + 0.5 and clamped, but for halves float32 misses.

        In float32 the sum C + T b, or the quotient, and its product with 255 are off by at most 4 roundings of 255.
        """
        exact = reference.levels(result.color, background) + 0.5
        slack = 4 * 255 * reference.UNIT
        if background is None:  # C / (1 - T): T's rounding, 2^-24, weighs the more the smaller 1 - T is
            slack = slack + 2 * 255 * reference.UNIT / np.maximum(result.color[..., 3:], reference.UNIT)
        low, high = (np.clip(np.floor(exact + s), 0, 255) for s in (-slack, slack))
        bad = ((result.image < low) | (result.image > high)).any(axis=2)
        if bad.any():
            self.fail(
                "image is not its color over the background",
                result.image,
                reference.image(result.color, background),
                bad,
            )

    def weigh(
        self,
        soup: Any,
        view: Any,
        size: tuple[int, int],
        backfaces: str = "default",
        anisotropy: int = 1,
        aside: tuple[float, float] = (0.0, 0.0),
        once: Booleans | None = None,
    ) -> tuple[reference.Picture, Booleans, Floats]:
        """The twin's picture, the pixels [h, w] that are excused, and how far color may be off elsewhere [h, w].

        aside, once: see reference.render.
        """
        twin = reference.render(soup, view, size, backfaces, anisotropy, aside, once)
        distance = reference.edge_distance(soup, view, size, EDGE_RELATIVE, backfaces, aside)
        edge = distance <= reference.SNAP + EDGE_ROUNDING
        tie = self.ties(twin)
        assert (twin.bound <= (3 * twin.layers + 4) * reference.UNIT).all()
        bound = twin.bound
        if soup.face_materials is not None:
            stray, doubtful = reference.paint_bound(
                soup, twin, INTERPOLATION_SHIFT, INTERPOLATION_ROUNDING, PAINTING, anisotropy
            )
            return twin, edge | tie | doubtful, bound + stray
        if soup.vertex_colors is not None:
            bound = bound + reference.interpolation_bound(twin, INTERPOLATION_SHIFT, INTERPOLATION_ROUNDING)
        return twin, edge | tie, bound

    def painted(
        self,
        result: Any,
        soup: Any,
        view: Any,
        size: tuple[int, int],
        background: Any = (1.0, 1.0, 1.0),
        backfaces: str = "default",
        anisotropy: int = 1,
    ) -> reference.Picture:
        """A picture of a scene with materials against the twin's, wherever it is sure what that is."""
        twin, excused, bound = self.weigh(soup, view, size, backfaces, anisotropy)
        assert excused.mean() < 0.2, "so much is excused that nothing is tested"
        self.color(result, twin.color, np.where(excused, np.inf, bound))
        self.image(result, background)
        return twin

    def ties(self, twin: reference.Picture) -> Booleans:
        """Pixels where the depth does not say which layer is in front."""
        if not twin.projected.orthographic:
            return reference.near_tie(twin, TIE)
        near, far = twin.projected.clipping
        extent = far - near if np.isfinite(far) else 1.01 * float(np.ptp(twin.projected.distance))
        return reference.near_tie(twin, 0.0, TIE * extent)

    def against_twin(
        self, result: Any, soup: Any, view: Any, size: tuple[int, int], background: Any = (1.0, 1.0, 1.0)
    ) -> reference.Picture:
        """The whole of what is promised against the float64 twin, see test_equality.py."""
        twin, excused, bound = self.weigh(soup, view, size)
        want = reference.image(twin.color, background)
        off = np.abs(result.image.astype(int) - want.astype(int)).max(axis=2) > 1
        if (off & ~excused).any():
            self.fail("off by more than 1/255 away from every edge", result.image, want, off & ~excused)
        if off.mean() > 0.001:
            self.fail("more than 0.1 % of the pixels are off by more than 1/255", result.image, want, off)
        self.color(result, twin.color, np.where(excused, np.inf, bound), "interior beyond the float32 bound")
        self.image(result, background)
        return twin


# How far beyond 1/512 pixel rounding may move an edge. Clip space is computed in pairs of float32, which hold 2^-44 of
# their sums at worst after three products, as many sums and the quotient; cuts at the clipping planes are made in pairs
# too. So an edge is off by less than 2^-40 of the coordinates of its ends.
EDGE_RELATIVE = 2.0**-40
# Ends that are cuts are snapped like any corner, so they add nothing. What is left is the twin's own rounding.
EDGE_ROUNDING = 1e-9
# Layers closer than this share of their distance (orthographic: of the clipping range) have float32 depths that do not
# say which is in front. A depth is near / distance at three corners (1 rounding, and 3 for its shift to the snapped
# corner), and their average with positive weights (2 a weight where edge functions pass 2^32, 3 sums, the reciprocal
# area 2, the last product 1): 12 roundings of 2^-24 for either layer.
TIE = 24 * reference.UNIT
# Colours are evaluated where the exact triangle has them, not where the snapped one does. That correction is made in
# float32, and its gradients lose about 6 roundings times the triangle's length over its width: for triangles up to 2^15
# times longer than wide it misses by less than 1/64 of itself.
INTERPOLATION_SHIFT = reference.SNAP / 64
# Barycentric weights are products of a rounded integer and a rounded share (3 of each summed: 6 roundings at most), are
# divided by their sum (6 + 2), and weigh three colours (5 more): below 20 roundings of a number up to 1.
INTERPOLATION_ROUNDING = 20 * reference.UNIT
# What else becomes of a fragment with a material, in roundings of 2^-24:
# - a coordinate within 0..1 is rounded when it is brought there, multiplied with the image's side, and less 1/2: 3, and
#   1 where probes lie beside it;
# - a byte's light is rounded once, and each of 4 steps between texels, one after another, three times, of numbers up to
#   1: 13; a mean of up to 16 probes 16 times more;
# - a colour is a product of up to 4 numbers, of which 2 are rounded before: 6;
# - sRGB is a polynomial to 3e-8, half a rounding, and its last step rounds twice; then a rounded scale, its product,
#   1.055 that is rounded, its product, and a difference: below 8 in all, of numbers up to 1.2;
# - a level of detail is half a logarithm by a polynomial, off by 5e-6 at most, of squares that are rounded 4 times.
PAINTING = Roundings(
    uv=4 * reference.UNIT, texel=29 * reference.UNIT, product=6 * reference.UNIT, srgb=8 * reference.UNIT, lod=1e-5
)


@pytest.fixture
def judge(tmp_path: Path) -> Judge:
    """Compares pictures and saves those that differ below pytest's temporary folder."""
    return Judge(tmp_path)
