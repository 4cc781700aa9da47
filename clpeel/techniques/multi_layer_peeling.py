"""multi-layer-peeling: each pass peels several layers, by insertion sort (techniques/multi-layer-peeling.cl).

Liu, Wei and Xu 2006, "Multi-layer depth peeling via fragment sort": a pass peels M layers, so N layers take N / M
passes, rounded up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

from clpeel.device.layout import ALL_LAYERS, FRAGMENT_BYTES, Targets
from clpeel.errors import InputError
from clpeel.options import count, option
from clpeel.techniques.peeling import Peeling
from clpeel.techniques.technique import Count, Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.tiles import Drawn

MOST_LAYERS = 64

MAX_WINDOW = 2**31 - 1
HazardOrder = Literal["nearest-last", "arrival"]
HAZARD_ORDERS: tuple[HazardOrder, ...] = get_args(HazardOrder)

TORN_WINDOW = 2
"""The default hazard_window with torn_writes: two fragments write at once, as in the paper's Figure 2."""


def layers_per_pass(targets: int = 4, target_bytes: int = 16, color_bytes: int = 4, depth_bytes: int = 4) -> int:
    """M of the paper's equation 1: how many layers (buckets) so many render targets hold.

    M = Mrt Bm / (Bc + Bd). targets: Mrt. target_bytes: Bm, bytes of a pixel in one target. color_bytes, depth_bytes: Bc
    and Bd, bytes of a bucket. 4 targets of 4 x FP32 hold 8 buckets of RGBA8 and FP32 depth, or 16 of depth alone
    (color_bytes=0). Raises InputError if not even one bucket fits.
    """
    bucket = color_bytes + depth_bytes
    layers = targets * target_bytes // bucket if bucket > 0 else 0
    if layers < 1:
        raise InputError(
            f"layers_per_pass: expected render targets that hold one bucket of {bucket} bytes, "
            f"got {targets} of {target_bytes} bytes"
        )
    return layers


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class MultiLayerOptions(Peeling):
    """The options of Peeling, and those of a pass of several layers.

    hazard_window: how many fragments of a pixel write at once (a wave); None for atomic writes, or TORN_WINDOW with
    torn_writes. hazard_order: the order in which the writes of a wave land. "nearest-last" keeps the paper's bound of M
    passes; with "arrival" they land as the fragments arrive. torn_writes: of two writes that meet, each commits half of
    its targets. racing_writes: only with execution="passes": fragments of a pixel read and write its targets at the
    same time and without atomics, as on the paper's hardware.
    """

    layers_per_pass: int = option(
        layers_per_pass(),
        count(MOST_LAYERS),
        flag="--layers",
        help="layers a pass, where the technique peels several (default: 8)",
    )
    hazard_window: int | None = option(
        None, count(MAX_WINDOW), help="multi-layer-peeling: simulate so many concurrent writes"
    )
    hazard_order: HazardOrder = option("nearest-last", help="multi-layer-peeling: the order in which these writes land")
    torn_writes: bool = option(False, help="multi-layer-peeling: of two writes that meet, each commits half")
    racing_writes: bool = option(
        False,
        help="multi-layer-peeling by passes: read and write without atomics, and repeat passes until all is right",
    )

    @property
    def simulates_hazards(self) -> bool:
        """Whether writes are concurrent. A pass may then have to be repeated."""
        return self.hazard_window is not None or self.torn_writes

    def check_together(self) -> None:
        """Raises InputError if an option would end passes that are repeated: they end when nothing is written.

        Also raises the errors of Peeling.
        """
        if self.simulates_hazards or self.racing_writes:
            given = dict(self.given())
            other = "hazard_window" if self.simulates_hazards else "racing_writes"
            for name in sorted(given.keys() & {"passes", "occlusion_query", "max_error"}):
                raise InputError(f"{name}: expected none with {other}: its passes end when nothing is written; got one")
        if self.simulates_hazards and self.racing_writes:
            raise InputError("racing_writes: expected no hazard_window and no torn_writes with it, got both")
        super().check_together()


class MultiLayerPeeling(Technique[MultiLayerOptions]):
    """Peels M layers a pass."""

    name = "multi-layer-peeling"
    summary = "exact: peels several layers, 8 by default, in each geometry pass by insertion sort"
    kernel = "techniques/multi-layer-peeling.cl"
    options = MultiLayerOptions
    exact = True
    paper_precision = "unorm8"
    has_passes = True

    def passes_for(self, layers: Count, options: MultiLayerOptions) -> Count:
        """N / M passes for N layers, rounded up (Liu, Wei and Xu 2006)."""
        return -(-layers // options.layers_per_pass)

    def buffer_bytes(self, layers: int, options: MultiLayerOptions) -> int:
        """z_near, a slot for each layer of a pass, whether there are more layers, and the colour.

        See Buffers in the kernel file.
        """
        return FRAGMENT_BYTES * (1 + options.layers_per_pass) + 4 + options.color_bytes

    def peeled(self, options: MultiLayerOptions) -> tuple[int, int]:
        """`layers_per_pass` layers a pass from the front, and none from the back.

        Raises InputError with torn_writes, as these may lose layers.
        """
        if options.torn_writes:
            raise InputError("layers: expected no torn_writes, with which layers may be lost; got both")
        return ALL_LAYERS if options.passes is None else options.passes * options.layers_per_pass, 0

    def variants(self) -> tuple[MultiLayerOptions, ...]:
        """The default number of layers a pass, 2, 4 and 16. More than 16 do not stay in a processor's registers."""
        return tuple(MultiLayerOptions(layers_per_pass=layers) for layers in (layers_per_pass(), 2, 4, 16))

    def targets(self, options: MultiLayerOptions) -> Targets:
        """A slot for each layer of a pass, z-near and the colour.

        Raises InputError if hazards are simulated.
        """
        if options.simulates_hazards:
            raise InputError("execution: expected 'tiles' with hazard_window and torn_writes, got 'passes'")
        return Targets(depths=options.layers_per_pass, bounds=1, colors=1, racing=options.racing_writes)

    def draw(self, frame: Frame, batch: Batch, options: MultiLayerOptions) -> Drawn:
        """Peels until nothing is left, or `passes` times.

        With hazard_window, so many fragments of a pixel write at once, and the last write wins. With torn_writes, each
        of two writes that meet commits half of its targets. Raises InputError if the inner loop of the paper's Table 1
        then has no end.
        """
        constants = {"LAYERS_A_PASS": options.layers_per_pass}
        if not options.simulates_hazards:
            return frame.peel(batch, self.kernel, options, constants)
        constants["HAZARD_WINDOW"] = options.hazard_window or TORN_WINDOW
        constants["HAZARD_ARRIVAL"] = int(options.hazard_order == "arrival")
        constants["TORN_WRITES"] = int(options.torn_writes)
        return frame.peel(
            batch,
            self.kernel,
            options,
            constants,
            layers_a_pass=options.layers_per_pass,
        )
