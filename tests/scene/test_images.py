"""Images of textures: decoded late, once and only when asked for; else as any image is."""

from __future__ import annotations

import copy
import pickle
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError, replace
from functools import partial
from threading import Barrier
from typing import Any

import numpy as np
import pytest

from clpeel.errors import InputError
from clpeel.scene.images import LateImage
from clpeel.scene.textures import Texture

IMAGE = np.array([[[1, 2, 3, 4], [5, 6, 7, 8]]], np.uint8)


def never() -> Any:
    """An image that nobody may decode."""
    raise AssertionError("decoded")


def stored(data: bytes) -> Any:
    """An image of one row of bytes."""
    return np.frombuffer(data, np.uint8).reshape(1, -1, 4)


def counting(calls: list[None]) -> Callable[[], Any]:
    """Decodes IMAGE, which takes a while, and keeps account of it."""

    def decode() -> Any:
        calls.append(None)
        time.sleep(0.01)
        return IMAGE

    return decode


def test_a_late_image_is_decoded_when_it_is_first_asked_for() -> None:
    calls: list[None] = []
    texture = Texture(LateImage(counting(calls)), ("clamp", "mirror"), "nearest", "linear")
    assert not calls and (texture.wrap, texture.magnify, texture.mipmapped) == (("clamp", "mirror"), "nearest", False)
    assert texture.image is IMAGE and texture.size == (2, 1) and texture.image is IMAGE
    assert len(calls) == 1


def test_textures_share_a_late_image() -> None:
    calls: list[None] = []
    late = LateImage(counting(calls))
    assert Texture(late).image is Texture(late, magnify="nearest").image
    assert len(calls) == 1


def test_many_threads_decode_it_once() -> None:
    calls: list[None] = []
    start = Barrier(8)
    late = LateImage(counting(calls))

    def ask(_: int) -> Any:
        start.wait()
        return Texture(late).image

    with ThreadPoolExecutor(8) as pool:
        assert all(image is IMAGE for image in pool.map(ask, range(8)))
    assert len(calls) == 1


@pytest.mark.parametrize("remade", [copy.copy, copy.deepcopy, lambda texture: pickle.loads(pickle.dumps(texture))])
@pytest.mark.parametrize("asked", [True, False])
def test_copies_and_pickles(remade: Callable[[Texture], Texture], asked: bool) -> None:
    late = Texture(LateImage(partial(stored, IMAGE.tobytes())), magnify="nearest")
    if asked:
        assert late.image.shape == (1, 2, 4)
    for texture in (late, Texture(IMAGE, magnify="nearest")):
        again = remade(texture)
        np.testing.assert_array_equal(again.image, IMAGE)
        assert again.magnify == "nearest" and again is not texture


def test_a_texture_is_a_frozen_dataclass_as_before() -> None:
    texture = Texture(IMAGE)
    with pytest.raises(FrozenInstanceError):
        texture.image = IMAGE  # type: ignore[misc,assignment]
    with pytest.raises(TypeError, match="image"):
        Texture()
    assert replace(texture, magnify="nearest").image is IMAGE
    assert replace(Texture(LateImage(counting([]))), magnify="nearest").image is IMAGE
    shown = "wrap=('repeat', 'repeat'), magnify='linear', minify='linear-mipmap-linear')"
    assert repr(texture) == f"Texture(image={IMAGE!r}, {shown}"
    assert len({texture, Texture(IMAGE)}) == 2


def test_nothing_but_the_image_decodes_it() -> None:
    texture = Texture(LateImage(never))
    assert repr(texture).startswith("Texture(image=<") and texture == texture and len({texture, texture}) == 1
    pickle.dumps(texture)
    copy.copy(texture)


def test_words_are_checked_at_once_and_a_late_image_when_it_is_decoded() -> None:
    with pytest.raises(InputError, match="magnify"):
        Texture(LateImage(never), magnify="best")  # type: ignore[arg-type]
    texture = Texture(LateImage(lambda: IMAGE[..., :3]))
    for _ in range(2):
        with pytest.raises(InputError, match=r"^image: expected \[height, width, 4\], got \[1, 2, 3\] uint8"):
            texture.image  # noqa: B018
    with pytest.raises(InputError, match=r"^image: expected \[height, width, 4\]"):
        Texture(IMAGE[..., :3])
