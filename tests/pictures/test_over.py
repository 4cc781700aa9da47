"""A picture over another: against what the layers are as numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from clpeel.pictures.over import put_over


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@given(seed=st.integers(0, 10_000))
def test_it_is_over_with_straight_alpha(kind: Any, seed: int) -> None:
    rng = np.random.default_rng(seed)
    most = np.iinfo(kind).max
    image = rng.integers(0, most, (9, 11, 4), kind, endpoint=True)
    image[rng.random((9, 11)) < 0.3, 3] = rng.choice([0, most])
    straight = rng.random((4, 5, 4))
    straight[rng.random((4, 5)) < 0.4, 3] = rng.choice([0, 1])
    color = np.concatenate([straight[..., :3] * straight[..., 3:], straight[..., 3:]], axis=-1).astype(np.float32)
    found = image.copy()
    put_over(found, color, 3, 2)
    for y, x in np.ndindex(9, 11):
        if not (2 <= y < 6 and 3 <= x < 8) or color[y - 2, x - 3, 3] == 0:
            assert (found[y, x] == image[y, x]).all()
            continue
        a, b = straight[y - 2, x - 3, 3], image[y, x, 3] / most
        alpha = a + b - a * b
        light = a * straight[y - 2, x - 3, :3] + (1 - a) * b * image[y, x, :3] / most
        wanted = most * np.append(light / alpha, alpha)
        assert np.abs(found[y, x] - wanted).max() <= 0.5 + 2e-5 * most


def test_what_is_opaque_stays_opaque() -> None:
    image = np.full((2, 2, 4), 255, np.uint8)
    put_over(image, np.full((2, 2, 4), 0.3, np.float32), 0, 0)
    assert (image[..., 3] == 255).all()
