"""Comparing: every technique on one view, beside what blending the same fragments in float64 gives."""

from __future__ import annotations

import csv
import io
import json
import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.rendering.renderer import Progress, Renderer, check_picture_fits, checked_size
from clpeel.scene.camera import Camera
from clpeel.scene.scene import Scene, checked_background
from clpeel.stages.find_layers import Layers
from clpeel.stages.many_passes import MAX_PASSES, checked_count
from clpeel.techniques import LAYERS, TECHNIQUES, technique
from clpeel.techniques.precision import DEFAULT_PRECISION, PRECISIONS, blending_bound

STEP = 1 / 255
"""Between two neighbours of 8 bits."""

MOST_FRAMES = 10_000
HOST_BYTES = 8 * 4 * 3
"""A pixel's, about: the truth and what it is made of, float64."""

FLIP_HINT = "FLIP: not measured; pip install 'flip-evaluator>=1.6'"

FIGURES = (
    "technique",
    "precision",
    "budget",
    "exact",
    "seconds_median",
    "seconds_least",
    "seconds_greatest",
    "frames",
    "passes",
    "bytes_per_pixel",
    "memory_bytes",
    "max_error",
    "rms_error",
    "psnr",
    "share_above_1",
    "share_above_8",
    "flip",
    "truncated_pixels",
    "truncation_bound",
    "clamped_pixels",
)
"""Of a row, as files have them: fields and properties of `Row`."""


# --- what is found ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Row:
    """A technique with its options, and how its picture and its frames have turned out.

    Errors are of red, green and blue, premultiplied over the background and clamped to 0..1 as the picture shows them,
    before they are rounded to 8 bits; a number that is none (NaN) is off by 1. Shares are of the picture's pixels.

    precision: of the colour buffers. budget: the `passes` it was told to stop after, or None.
    exact: whether the technique is, when nothing stops it. seconds: of each timed frame, from a scene on the device to
    the picture on the host. passes: geometry passes, as the papers count them. bytes_per_pixel: what it keeps of a
    sample. memory_bytes: all on the device but the picture. max_error, rms_error: of 1. psnr: dB, infinite where the
    error is 0. share_above_1, share_above_8: pixels with a channel that is off by more than 1/255, 8/255. flip: the
    mean of FLIP (Andersson et al. 2020) between the 8-bit pictures, 0 alike .. 1, or None where flip-evaluator is not
    installed. truncated_pixels, truncation_bound, clamped_pixels: as of `Result.stats`. image: uint8 [height, width,
    4], and error: float32 [height, width], the greatest of a pixel's channels; None unless pictures were asked for.
    """

    technique: str
    precision: str | None
    budget: int | None
    exact: bool
    seconds: tuple[float, ...]
    passes: int
    bytes_per_pixel: float
    memory_bytes: int
    max_error: float
    rms_error: float
    psnr: float
    share_above_1: float
    share_above_8: float
    flip: float | None
    truncated_pixels: int
    truncation_bound: float
    clamped_pixels: int
    image: NDArray[np.uint8] | None = None
    error: NDArray[np.float32] | None = None

    @property
    def name(self) -> str:
        """The technique and what it was told: `weighted-sum, half`; `depth-peeling, passes 4`."""
        return named(self.technique, self.precision, self.budget)

    @property
    def seconds_median(self) -> float:
        """The median of `seconds`."""
        return statistics.median(self.seconds)

    @property
    def seconds_least(self) -> float:
        """The least of `seconds`."""
        return min(self.seconds)

    @property
    def seconds_greatest(self) -> float:
        """The greatest of `seconds`."""
        return max(self.seconds)

    @property
    def frames(self) -> int:
        """How many were timed."""
        return len(self.seconds)

    def figures(self) -> dict[str, Any]:
        """All FIGURES by name."""
        return {name: getattr(self, name) for name in FIGURES}


@dataclass(frozen=True, eq=False)
class Comparison:
    """Rows in the registry's order, and what they were compared on.

    truth: float64 [height, width, 4], premultiplied, before the background: the layers of each pixel, whose colours are
    float32, blended in float64. layers_max: most of them in a pixel; fragments: all that were blended. notes: what was
    left out, and why.
    """

    rows: list[Row]
    truth: NDArray[np.float64]
    background: tuple[float, float, float]
    lighting: str
    opaque: str
    triangles: int
    fragments: int
    layers_max: int
    device: str
    lanes: int
    notes: tuple[str, ...] = ()

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
        return self.truth.shape[1], self.truth.shape[0]

    @property
    def rounding(self) -> float:
        """What blending so many layers in float32 may be off by: (3 N + 4) 2^-24, of 1."""
        return blending_bound(self.layers_max)

    def front(self) -> list[bool]:
        """Of each row, whether no other is at once as fast and as near the truth, and better in one of these.

        By median time and RMS error; errors within `rounding` are all taken for none.
        """
        weighed = [(row.seconds_median, 0.0 if row.max_error <= self.rounding else row.rms_error) for row in self.rows]
        return [
            not any(other[0] <= mine[0] and other[1] <= mine[1] and other != mine for other in weighed)
            for mine in weighed
        ]

    def facts(self) -> dict[str, Any]:
        """What was compared on, by name, without the rows."""
        names = "background lighting opaque triangles fragments layers_max rounding device lanes notes".split()
        return {"size": self.size, **{name: getattr(self, name) for name in names}}

    def truth_image(self) -> NDArray[np.uint8]:
        """The truth over the background: uint8 [height, width, 4], by the rule x 255 + 0.5."""
        levels = np.floor(shown(self.truth, self.background) * 255 + 0.5).astype(np.uint8)
        return np.concatenate([levels, np.full_like(levels[..., :1], 255)], axis=-1)

    def table(self) -> str:
        """The rows as a table of text, and what it says."""
        front = self.front()
        lines = aligned(
            [
                ["  technique", *(heading for heading, _ in COLUMNS)],
                *(
                    [("* " if on else "  ") + row.name, *(cell(row) for _, cell in COLUMNS)]
                    for row, on in zip(self.rows, front, strict=True)
                ),
            ]
        )
        return "\n".join([*lines, "", *self.legend()])

    def legend(self) -> list[str]:
        """What the table's numbers are, a line each."""
        width, height = self.size
        return [
            f"truth: the same {self.fragments:,} fragments, at most {self.layers_max} in a pixel, blended in float64; "
            f"{width} x {height} pixels",
            "errors: of RGB over the background, of 1, before rounding to 8 bits; >1/255: share of pixels off by more",
            f"* nothing here is both faster and nearer the truth; errors within float32's {self.rounding:.1e} count as "
            "none",
            *([FLIP_HINT] if any(row.flip is None for row in self.rows) else []),
            *(f"note: {note}" for note in self.notes),
        ]

    def to_json(self) -> str:
        """`facts`, and of each row its figures, `on_front` and the `seconds` of each frame; infinite ones are null."""
        rows = [
            {**row.figures(), "on_front": on, "seconds": list(row.seconds)}
            for row, on in zip(self.rows, self.front(), strict=True)
        ]
        for row in rows:
            row["psnr"] = row["psnr"] if math.isfinite(row["psnr"]) else None
        return json.dumps({"format": 1, **self.facts(), "rows": rows}, indent=2, allow_nan=False) + "\n"

    def to_csv(self) -> str:
        """A heading and a line for each row: FIGURES and `on_front`; what a row has not is empty."""
        file = io.StringIO()
        writer = csv.DictWriter(file, [*FIGURES, "on_front"], lineterminator="\n")
        writer.writeheader()
        for row, on in zip(self.rows, self.front(), strict=True):
            writer.writerow({**row.figures(), "on_front": on})
        return file.getvalue()

    def to_html(self, title: str = "clpeel compare") -> str:
        """One page with all in it: the plot of time against error, the table, pictures and maps of errors.

        Raises InputError where the comparison was made without pictures.
        """
        from clpeel.study.page import page

        return page(self, title)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a comparison; `comparison` has the rows that were finished, with as many frames as were timed."""

    def __init__(self, comparison: Comparison):
        super().__init__()
        self.comparison = comparison


# --- how it is shown --------------------------------------------------------------------------------------------------


def named(technique: str, precision: str | None, budget: int | None) -> str:
    """`Row.name`: float32 goes without saying."""
    told = ["" if precision in (None, DEFAULT_PRECISION) else precision, "" if budget is None else f"passes {budget}"]
    return ", ".join([technique, *filter(None, told)])


def milliseconds(seconds: float) -> str:
    """Three digits or more."""
    value = 1000 * seconds
    return f"{value:.2f}" if value < 10 else f"{value:.1f}" if value < 100 else f"{value:.0f}"


def share(value: float) -> str:
    """Of 1, in percent."""
    return "0" if value == 0 else "<.01%" if value < 5e-5 else f"{value:.2%}" if value < 0.0995 else f"{value:.1%}"


def error_text(value: float) -> str:
    """Two digits."""
    return "0" if value == 0 else f"{value:.1e}"


COLUMNS: tuple[tuple[str, Callable[[Row], str]], ...] = (
    ("ms", lambda row: milliseconds(row.seconds_median)),
    ("spread", lambda row: f"{milliseconds(row.seconds_least)}-{milliseconds(row.seconds_greatest)}"),
    ("passes", lambda row: f"{row.passes}"),
    ("B/px", lambda row: f"{row.bytes_per_pixel:.0f}"),
    ("MiB", lambda row: f"{row.memory_bytes / 2**20:.{1 if row.memory_bytes < 100 * 2**20 else 0}f}"),
    ("max error", lambda row: error_text(row.max_error)),
    ("RMS", lambda row: error_text(row.rms_error)),
    ("PSNR", lambda row: f"{row.psnr:.1f}"),
    (">1/255", lambda row: share(row.share_above_1)),
    (">8/255", lambda row: share(row.share_above_8)),
    ("FLIP", lambda row: "-" if row.flip is None else error_text(row.flip) if row.flip < 5e-5 else f"{row.flip:.4f}"),
)
"""Headings and cells of the tables, after the row's name."""


def aligned(cells: Sequence[Sequence[str]]) -> list[str]:
    """Rows of cells, the first to the left, the others to the right, a space apart: wide names and all fit 120."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        " ".join([f"{row[0]:<{widths[0]}}", *(f"{text:>{n}}" for text, n in zip(row[1:], widths[1:], strict=True))])
        for row in cells
    ]


# --- how it is measured -----------------------------------------------------------------------------------------------


def true_colors(layers: Layers) -> NDArray[np.float64]:
    """The layers, back to front, each over what is behind it: float64 [height, width, 4], premultiplied."""
    width, height = layers.size
    color = np.zeros((height * width, 4))
    count = np.diff(layers.start)
    for k in reversed(range(layers.count)):
        pixels = np.flatnonzero(count > k)
        source = layers.color[layers.start[pixels] + k].astype(np.float64)
        alpha = source[:, 3:]
        source[:, :3] *= alpha
        color[pixels] = source + (1 - alpha) * color[pixels]
    return color.reshape(height, width, 4)


def shown(color: NDArray[np.floating], background: Sequence[float]) -> NDArray[np.float64]:
    """Premultiplied RGBA [height, width, 4] over the background as a picture shows it: float64 [height, width, 3]."""
    color = color.astype(np.float64)
    return np.clip(color[..., :3] + (1 - color[..., 3:]) * np.asarray(background, np.float64), 0, 1)


def flip_error(truth: NDArray[np.uint8], image: NDArray[np.uint8]) -> float | None:
    """The mean of FLIP between two pictures [height, width, 4] in sRGB, or None without flip-evaluator."""
    try:
        from flip_evaluator import evaluate
    except ImportError:
        return None
    if (truth == image).all():
        return 0.0
    reference, test = (
        np.ascontiguousarray(picture[..., :3], np.float32) / np.float32(255) for picture in (truth, image)
    )
    return float(evaluate(reference, test, "LDR", applyMagma=False)[1])


@dataclass
class _Trial:
    """A row in the making: found is what its picture told, once there is one; seconds those of its frames."""

    technique: str
    options: dict[str, Any]
    found: dict[str, Any] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)

    def row(self) -> Row:
        return Row(
            technique=self.technique,
            precision=self.options.get("precision"),
            budget=self.options.get("passes"),
            exact=TECHNIQUES[self.technique].exact,
            seconds=tuple(self.seconds),
            **self.found,
        )

    @property
    def name(self) -> str:
        return named(self.technique, self.options.get("precision"), self.options.get("passes"))


def _chosen(name: str, values: Iterable[Any] | None, known: Sequence[Any]) -> list[Any]:
    """Those of the known that are among the values, in their own order; all for None. Raises InputError."""
    if isinstance(values, str):
        values = [values]
    asked = list(known) if values is None else list(values)
    for value in asked:
        if value not in known:
            raise InputError(f"{name}: expected some of {', '.join(known)}; got {value!r}")
    if not asked:
        raise InputError(f"{name}: expected at least one of {', '.join(known)}; got none")
    return [value for value in known if value in asked]


def check_choice(
    techniques: Iterable[str] | None, precisions: Iterable[str] | None
) -> tuple[list[str], list[str] | None]:
    """Those that `compare` takes of each, in the registry's order. Raises InputError where there is no such.

    Of precisions None where none are asked for: each technique's own then, float32 and its paper's.
    """
    comparable = [name for name, made in TECHNIQUES.items() if not made.maps]
    names = _chosen("techniques", techniques, comparable)
    return names, None if precisions is None else _chosen("precisions", precisions, list(PRECISIONS))


def _trials(names: Iterable[str], precisions: Sequence[str] | None, budgets: Sequence[int]) -> list[_Trial]:
    """Techniques x precisions x budgets, each where the technique has that option."""
    trials = []
    for name in names:
        chosen = technique(name)
        has = chosen.options
        own = precisions or list(dict.fromkeys((DEFAULT_PRECISION, chosen.paper_precision)))
        for precision, budget in product(
            own if "precision" in has else [None], [None, *budgets] if "passes" in has else [None]
        ):
            options = {"precision": precision, "passes": budget}
            trials.append(_Trial(name, {key: value for key, value in options.items() if value is not None}))
    return trials


def compare(
    scene: Scene,
    camera: Camera | None = None,
    size: tuple[int, int] = (1024, 1024),
    techniques: Iterable[str] | None = None,
    precisions: Iterable[str] | None = None,
    budgets: Iterable[int] = (),
    frames: int = 5,
    *,
    background: Sequence[float] | str = (1, 1, 1),
    lighting: str = "none",
    opaque: str = "first",
    memory: int | str | None = None,
    device: int | str | None = None,
    lanes: int | None = None,
    pictures: bool = False,
    progress: Progress | None = None,
) -> Comparison:
    """Draws the view by every technique and compares the pictures with the truth, and the times with each other.

    techniques: names in `clpeel.techniques.TECHNIQUES` of those that make this picture, not a map; all by default.
    precisions: of the colour buffers; by default float32 and that of the technique's paper. budgets: numbers of
    `passes` to stop after, of those that have the option, besides not stopping them. frames: how many are timed of each
    row, after one that is not; rows take turns, so that a machine that slows down slows all. pictures: whether rows
    keep `image` and `error`, which `to_html` shows. The others are as of `render`; there is one sample a pixel, and two
    renderers, each of which keeps to `memory`. Raises InputError on any of these that cannot be, and Interrupted, a
    KeyboardInterrupt with the rows that are finished, on Ctrl-C.
    """
    names, chosen_precisions = check_choice(techniques, precisions)
    budgets = sorted({checked_count("budgets", budget, MAX_PASSES) for budget in budgets})
    frames = checked_count("frames", frames, MOST_FRAMES)
    size = checked_size(size)
    over = checked_background(background)
    if over is None:
        raise InputError("background: expected 3 numbers 0..1, as errors are of the picture over it; got None")
    check_picture_fits(size, HOST_BYTES)
    trials = _trials(names, chosen_precisions, budgets)

    # One judges the pictures and gives its memory back before each, so that it tells what each technique takes; with
    # the other, nothing is allocated in a frame that is timed.
    judge, clock = Renderer(scene, device, lanes), Renderer(scene, device, lanes)
    if camera is None:
        camera = Camera.frame(scene, aspect=size[0] / size[1])
    view: dict[str, Any] = {
        "camera": camera,
        "size": size,
        "background": over,
        "lighting": lighting,
        "opaque": opaque,
        "memory": memory,
    }
    report = progress or (lambda done, text: None)
    steps = 1 + len(trials) * (2 + frames)
    done = 0

    def picture(text: str, **options: Any) -> Any:
        within = None if progress is None else lambda part, _: report((done + part) / steps, text)
        judge.gpu.release(*list(judge.gpu.buffers))
        return judge.render(**view, **options, progress=within)

    exact = next(name for name, made in TECHNIQUES.items() if made.exact and LAYERS in made.options)
    result = picture("blending in float64", technique=exact, layers=True)
    truth = true_colors(result.layers)
    comparison = Comparison(
        rows=[],
        truth=truth,
        background=over,
        lighting=lighting,
        opaque=opaque,
        triangles=result.stats["triangles"],
        fragments=int(len(result.layers.depth)),
        layers_max=result.layers.count,
        device=result.stats["device"],
        lanes=result.stats["lanes"],
    )
    notes = [note for note in result.stats["notes"] if note not in scene.notes]
    del result
    done = 1
    right, right_image = shown(truth, over), comparison.truth_image()
    left_out = [name for name, made in TECHNIQUES.items() if made.maps and techniques is None]
    if left_out:
        notes.append(f"left out, as they make maps and not this picture: {', '.join(left_out)}")

    def measure(trial: _Trial, number: int) -> None:
        nonlocal done
        report(done / steps, f"{trial.name}: frame {number} of {frames}")
        drawn = clock.render(**view, technique=trial.technique, keep_color=False, **trial.options)
        if number:
            trial.seconds.append(drawn.stats["seconds"]["total"])
        done += 1

    try:
        for trial in trials:
            try:
                result = picture(f"{trial.name}: its error", technique=trial.technique, **trial.options)
            except InputError as error:
                # A technique may have a limit of its own, which says so.
                if "passes" not in trial.options or not str(error).startswith("passes:"):
                    raise
                notes.append(f"left out: {trial.name}: {error}")
                done += 2 + frames
                continue
            trial.found = judged(result, right, right_image, over, pictures)
            del result
            done += 1
            measure(trial, 0)
            measure(trial, 1)
        for number in range(2, frames + 1):
            for trial in trials:
                if trial.found:
                    measure(trial, number)
        report(1.0, "done")
    except KeyboardInterrupt:
        finished = _with_rows(comparison, trials, [*notes, "interrupted"])
        if not finished.rows:
            raise
        raise Interrupted(finished) from None
    return _with_rows(comparison, trials, notes)


def _with_rows(comparison: Comparison, trials: Iterable[_Trial], notes: Iterable[str]) -> Comparison:
    from dataclasses import replace

    return replace(comparison, rows=[trial.row() for trial in trials if trial.seconds], notes=tuple(notes))


def judged(
    result: Any,
    right: NDArray[np.float64],
    right_image: NDArray[np.uint8],
    background: tuple[float, float, float],
    pictures: bool,
) -> dict[str, Any]:
    """Of a result, the figures of `Row` that one picture tells; right, right_image: the truth as it is shown."""
    stats = result.stats
    error = np.abs(shown(result.color, background) - right)
    error[np.isnan(error)] = 1
    mean_square = float(np.mean(error * error))
    worst = error.max(axis=-1)
    return {
        "passes": int(stats["passes"]),
        "bytes_per_pixel": stats["buffer_bytes_per_pixel"],
        "memory_bytes": int(sum(stats["bytes"].values())),
        "max_error": float(worst.max()),
        "rms_error": math.sqrt(mean_square),
        "psnr": -10 * math.log10(mean_square) if mean_square > 0 else math.inf,
        "share_above_1": float(np.mean(worst > STEP)),
        "share_above_8": float(np.mean(worst > 8 * STEP)),
        "flip": flip_error(right_image, result.image),
        "truncated_pixels": int(stats["truncated_pixels"]),
        "truncation_bound": float(stats["truncation_bound"]),
        "clamped_pixels": int(stats["clamped_pixels"]),
        "image": result.image.copy() if pictures else None,
        "error": worst.astype(np.float32) if pictures else None,
    }
