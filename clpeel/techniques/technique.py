"""What a technique is: a description of how layers are found and blended. The stages do the work."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Generic, TypeVar

from clpeel.checks import Background
from clpeel.device.layout import FRAGMENT_BYTES, Targets
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
"""A technique's name, and the (name, value) pairs of the options that make it differ: a key of the measured costs."""


class Technique(Generic[O]):
    """A technique describes itself by the attributes and methods here. A subclass says what differs from the defaults.

    name: the user's word for it. summary: one line. kernel: its file, below kernels/. options: the class of the options
    of `render` that it has besides those of all pictures.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    kernel: ClassVar[str]
    options: type[O]

    exact: ClassVar[bool] = False
    """Whether it blends every layer in order."""

    least_passes: ClassVar[int] = 0
    """Geometry passes that any picture takes, as the papers count them. Peeling more layers takes more passes."""

    paper_precision: ClassVar[PrecisionName] = DEFAULT_PRECISION
    """The precision of its colour buffers in the paper."""

    maps: ClassVar[tuple[str, ...]] = ()
    """Names of the maps that `finish` makes besides the picture. They are attributes of `Result`; `--map` writes the
    first."""

    light_apart: ClassVar[bool] = False
    """Whether it keeps light apart from colours, as one number. Then the headlight stands for all lights."""

    all_surfaces: ClassVar[bool] = False
    """Whether opaque surfaces are treated like all others, instead of being drawn first."""

    measures_solids: ClassVar[bool] = False
    """Whether it measures what lies within surfaces. Lines and points have no inside, so it leaves them out."""

    stores_fragments: ClassVar[bool] = False
    """Whether it stores all of a pixel's fragments at once. The memory must then be enough for them."""

    has_passes: ClassVar[bool] = False
    """Whether it can be executed by passes, as the papers' hardware does, besides tile by tile."""

    scratch_bytes: ClassVar[int] = 0
    """Further bytes that it needs for each fragment, if a pixel has very many."""

    def passes_for(self, layers: Count, options: O) -> Count:
        """The geometry passes, as the paper counts them, of pictures whose deepest pixel has so many layers."""
        return layers * 0 + 1

    def buffer_bytes(self, layers: int, options: O) -> int:
        """Bytes that it stores for a sample with so many transparent layers."""
        raise NotImplementedError

    def peeled(self, options: O) -> tuple[int, int] | None:
        """How many layers of a pixel it peels from the front, and from the back; None if it does not sort.

        Raises InputError if with these options layers may be lost.
        """
        return None

    def targets(self, options: O) -> Targets:
        """Its render targets where it is executed by passes (`has_passes`).

        Raises InputError if with these options it cannot be.
        """
        raise NotImplementedError

    def variants(self) -> tuple[O, ...]:
        """The options among which `auto` may choose."""
        return (self.options(),)

    def compared(self) -> tuple[O, ...]:
        """Other options than the defaults with which a comparison draws it: points of its trade of time for error."""
        return ()

    def error_without_order(self, layers: int, alpha: float) -> float | None:
        """How far off a channel is at most, 0..1, with so many layers of at most this alpha; None if unknown."""
        return None

    def draw(self, frame: Frame, batch: Batch, options: O) -> Drawn:
        """Draws a batch of tiles into the frame's picture."""
        raise NotImplementedError

    def finish(self, picture: Picture, triangles: Triangles, background: Background | None, options: O) -> Finished:
        """Makes the maps of what was drawn. By default there are none, and the picture stays as it was drawn."""
        return picture.finished()

    @property
    def sorts(self) -> bool:
        """Whether it knows the order of a pixel's layers. Only then can it give the layers besides the picture."""
        return self.peeled(self.options()) is not None

    @property
    def option_names(self) -> tuple[str, ...]:
        """The names of the options of `render` that it has besides those of all pictures, and `layers` if it sorts."""
        return (*(each.name for each in options_of(self.options)), *(("layers",) if self.sorts else ()))

    def variant(self, options: O) -> Variant:
        """The technique's name, with the options that are not the defaults.

        max_error is not among them, because it does not change what a fragment or a pass costs.
        """
        return self.name, tuple(part for part in options.given() if part[0] != "max_error")

    def label(self, options: O) -> str:
        """`variant` as text, such as `multi-layer-peeling, layers_per_pass 16`."""
        return ", ".join([self.name, *(f"{name} {value}" for name, value in self.variant(options)[1])])


def opaque_bytes(options: Options) -> int:
    """Bytes that are stored for a sample if opaque surfaces are drawn first: z-far, and the colour there (opaque.h)."""
    blending = options if isinstance(options, Blending) else Blending()
    return FRAGMENT_BYTES + blending.color_bytes
