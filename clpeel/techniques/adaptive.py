"""adaptive: adds up colours by a curve of visibility that has at most n steps (techniques/adaptive.cl).

C = sum(Ci Ai vis(zi)) (Salvi, Montgomery and Lefohn 2011, "Adaptive Transparency"). The curve is built, and the sum
taken, in submission order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.options import option
from clpeel.techniques.precision import Blending
from clpeel.techniques.technique import Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.frame import Frame
    from clpeel.stages.tiles import Drawn

NodeCount = Literal[4, 8, 16, 32]
NODE_COUNTS: tuple[NodeCount, ...] = get_args(NodeCount)

NODE_BYTES = FRAGMENT_BYTES + 4
"""Bytes of a node's place and distance. Its transmittance is one channel of a buffer."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class NodeOptions(Blending):
    """The options of adaptive.

    nodes: how many steps the curve of visibility has at most. Pixels with no more layers are exact, but for roundings.
    """

    nodes: NodeCount = option(8, help="of adaptive: steps of the curve of visibility (default: 8)")


class Adaptive(Technique[NodeOptions]):
    """Weighs each colour by how much of it is seen, by a curve that is compressed."""

    name = "adaptive"
    summary = "fast, not exact: adds up colours by how much of them is seen, by a curve of 8 steps a pixel"
    kernel = "techniques/adaptive.cl"
    options = NodeOptions
    least_passes = 1
    stores_fragments = True

    def buffer_bytes(self, layers: int, options: NodeOptions) -> int:
        """All fragments of a sample, as they are gone through twice; the nodes; and the colour."""
        node_bytes = NODE_BYTES + options.color_bytes // 4
        return FRAGMENT_BYTES * layers + options.nodes * node_bytes + options.color_bytes

    def compared(self) -> tuple[NodeOptions, ...]:
        """The other numbers of nodes."""
        return tuple(NodeOptions(nodes=nodes) for nodes in NODE_COUNTS if nodes != self.options().nodes)

    def draw(self, frame: Frame, batch: Batch, options: NodeOptions) -> Drawn:
        """Draws the batch in one geometry pass. Its fragments are gone through twice."""
        constants = {"NODES": int(options.nodes), "PERSPECTIVE": int(frame.triangles.perspective)}
        scale = (frame.triangles.depth_scale,)
        return frame.once(batch, self.kernel, {**options.constants, **constants}, parameters=scale)
