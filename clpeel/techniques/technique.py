"""What a technique is: how layers are found and blended, described; the stages do the work."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar

from clpeel.checks import Rgb
from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.options import Options, options_of
from clpeel.techniques.precision import DEFAULT_PRECISION, Blending, PrecisionName

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from clpeel.stages.binning import Batch
    from clpeel.stages.composite import Finished, Picture
    from clpeel.stages.frame import Frame
    from clpeel.stages.projection import Triangles
    from clpeel.stages.tiles import Drawn

O = TypeVar("O", bound=Options)  # noqa: E741
Count = TypeVar("Count", int, "NDArray[np.int64]")
"""A number of layers, or an array of them."""

Variant = tuple[str, tuple[tuple[str, object], ...]]
"""A technique's name, and of the options that make it another the names and values: a key of what was measured."""


class Technique(Generic[O]):
    """A technique describes itself by these names; a subclass says what differs from the defaults here.

    name: the user's word for it. summary: one line. kernel: its file, below kernels/. options: the class of those
    options of `render` that it has besides those of all pictures.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    kernel: ClassVar[str]
    options: type[O]

    exact: ClassVar[bool] = False
    """Whether it blends every layer in order."""

    least_passes: ClassVar[int] = 0
    """Geometry passes of any picture, as the papers count them; those that peel need more for more layers."""

    paper_precision: ClassVar[PrecisionName] = DEFAULT_PRECISION
    """Of its colour buffers in the paper."""

    maps: ClassVar[tuple[str, ...]] = ()
    """What `finish` makes besides the picture, as names of `Result`; `--map` writes the first."""

    all_surfaces: ClassVar[bool] = False
    """Whether opaque surfaces are treated as any other, and not drawn first."""

    stores_fragments: ClassVar[bool] = False
    """Whether it keeps all of a pixel's fragments at once, which the memory must then be enough for."""

    scratch_bytes: ClassVar[int] = 0
    """What it needs for each fragment besides the fragment, where a pixel has very many."""

    def passes_for(self, layers: Count, options: O) -> Count:
        """The geometry passes, as the paper counts them, of pictures whose deepest pixels have so many layers."""
        return layers * 0 + 1

    def buffer_bytes(self, layers: int, options: O) -> int:
        """What it keeps of a sample with so many transparent layers."""
        raise NotImplementedError

    def peeled(self, options: O) -> tuple[int, int] | None:
        """How many layers of a pixel it peels from the front, and from the back; None where it does not sort.

        Raises InputError where the options allow that layers are lost.
        """
        return None

    def variants(self) -> tuple[O, ...]:
        """The options that `auto` has the choice of."""
        return (self.options(),)

    def error_without_order(self, layers: int, alpha: float) -> float | None:
        """How far off a channel is at most, with so many layers of such alphas; None where nothing is known."""
        return None

    def draw(self, frame: Frame, batch: Batch, options: O) -> Drawn:
        """Draws a batch of tiles into the frame's picture."""
        raise NotImplementedError

    def finish(self, picture: Picture, triangles: Triangles, background: Rgb | None, options: O) -> Finished:
        """Makes the maps of what was drawn; the picture stays as it was drawn where there are none."""
        return picture.finished()

    @property
    def sorts(self) -> bool:
        """Whether it knows the order of a pixel's layers, so that it can give them besides the picture."""
        return self.peeled(self.options()) is not None

    @property
    def option_names(self) -> tuple[str, ...]:
        """The options of `render` that it has besides those of all pictures."""
        return (*(each.name for each in options_of(self.options)), *(("layers",) if self.sorts else ()))

    def variant(self, options: O) -> Variant:
        """The technique with those options that make it another; how exactly it is drawn is none of them."""
        return self.name, tuple(part for part in options.given() if part[0] != "max_error")

    def label(self, options: O) -> str:
        """`variant` in words: `multi-layer-peeling, layers_per_pass 16`."""
        return ", ".join([self.name, *(f"{name} {value}" for name, value in self.variant(options)[1])])


def opaque_bytes(options: Options) -> int:
    """What is kept of a sample where opaque surfaces come first: z-far, and the colour there (opaque.h)."""
    blending = options if isinstance(options, Blending) else Blending()
    return FRAGMENT_BYTES + blending.color_bytes
