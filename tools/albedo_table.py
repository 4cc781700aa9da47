"""Computes the table of clpeel/stages/albedo.py: how much of even light one reflection of GGX returns.

Run: python tools/albedo_table.py. It prints the two blocks of that file.
"""

from __future__ import annotations

import numpy as np

from clpeel.device.layout import ALBEDO_SIDE

_STEPS = 1000


def albedo(facing: float, roughness: float, steps: int = _STEPS) -> tuple[float, float]:
    """Return what is returned of light that f0 is multiplied with, and of all light if f0 is 1.

    The integrals over all directions of light are means over half vectors that are distributed as GGX's D n.h
    (Karis 2013): with weights G v.h / (n.h n.v), times 1 - (1 - v.h)^5 for the first. steps: half vectors along each of
    two axes. The weight grows without bound where n.h vanishes, so steps are the finer the closer they are to that.
    """
    alpha2 = roughness**4
    root = (np.arange(steps) + 0.5) / steps
    share, turn = 1 - root**2, root * np.pi
    cosine = np.sqrt((1 - share) / (1 + (alpha2 - 1) * share))[:, None]
    sine = np.sqrt(np.maximum(1 - cosine**2, 0.0))
    towards = np.sqrt(1 - facing**2) * sine * np.cos(turn) + facing * cosine  # v.h
    light = 2 * towards * cosine - facing  # n.l
    there = (light > 0) & (towards > 0)
    light = np.where(there, light, 1.0)
    shadow = light * np.sqrt(facing**2 * (1 - alpha2) + alpha2) + facing * np.sqrt(light**2 * (1 - alpha2) + alpha2)
    weight = np.where(there, 2 * light * towards / (cosine * shadow), 0.0) * 2 * root[:, None]
    edge = (1 - np.clip(towards, 0, 1)) ** 5
    return float(((1 - edge) * weight).mean()), float(weight.mean())


def table() -> np.ndarray:
    """Return the numbers of the file, uint16 [2, ALBEDO_SIDE, ALBEDO_SIDE]: by roughness, then by the root of n.v."""
    steps = np.arange(ALBEDO_SIDE) / (ALBEDO_SIDE - 1)
    values = [[albedo(max(root**2, 1e-4), max(roughness, 0.01)) for root in steps] for roughness in steps]
    return np.rint(np.minimum(np.array(values), 1.0) * 65535).astype(np.uint16).transpose(2, 0, 1)


if __name__ == "__main__":
    for name, block in zip(("_ANY", "_ALL"), table(), strict=True):
        print(f'{name} = """')
        for row in block:
            print("".join(f"{value:04x}" for value in row))
        print('"""')
