"""Twins of blending, in NumPy: a buffer of each precision, and what each technique makes of a picture's layers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.pictures.layers import Layers

Floats = NDArray[np.float32]
F = np.float32
Layer = tuple[NDArray[np.int64], Floats, Floats]  # pixels, their straight colours and alphas

FRONT_TO_BACK = ("sort", "depth-peeling", "multi-layer-peeling")

TWINNED = (*FRONT_TO_BACK, "dual-depth-peeling", "glowscript", "weighted-average", "weighted-sum")
"""The techniques that have a twin here. All others that blend have twins and extremes in tests of their own."""


def to_half(values: Floats) -> Floats:
    return values.astype(np.float16).astype(F)


def to_step(values: Floats) -> Floats:
    return np.floor(np.minimum(values + F(0.5), F(255)))


KEPT = {"float32": lambda values: values, "half": to_half, "unorm8": to_step}
"""What a buffer keeps of numbers, of which FULL stands for 1."""

FULL = {"float32": F(1), "half": F(1), "unorm8": F(255)}


class Buffer:
    """Red, green, blue and alpha of so many pixels, as they are kept."""

    def __init__(self, precision: str, pixels: int, alpha: float) -> None:
        self.kept, self.full = KEPT[precision], FULL[precision]
        self.color, self.alpha = np.zeros((pixels, 3), F), np.full((pixels, 1), F(alpha) * self.full)

    def store(self, at: Any, color: Floats, alpha: Floats) -> None:
        self.color[at], self.alpha[at] = self.kept(color), self.kept(alpha)

    def under(self, at: Any, rgb: Floats, a: Floats) -> None:
        """C + T (a c), T (1 - a)."""
        self.store(at, self.color[at] + self.alpha[at] * (a * rgb), self.alpha[at] * (F(1) - a))

    def over(self, at: Any, rgb: Floats, a: Floats) -> None:
        """a c + (1 - a) C, (1 - a) T."""
        through = F(1) - a
        self.store(at, a * rgb * self.full + through * self.color[at], through * self.alpha[at])

    def add(self, at: Any, rgb: Floats, a: Floats) -> None:
        """C + a c, A + a."""
        self.store(at, self.color[at] + a * rgb * self.full, self.alpha[at] + a * self.full)

    def numbers(self) -> tuple[Floats, Floats]:
        """Of 1."""
        return self.color / self.full, self.alpha / self.full


class Stacks:
    """A picture's layers, pixel by pixel front to back: the transparent ones, and what is opaque behind them."""

    def __init__(self, layers: Layers, precision: str) -> None:
        self.precision, self.layers = precision, layers
        self.start, self.count = layers.start[:-1], np.diff(layers.start)
        self.pixels = len(self.count)
        closed = np.flatnonzero(self.count)
        closed = closed[layers.color[layers.start[closed + 1] - 1, 3] == 1]
        self.behind = Buffer(precision, self.pixels, 0), np.ones((self.pixels, 1), F)
        last = layers.color[layers.start[closed + 1] - 1]
        self.behind[0].store(closed, last[:, :3] * FULL[precision], last[:, 3:])
        self.behind[1][closed] = 0
        self.count[closed] -= 1

    def buffer(self, alpha: float) -> Buffer:
        return Buffer(self.precision, self.pixels, alpha)

    def at(self, places: NDArray[np.int64], pixels: NDArray[np.int64]) -> Layer:
        color = self.layers.color[places]
        return pixels, color[:, :3], color[:, 3:]

    def front_to_back(self, count: NDArray[np.int64]) -> Iterator[Layer]:
        """The first count[p] layers of each pixel."""
        for k in range(int(count.max(initial=0))):
            pixels = np.flatnonzero(count > k)
            yield self.at(self.start[pixels] + k, pixels)

    def back_to_front(self, count: NDArray[np.int64]) -> Iterator[Layer]:
        """The last count[p] of each."""
        for k in range(int(count.max(initial=0))):
            pixels = np.flatnonzero(count > k)
            yield self.at(self.start[pixels] + self.count[pixels] - 1 - k, pixels)

    def as_submitted(self) -> Iterator[Layer]:
        """All, in the order of the faces."""
        for places, pixels in self.submitted():
            yield self.at(places, pixels)

    def submitted(self) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
        """Their places among the layers, and their pixels. A place is the greater the farther a layer is."""
        pixel = np.repeat(np.arange(self.pixels), np.diff(self.layers.start))
        order = np.lexsort((self.layers.triangle, pixel))
        opaque = self.layers.color[order, 3] == 1  # not of these: its place is left to no other
        rank = np.arange(len(order)) - np.maximum.accumulate(
            np.where(np.diff(pixel, prepend=-1), np.arange(len(pixel)), 0)
        )
        for k in range(int(rank.max(initial=-1)) + 1):
            chosen = (rank == k) & ~opaque
            yield order[chosen], pixel[chosen]

    def shown(self, color: Any, through: Any) -> Any:
        """Premultiplied colour and transmittance over what is opaque, as Result.color has it."""
        behind = self.behind[0].numbers()[0]
        picture = np.concatenate([color + through * behind, 1 - through * self.behind[1]], axis=1)
        return picture.reshape(self.layers.size[1], self.layers.size[0], 4)


def blended(technique: str, stacks: Stacks) -> Any:
    """What the technique makes of the layers: float32, operation by operation; of weighted averages float64."""
    count = stacks.count
    if technique in FRONT_TO_BACK:
        buffer = stacks.buffer(1)
        for layer in stacks.front_to_back(count):
            buffer.under(*layer)
        return stacks.shown(*buffer.numbers())
    if technique == "dual-depth-peeling":
        front, back = stacks.buffer(1), stacks.buffer(1)
        for layer in stacks.front_to_back((count + 1) // 2):
            front.under(*layer)
        for layer in stacks.back_to_front(count // 2):
            back.over(*layer)
        (color, through), (color_behind, through_behind) = front.numbers(), back.numbers()
        return stacks.shown(color + through * color_behind, through * through_behind)
    if technique == "glowscript":  # peels are stored as they are, and merged with the picture behind them
        color, through = stacks.behind[0].numbers()[0], stacks.behind[1].copy()
        for pixels, rgb, a in reversed(list(stacks.front_to_back(np.minimum(count, 4)))):
            peel = stacks.buffer(0)
            peel.store(pixels, rgb * peel.full, a * peel.full)
            kept, alpha = (numbers[pixels] for numbers in peel.numbers())
            color[pixels] = alpha * kept + (F(1) - alpha) * color[pixels]
            through[pixels] = (F(1) - alpha) * through[pixels]
        return np.concatenate([color, F(1) - through], axis=1).reshape(*stacks.layers.size[::-1], 4)
    if technique == "multi-layer-alpha-blending":
        return stacks.shown(*kept_apart(stacks, 4))
    sums = stacks.buffer(0)
    for layer in stacks.as_submitted():
        sums.add(*layer)
    color, total = sums.numbers()
    if technique == "weighted-sum":
        return stacks.shown(color, F(1) - total)
    most = {"float32": 2**24, "half": 2048, "unorm8": 255}[stacks.precision]
    color, total, n = color.astype(float), total.astype(float), np.minimum(count, most)[:, None]
    coverage = np.zeros_like(total)
    some = total[:, 0] > 0
    alpha = np.minimum(total[some] / n[some], 1 - 2.0**-53)  # the greatest float64 below 1
    coverage[some] = -np.expm1(n[some] * np.log1p(-alpha))
    return stacks.shown(color / np.where(total > 0, total, 1) * coverage, 1 - coverage)


def kept_apart(stacks: Stacks, slots: int) -> tuple[Floats, Floats]:
    """What multi-layer-alpha-blending makes of the layers: premultiplied colour and transmittance."""
    kept, full = KEPT[stacks.precision], FULL[stacks.precision]
    place = np.full((stacks.pixels, slots), np.iinfo(np.int64).max)
    color, through = np.zeros((stacks.pixels, slots, 3), F), np.full((stacks.pixels, slots, 1), full)
    for places, pixels in stacks.submitted():
        _, rgb, a = stacks.at(places, pixels)
        at = np.append(place[pixels], places[:, None], axis=1)
        c = np.append(color[pixels], kept(a * rgb * full)[:, None], axis=1)
        t = np.append(through[pixels], kept((F(1) - a) * full)[:, None], axis=1)
        order = np.argsort(at, axis=1, kind="stable")
        at, c, t = (
            np.take_along_axis(each, order.reshape(*order.shape, *[1] * (each.ndim - 2)), 1) for each in (at, c, t)
        )
        c[:, -2], t[:, -2] = kept(c[:, -2] + t[:, -2] / full * c[:, -1]), kept(t[:, -2] / full * t[:, -1])
        place[pixels], color[pixels], through[pixels] = at[:, :-1], c[:, :-1], t[:, :-1]
    front, left = np.zeros((stacks.pixels, 3), F), np.ones((stacks.pixels, 1), F)
    for slot in range(slots):
        front, left = front + left * (color[:, slot] / full), left * (through[:, slot] / full)
    return front, left
