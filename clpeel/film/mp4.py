"""MP4: a film as H.264, which every player and every browser plays.

Colours are BT.709 in the narrow range, and the file says so. Without that, players guess BT.601 for small pictures,
and greens and reds are wrong. Of 2 x 2 pixels, one colour but each brightness is kept (4:2:0), as many players take
nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from clpeel.errors import InputError
from clpeel.files import told

if TYPE_CHECKING:
    from PIL import Image

BT709 = 1
"""The number of BT.709 in H.264: of its primaries, its transfer, and its matrix."""

NARROW = 1
"""The number of the narrow range in FFmpeg: 16..235."""


def check_encoder() -> None:
    """Raise InputError if this build of av cannot write H.264."""
    import av

    try:
        av.codec.Codec("libx264", "w")
    except ValueError:
        raise InputError(
            "path: expected a package av with libx264 for MP4, got one without; .webp needs none"
        ) from None


def encode(
    path: str,
    frame: Callable[[int], Image.Image],
    count: int,
    fps: float,
    quality: int,
    report: Callable[[int], None],
) -> None:
    """Write a film as an MP4, whose index comes first, so that it plays while it is still loaded.

    path: of the file, which is read again for that. frame: returns frame k, RGB, with even sides. quality: 0..100.
    report: called with the number of each frame that is done. Raises InputError if the file cannot be written.
    """
    import av

    # Errors of av about files are OSErrors, too.
    with told(path), av.open(path, "w", format="mp4", options={"movflags": "faststart"}) as container:
        width, height = frame(0).size
        stream = container.add_stream("libx264", rate=Fraction(fps).limit_denominator(1001))
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        stream.options = {"crf": str(crf_of(quality)), "preset": "medium"}
        context = stream.codec_context
        context.color_primaries = context.color_trc = context.colorspace = BT709
        context.color_range = NARROW
        for k in range(count):
            shown = av.VideoFrame.from_ndarray(np.asarray(frame(k).convert("RGB")), format="rgb24")
            shown = shown.reformat(
                format="yuv420p",
                dst_colorspace=av.video.reformatter.Colorspace.ITU709,
                dst_color_range=av.video.reformatter.ColorRange.MPEG,
                interpolation=av.video.reformatter.Interpolation.AREA,
            )
            shown.pts = k
            container.mux(stream.encode(shown))
            report(k)
        container.mux(stream.encode())


def crf_of(quality: int) -> int:
    """Return x264's constant rate factor for a quality 0..100: 18 for 90, at which losses are hard to see."""
    return min(13 + (100 - quality + 1) // 2, 51)
