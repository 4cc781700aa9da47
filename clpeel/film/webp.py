"""WebP: a film with all its colours and its alpha, which browsers play."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PIL import Image


def encode(
    frame: Callable[[int], Image.Image],
    count: int,
    milliseconds: Sequence[int],
    quality: int,
    lossless: bool,
    report: Callable[[int], None],
) -> bytes:
    """Return a film as the bytes of a WebP that plays again and again.

    frame: returns frame k, RGB or RGBA. milliseconds: of each frame. quality: 0..100. lossless: whether each frame
    keeps its bits; straight colours under an alpha of 0 too. report: called with the number of each frame that is done.
    """

    def frames() -> Iterator[Image.Image]:
        for k in range(count):
            yield frame(k)
            report(k)

    each = frames()
    first, data = next(each), io.BytesIO()
    # With `exact`, colours under an alpha of 0 stay. With `kmax` 1, each lossy frame stands for itself. Otherwise
    # specks of earlier frames stay beside the model, and files of turning things are no smaller.
    lossy = {"quality": quality, "kmin": 0, "kmax": 1}
    how = {"lossless": True, "exact": True, "quality": 60} if lossless else lossy
    first.save(
        data,
        "WEBP",
        save_all=True,
        append_images=chain(each),
        duration=list(milliseconds) if count > 1 else milliseconds[0],
        loop=0,
        method=4,
        **how,
    )
    return data.getvalue()
