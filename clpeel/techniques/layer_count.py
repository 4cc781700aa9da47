"""layer-count: how many layers each pixel has, as a map and its picture (techniques/layer-count.cl)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from clpeel.checks import Background
from clpeel.device.layout import FRAGMENT_BYTES
from clpeel.techniques.maps import MapOptions, paint
from clpeel.techniques.technique import Technique

if TYPE_CHECKING:
    from clpeel.stages.binning import Batch
    from clpeel.stages.composite import Finished, Picture
    from clpeel.stages.frame import Frame
    from clpeel.stages.projection import Triangles
    from clpeel.stages.tiles import Drawn


class LayerCount(Technique[MapOptions]):
    """The map `layer_count`, float32 [height, width]: the mean of a pixel's samples, a whole number if it has one."""

    name = "layer-count"
    summary = "how many layers each pixel has, opaque ones too: a map, and its picture in colours with a scale bar"
    kernel = "techniques/layer-count.cl"
    options = MapOptions
    maps = ("layer_count",)
    least_passes = 1
    all_surfaces = True
    stores_fragments = True

    def buffer_bytes(self, layers: int, options: MapOptions) -> int:
        """All fragments of a sample: they are stored, as drawing does, and counted then."""
        return FRAGMENT_BYTES * layers

    def draw(self, frame: Frame, batch: Batch, options: MapOptions) -> Drawn:
        """Needs no colours, so no fragment needs one of its own."""
        return frame.without_colors().once(batch, self.kernel, {})

    def finish(
        self, picture: Picture, triangles: Triangles, background: Background | None, options: MapOptions
    ) -> Finished:
        """The map, and the picture: 0 to the most layers, at least 1, along the colour map."""
        from clpeel.pictures.scale_bar import draw_scale_bar

        layers = picture.found[..., 0].copy()
        covered = picture.found[..., 2]
        most = max(float(layers.max()), 1.0)
        image, color = paint(picture, background, layers / most, covered)
        if options.scale_bar:
            draw_scale_bar(image, 0, most, "layers", covered > 0, unpaired=False, whole=True)
        return picture.finished({"layer_count": layers}, image=image, color=color)
