"""Maps: for techniques that measure something in every pixel, and show it in colours with a scale bar."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from clpeel.options import Options, option

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from clpeel.checks import Background
    from clpeel.stages.composite import Picture

STRIP_PIXELS = 1 << 20
"""How many pixels are coloured at once. This bounds the memory that colouring takes besides the picture."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MapOptions(Options):
    """The options of all techniques whose picture is a map in colours."""

    scale_bar: bool = option(True, help="show a scale bar in the picture of a map")


def paint(
    picture: Picture,
    background: Background | None,
    shown: NDArray[np.floating],
    covered: NDArray[np.float32],
    unpaired: NDArray[np.float32] | None = None,
) -> tuple[NDArray[np.uint8], NDArray[np.float32] | None]:
    """Draws a map in colours over the background.

    shown: [height, width], 0..1 along the colour map. covered: float32 [height, width], the share of a pixel that is
    not background. unpaired: float32 [height, width], the share of a pixel that gets the colour OUTSIDE, which is not
    in the colour map. background: as checked, or None for straight alpha. Returns the image, uint8 [height, width, 4],
    and the premultiplied colour without the background, float32 [height, width, 4], or None if the picture keeps none.
    """
    import numpy as np

    from clpeel.pictures.background import levels_of, rows_of
    from clpeel.pictures.colormap import OUTSIDE, colors_at

    height, width = shown.shape
    image = np.empty((height, width, 4), np.uint8)
    image[...] = (0, 0, 0, 0) if background is None else levels_of(background, height)
    behind = None if background is None else rows_of(background, height)[:, 0]
    color = None if picture.color is None else np.zeros((height, width, 4), np.float32)
    rows = max(STRIP_PIXELS // width, 1)
    for top in range(0, height, rows):
        row, column = np.nonzero(covered[top : top + rows] > 0)
        row += top
        share = covered[row, column][:, None]
        rgb = colors_at(shown[row, column])
        if unpaired is not None:
            outside = unpaired[row, column][:, None] / share
            rgb = rgb * (1 - outside) + OUTSIDE * outside
        if color is not None:
            color[row, column] = np.concatenate([rgb * share, share], axis=-1)
        if behind is None:
            over = np.concatenate([rgb, share], axis=-1)
        else:
            over = np.concatenate([rgb * share + (1 - share) * behind[row], np.ones_like(share)], axis=-1)
        image[row, column] = (over * 255 + 0.5).astype(np.uint8)
    return image, color
