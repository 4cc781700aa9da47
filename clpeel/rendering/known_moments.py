"""Known moments: how much of each layer `moments` takes to be seen, by matrices and eigenvalues in float64.

It solves what the kernels solve by orthogonal polynomials (techniques/moments-power.h, moments-trigonometric.h): which
masses have the moments, if one of them lies at a given depth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.techniques.moments import BIASES, MIXINGS, MomentsOptions

Floats = NDArray[np.float64]

LEAST_THROUGH = 2.0**-17
"""What an opaque layer is taken to let through (fragments/absorbance.h)."""

WRAPPING = np.pi / 10
"""The part of the circle, in radians, on which no depth lies."""

STEPS_16 = 65535
"""Steps of a number in 16 bits."""


def seen_of(alpha: Floats, place: Floats, options: MomentsOptions) -> tuple[Floats, Floats]:
    """How much of each layer is seen, but for a factor of its pixel, [pixels, layers]; what comes through, [pixels, 1].

    alpha: 0 where there is no layer. place: -1 at the near plane, 1 at the far one. The factor makes the greatest 1.
    """
    absorbance = -np.log(np.maximum(1 - alpha, LEAST_THROUGH))
    total = absorbance.sum(axis=1, keepdims=True)
    points, back = _points(place, options), total[..., None]
    sums = (absorbance[..., None] * points[..., 1:]).sum(axis=1, keepdims=True)
    moments = np.divide(sums, back, out=np.zeros_like(sums), where=back > 0)
    moments = biased(_kept(moments, options), options)
    share = share_before(moments, place, options)
    behind = share - np.where(alpha > 0, share, 1.0).min(axis=1, keepdims=True)
    return np.exp(-total * np.maximum(behind, 0)), np.exp(-total)


def biased(moments: NDArray[Any], options: MomentsOptions) -> NDArray[Any]:
    """Moments [..., count] after they are moved by the bias. Trigonometric ones are complex."""
    bias = BIASES[options.moments, options.moment_precision]
    return moments * (1 - bias.amount) + np.array(bias.moments(moments.shape[-1]))


def share_before(moments: NDArray[Any], place: Floats, options: MomentsOptions) -> Floats:
    """Which share of a pixel's absorbance lies in front of each place. moments: [pixels, 1, count], biased."""
    circle, order = options.moments == "trigonometric", options.numbers // 2
    every = np.concatenate([np.ones_like(moments[..., :1]), moments], axis=-1)
    row, column = np.indices((order + 1, order + 1))
    apart = row - column
    gram = (
        np.where(apart < 0, every[..., np.abs(apart)].conj(), every[..., np.abs(apart)])
        if circle
        else every[..., row + column]
    )
    inverse = np.linalg.inv(gram)

    def powers(point: NDArray[Any]) -> NDArray[Any]:
        return point[..., None] ** np.arange(order + 1)

    def mass(point: NDArray[Any]) -> Floats:
        vector = powers(point)
        return 1 / np.einsum("...i,...ij,...j->...", vector.conj(), inverse, vector).real

    points = _points(place, options)[..., 1]
    polynomial = np.einsum("...i,...ij->...j", powers(points).conj(), inverse)
    last = polynomial[..., -1:]
    companion = np.zeros((*points.shape, order, order), polynomial.dtype)
    companion[..., 1:, :-1] = np.eye(order - 1)
    companion[..., -1] = -polynomial[..., :-1] / np.where(np.abs(last) < 1e-200, 1e-200, last)
    roots = np.linalg.eigvals(companion)
    roots = roots / np.abs(roots) if circle else roots.real
    before = _before(roots, points[..., None]) if circle else (roots < points[..., None]).astype(np.float64)
    masses = np.stack([mass(roots[..., k]) for k in range(order)], axis=-1)
    return np.minimum(options.overestimation * mass(points) + (before * masses).sum(axis=-1), 1.0)


def _points(place: Floats, options: MomentsOptions) -> NDArray[Any]:
    """The numbers whose sums are the moments, 1 among them: powers of places, or of points on a circle."""
    if options.moments != "trigonometric":
        return place[..., None] ** np.arange(options.numbers + 1)
    point: NDArray[Any] = np.exp(1j * (place + 1) * (np.pi - WRAPPING / 2))[..., None]
    return point ** np.arange(options.numbers // 2 + 1)


def _before(roots: NDArray[Any], points: NDArray[Any]) -> Floats:
    """How much of a mass on the circle counts as in front of a point."""
    angle = np.angle(roots) % (2 * np.pi)
    begin = np.cos(WRAPPING) - np.sin(WRAPPING)
    ramp = np.clip((roots.real + roots.imag - begin) / (1 - begin), 0, 1)
    shares: Floats = (angle < np.angle(points) % (2 * np.pi)) + np.where(angle > 2 * np.pi - WRAPPING, ramp, 0.0)
    return shares


def _kept(moments: NDArray[Any], options: MomentsOptions) -> NDArray[Any]:
    """What is stored of moments [..., count]: all, or 16 bits of each number."""
    if options.moment_precision == "single":
        return moments

    def rounded(values: Floats) -> Floats:
        return np.floor(np.clip(values, 0, 1) * STEPS_16 + 0.5) / STEPS_16

    if options.moments == "trigonometric":
        real, imaginary = (2 * rounded(0.5 * part + 0.5) - 1 for part in (moments.real, moments.imag))
        return real + 1j * imaginary
    mixing, kept = MIXINGS[options.moments], np.empty_like(moments)
    for first, matrix in enumerate((np.array(mixing.odd), np.array(mixing.even))):
        offsets = np.array(mixing.offsets[first::2])
        stored = rounded(moments[..., first::2] @ matrix.T + offsets)
        kept[..., first::2] = (stored - offsets) @ np.linalg.inv(matrix).T
    return kept
