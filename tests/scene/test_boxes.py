"""The boxes: how many, where, and which are transparent."""

from __future__ import annotations

import numpy as np
import pytest

from clpeel.errors import InputError
from clpeel.scene.boxes import boxes_scene


@pytest.mark.parametrize("every", [1, 2, 3, 7, 1000])
def test_each_so_many_th_box_is_transparent(every: int) -> None:
    scene = boxes_scene(every)
    assert scene.face_colors is not None and scene.faces.shape == (12_000, 3)
    alpha = scene.face_colors[:, 3].reshape(1000, 12)
    assert (alpha == alpha[:, :1]).all()
    assert np.flatnonzero(alpha[:, 0] < 255).tolist() == list(range(every - 1, 1000, every))


def test_boxes_are_closed_apart_and_within_the_cube() -> None:
    scene = boxes_scene()
    corners = scene.vertices[scene.faces]
    volume = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).reshape(1000, 12).sum(1) / 6
    assert volume == pytest.approx(np.full(1000, 0.12**3))
    boxes = scene.vertices.reshape(1000, 8, 3)
    assert np.abs(boxes).max() == pytest.approx(0.9 + 0.06)
    sides = boxes.max(axis=1) - boxes.min(axis=1)
    assert sides == pytest.approx(np.full((1000, 3), 0.12))


@pytest.mark.parametrize("wrong", [0, -1, 1001, 1.5, "two"])
def test_a_wrong_number_is_refused(wrong: object) -> None:
    with pytest.raises(InputError, match=r"transparent_every: expected 1\.\.1000"):
        boxes_scene(wrong)  # type: ignore[arg-type]
