"""Comparing: draws one view with every technique, times each, and compares each picture with a float64 one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.checks import Background, GivenBackground, whole_number
from clpeel.device.layout import PointType
from clpeel.errors import InputError
from clpeel.pictures.layers import Layers
from clpeel.pictures.png import STEP
from clpeel.rendering.options import Lighting, Opaque, PictureOptions, Size
from clpeel.rendering.renderer import Renderer
from clpeel.rendering.request import Progress, check_picture_fits
from clpeel.rendering.result import Result
from clpeel.scene.camera import Camera, GivenCamera, checked_camera
from clpeel.scene.scene import Scene
from clpeel.study.comparison import Comparison, Interrupted, Row, named, shown
from clpeel.techniques import TECHNIQUES, AnyTechnique
from clpeel.techniques.peeling import MAX_PASSES
from clpeel.techniques.precision import DEFAULT_PRECISION, PRECISIONS, Blending

MOST_FRAMES = 10_000
LEFT_OUT = "left out, as they make maps and not this picture: " + ", ".join(
    made.name for made in TECHNIQUES.values() if made.maps
)
HOST_BYTES = 8 * 4 * 3
"""Host memory of a pixel, in bytes, approximately: the truth and the arrays it is computed from, all float64."""


def compare(
    scene: Scene,
    camera: GivenCamera | None = None,
    size: Size = (1024, 1024),
    techniques: Iterable[str] | None = None,
    precisions: Iterable[str] | None = None,
    budgets: Iterable[int] = (),
    frames: int = 5,
    *,
    background: GivenBackground = (1, 1, 1),
    lighting: Lighting = "none",
    opaque: Opaque = "first",
    memory: int | str | None = None,
    device: int | str | None = None,
    lanes: int | None = None,
    line_width: float | str = PictureOptions.line_width,
    point_size: float | str = PictureOptions.point_size,
    point_type: PointType = PictureOptions.point_type,
    pictures: bool = False,
    progress: Progress | None = None,
) -> Comparison:
    """Draw the view with every technique, and compare the pictures with the truth and the times with each other.

    Techniques are drawn with the defaults of their options, and with those that they are known for besides
    (`Technique.compared`).
    techniques: names in `clpeel.techniques.TECHNIQUES`; by default all that make this picture and not a map.
    precisions: names of the precisions of the colour buffers; by default float32 and the one of the technique's paper.
    budgets: numbers of `passes` to stop after. For techniques with that option, each budget adds a row to the one
    without a limit.
    frames: how many frames of each row are timed, after a first one that is not. The rows take turns, so that a machine
    that slows down slows all rows alike.
    pictures: whether rows keep `image` and `error`, which `to_html` needs.
    All other parameters are those of `render`. There is one sample per pixel. There are two renderers, and each of them
    keeps to `memory`.

    Raises InputError if any of these is invalid. Raises Interrupted, a KeyboardInterrupt with the finished rows, on
    Ctrl-C.
    """
    picture = PictureOptions(
        size=size,
        background=background,
        lighting=lighting,
        opaque=opaque,
        memory=memory,
        line_width=line_width,
        point_size=point_size,
        point_type=point_type,
    )
    if picture.over is None:
        raise InputError("background: expected 3 numbers 0..1, as errors are of the picture over it; got None")
    frames = whole_number("frames", frames, MOST_FRAMES)
    trials, notes = chosen_trials(techniques, precisions, budgets)
    check_picture_fits(picture.size, HOST_BYTES)
    camera = checked_camera(scene, camera, picture.size[0] / picture.size[1])
    bench = _Bench(scene, camera, picture, device, lanes, progress, 1 + len(trials) * (2 + frames))
    comparison, own_notes = bench.truth()
    notes = [*own_notes, *notes]
    if techniques is None:
        notes.append(LEFT_OUT)
    try:
        bench.measure(trials, comparison, frames, pictures)
    except KeyboardInterrupt:
        finished = _with_rows(comparison, trials, [*notes, "interrupted"])
        if not finished.rows:
            raise
        raise Interrupted(finished) from None
    return _with_rows(comparison, trials, notes)


# --- what is compared -------------------------------------------------------------------------------------------------


@dataclass
class Trial:
    """An unfinished row.

    found: what its picture showed, once it is drawn. seconds: the times of its frames.
    """

    technique: AnyTechnique
    options: dict[str, Any]
    found: dict[str, Any] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)

    def row(self) -> Row:
        """Return the row with what has been measured so far."""
        return Row(
            technique=self.technique.name,
            precision=self.options.get("precision"),
            budget=self.options.get("passes"),
            exact=self.technique.exact,
            seconds=tuple(self.seconds),
            options=self.own,
            **self.found,
        )

    @property
    def own(self) -> dict[str, Any]:
        """The options besides the precision and the budget."""
        return {name: value for name, value in self.options.items() if name not in ("precision", "passes")}

    @property
    def name(self) -> str:
        """The same name as the row's."""
        return named(self.technique.name, self.options.get("precision"), self.options.get("passes"), self.own)


def chosen_names(name: str, values: Iterable[str] | None, known: Sequence[str]) -> list[str]:
    """Return the known names that are among the values, in their known order. None means all. Raises InputError."""
    if isinstance(values, str):
        values = [values]
    asked = list(known) if values is None else list(values)
    for value in asked:
        if value not in known:
            raise InputError(f"{name}: expected some of {', '.join(known)}; got {value!r}")
    if not asked:
        raise InputError(f"{name}: expected at least one of {', '.join(known)}; got none")
    return [value for value in known if value in asked]


def chosen_trials(
    techniques: Iterable[str] | None, precisions: Iterable[str] | None, budgets: Iterable[int]
) -> tuple[list[Trial], list[str]]:
    """Return the trials of what `compare` is asked for, and notes (trials_of). Raises InputError if it cannot be."""
    names, chosen_precisions = check_choice(techniques, precisions)
    return trials_of(names, chosen_precisions, sorted({whole_number("budgets", n, MAX_PASSES) for n in budgets}))


def check_choice(
    techniques: Iterable[str] | None, precisions: Iterable[str] | None
) -> tuple[list[str], list[str] | None]:
    """Return the techniques and the precisions that `compare` will use, each in its registered order.

    The precisions are None if none are asked for: then each technique uses its own, float32 and that of its paper.
    Raises InputError if a name is not known, or if a list is empty.
    """
    comparable = [made.name for made in TECHNIQUES.values() if not made.maps]
    names = chosen_names("techniques", techniques, comparable)
    return names, None if precisions is None else chosen_names("precisions", precisions, list(PRECISIONS))


def trials_of(
    names: Iterable[str], precisions: Sequence[str] | None, budgets: Sequence[int]
) -> tuple[list[Trial], list[str]]:
    """Return the trials: techniques x their compared options x precisions x budgets. Also return notes.

    A technique has the precisions and budgets if it has that option. Where the compared options name one themselves,
    that one holds. A note says why a technique refuses a budget or a precision.
    """
    trials: list[Trial] = []
    notes = []
    for technique in map(TECHNIQUES.__getitem__, names):
        own: Sequence[str | None] = [None]
        if issubclass(technique.options, Blending):
            own = precisions or list(dict.fromkeys((DEFAULT_PRECISION, technique.paper_precision)))
        peels = "passes" in technique.option_names
        for options, precision, budget in product(compared(technique), own, [None, *budgets] if peels else [None]):
            asked = {"precision": precision, "passes": budget}
            trial = Trial(technique, {name: value for name, value in asked.items() if value is not None} | options)
            refusal = refused(trial)
            if refusal is not None:
                notes.append(f"left out: {trial.name}: {refusal}")
            elif all((trial.technique, trial.options) != (other.technique, other.options) for other in trials):
                trials.append(trial)
    return trials, notes


def compared(technique: AnyTechnique) -> list[dict[str, object]]:
    """Return the options with which a technique is compared: the defaults, and those that it says itself."""
    return [{}, *(dict(options.given()) for options in technique.compared())]


def refused(trial: Trial) -> InputError | None:
    """Return why a technique cannot be drawn with these options, or None if it can. It may have limits of its own."""
    try:
        trial.technique.options(**trial.options)
    except InputError as error:
        return error
    return None


def _with_rows(comparison: Comparison, trials: Iterable[Trial], notes: Iterable[str]) -> Comparison:
    return replace(comparison, rows=[trial.row() for trial in trials if trial.seconds], notes=tuple(notes))


# --- how it is measured -----------------------------------------------------------------------------------------------


class _Bench:
    """Two renderers of the view.

    `judge` gives its memory back before each picture, so that it shows how much memory each technique takes. `clock`
    keeps its memory, so that nothing is allocated in a timed frame.
    """

    def __init__(
        self,
        scene: Scene,
        camera: Camera,
        picture: PictureOptions,
        device: int | str | None,
        lanes: int | None,
        progress: Progress | None,
        steps: int,
    ) -> None:
        self.picture = picture
        self.judge, self.clock = Renderer(scene, device, lanes), Renderer(scene, device, lanes)
        self.progress, self.steps, self.done = progress, steps, 0
        self.view: dict[str, Any] = {
            "camera": camera,
            "size": picture.size,
            "background": picture.over,
            "lighting": picture.lighting,
            "samples": 1,
            "opaque": picture.opaque,
            "memory": picture.memory,
            "line_width": picture.line_width,
            "point_size": picture.point_size,
            "point_type": picture.point_type,
        }

    def _report(self, text: str, part: float = 0.0) -> None:
        if self.progress is not None:
            self.progress((self.done + part) / self.steps, text)

    def _judged(self, text: str, technique: AnyTechnique, **options: Any) -> Result:
        """Draw a picture with the renderer that keeps no memory."""
        within = None if self.progress is None else lambda part, _: self._report(text, part)
        self.judge.gpu.release(*list(self.judge.gpu.buffers))
        result = self.judge.render(**self.view, technique=technique.name, progress=within, **options)
        self.done += 1
        return result

    def truth(self) -> tuple[Comparison, list[str]]:
        """Return the comparison without rows, and the notes of its picture."""
        exact = next(made for made in TECHNIQUES.values() if made.exact and made.sorts)
        result = self._judged("blending in float64", exact, layers=True)
        assert self.picture.over is not None
        comparison = Comparison(
            rows=[],
            truth=true_colors(result.layers),
            background=self.picture.over,
            lighting=self.picture.lighting or "none",
            opaque=self.picture.opaque,
            triangles=result.stats.triangles,
            fragments=int(len(result.layers.depth)),
            layers_max=result.layers.count,
            device=result.stats.device,
            lanes=result.stats.lanes,
        )
        scene = self.judge.scene
        return comparison, [note for note in result.stats.notes if note not in scene.notes]

    def measure(self, trials: Sequence[Trial], comparison: Comparison, frames: int, pictures: bool) -> None:
        """Measure the error of each trial's picture, and time its frames.

        After the first frame, the trials take turns.
        """
        right, right_image = shown(comparison.truth, comparison.background), comparison.truth_image()
        for trial in trials:
            result = self._judged(f"{trial.name}: its error", trial.technique, **trial.options)
            trial.found = judged(result, right, right_image, comparison.background, pictures)
            trial.found["opacity_bias"] = opacity_bias(result.color, comparison.truth)
            del result
            self._time(trial, 0, frames)
            self._time(trial, 1, frames)
        for number in range(2, frames + 1):
            for trial in trials:
                self._time(trial, number, frames)
        self.done = self.steps
        self._report("done")

    def _time(self, trial: Trial, number: int, frames: int) -> None:
        """Draw one frame. Frame number 0 is not timed."""
        self._report(f"{trial.name}: frame {number} of {frames}")
        drawn = self.clock.render(**self.view, technique=trial.technique.name, keep_color=False, **trial.options)
        if number:
            trial.seconds.append(drawn.stats.seconds["total"])
        self.done += 1


def true_colors(layers: Layers) -> NDArray[np.float64]:
    """Blend the layers back to front in float64. Returns float64 [height, width, 4], premultiplied."""
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


def opacity_bias(color: NDArray[np.float32], truth: NDArray[np.float64]) -> float:
    """Return how much too opaque the pixels are, on average: the mean of alpha, clamped to 0..1, less the truth's.

    NaN counts as 1.
    """
    alpha = np.clip(np.nan_to_num(color[..., 3].astype(np.float64), nan=1.0), 0, 1)
    return float(np.mean(alpha - truth[..., 3]))


def flip_error(truth: NDArray[np.uint8], image: NDArray[np.uint8]) -> float | None:
    """Return the mean FLIP error between two sRGB pictures [height, width, 4]. None without flip-evaluator."""
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


def judged(
    result: Result,
    right: NDArray[np.float64],
    right_image: NDArray[np.uint8],
    background: Background,
    pictures: bool,
) -> dict[str, Any]:
    """Return the figures of `Row` that one picture shows. right, right_image: the truth as it is displayed."""
    stats = result.stats
    error = np.abs(shown(result.color, background) - right)
    error[np.isnan(error)] = 1
    mean_square = float(np.mean(error * error))
    worst = error.max(axis=-1)
    return {
        "passes": stats.passes,
        "bytes_per_pixel": stats.buffer_bytes_per_pixel,
        "memory_bytes": int(sum(stats.bytes.values())),
        "max_error": float(worst.max()),
        "rms_error": math.sqrt(mean_square),
        "psnr": -10 * math.log10(mean_square) if mean_square > 0 else math.inf,
        "share_above_1": float(np.mean(worst > STEP)),
        "share_above_8": float(np.mean(worst > 8 * STEP)),
        "flip": flip_error(right_image, result.image),
        "truncated_pixels": stats.truncated_pixels,
        "truncation_bound": stats.truncation_bound,
        "clamped_pixels": stats.clamped_pixels,
        "image": result.image.copy() if pictures else None,
        "error": worst.astype(np.float32) if pictures else None,
    }
