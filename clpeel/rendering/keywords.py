"""The options of `render` for editors and type checkers. Written by tools/write_keywords.py: do not edit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypedDict


class Keywords(TypedDict, total=False):
    """Options by name. Which technique has which, `clpeel techniques` lists; another is an InputError."""

    light_intensity: float
    """What the light of kit and scene is multiplied with (default: 1)."""
    highlights: Literal["dimmed", "full"]
    """Highlights of transparent surfaces: dimmed by their alpha (default), or full, as of glass."""
    samples: Literal[1, 4, 8, 16, 64, 256] | None
    """Samples a pixel, averaged for smooth edges: 1, 4, 8, 16, 64 or 256."""
    memory: int | str | None
    """Device memory to use, such as 512M or 2G (default: a share of the device's)."""
    keep_color: bool
    """Whether the result has the float32 colour besides the 8-bit picture."""
    layers: bool
    """Whether the result has the layers of every pixel."""
    maps: Sequence[str]
    """Maps that the result has besides: depth, normal, triangle, layer_count, transmittance."""
    opaque: Literal["first", "blend"]
    """Draw opaque surfaces first (default), or blend them as any other."""
    execution: Literal["tiles", "passes"]
    """Draw tile by tile (default), or pass by pass as the papers do, where the technique can."""
    backface_type: Literal["default", "visible", "hidden"]
    """Faces seen from behind: drawn unless the file says one side only (default), visible, or hidden."""
    anisotropy: Literal[1, 2, 4, 8, 16]
    """The most samples of a texture where it is seen at a slant: 1, 2, 4, 8 or 16."""
    line_width: float | str
    """Width of lines in pixels, or in scene units, such as 0.01u."""
    point_size: float | str
    """Width of points in pixels, or in scene units, such as 0.01u."""
    point_type: Literal["sphere", "disc", "square"]
    """Points are discs that lights show as balls, discs, or squares."""
    edges: bool
    """Draw the edges of all faces."""
    feature_edges: float | None
    """Draw the edges where faces bend by more than this, and those of one face alone."""
    silhouettes: bool
    """Draw the outlines, where a surface hides what lies behind it."""
    edge_color: tuple[float, float, float] | str
    """Colour of edges and outlines (default: black)."""
    edge_opacity: float
    """Opacity of edges and outlines (default: 1)."""
    hidden_edges: float
    """Opacity of edges and outlines that opaque surfaces hide, which shine through (default: 0)."""
    depth_format: Literal["float32-reversed", "float32", "unorm24", "rgba8"]
    """What is kept of depths (default: float32-reversed)."""
    blending_space: Literal["srgb", "linear"]
    """Blend colours as they are shown (srgb, default), or as light that adds up (linear)."""
    precision: Literal["float32", "half", "unorm8"]
    """Of the buffers that colours are blended into, each blend rounded as hardware does."""
    max_error: float | None
    """Skip layers that cannot change a channel by more; 0 is exact."""
    passes: int | None
    """Peel so many times and stop, where the technique peels."""
    occlusion_query: bool
    """Stop the passes where one finds nothing."""
    coincident: Literal["keep", "paper"]
    """Of equal depths keep all fragments, or the first alone."""
    layers_per_pass: int
    """Layers a pass, where the technique peels several (default: 8)."""
    hazard_window: int | None
    """Multi-layer-peeling: simulate so many concurrent writes."""
    hazard_order: Literal["nearest-last", "arrival"]
    """Multi-layer-peeling: the order in which these writes land."""
    torn_writes: bool
    """Multi-layer-peeling: of two writes that meet, each commits half."""
    racing_writes: bool
    """Multi-layer-peeling by passes: read and write without atomics, and repeat passes until all is right."""
    variant: Literal["exact", "total", "first-solid"]
    """Of thickness: what lies within surfaces, from first to last, or the first solid (default: exact)."""
    scale_bar: bool
    """Show a scale bar in the picture of a map."""
    projected: bool
    """Thickness in window depths, 0..1, in place of scene units."""
    thickness_range: tuple[float, float] | None
    """Thickness that the first and the last colour stand for (default: 0 to the greatest)."""
    sigma: float | None
    """Extinction a scene unit (default: by the scene's size)."""
    light_color: tuple[float, float, float] | str
    """Of the light behind the scene (default: a warm white)."""
    weight: Literal["7", "8", "9", "10"]
    """Of weighted-blended: the paper's equation for weights (default: 10)."""
    kept_layers: int
    """Of k-buffer: layers that are kept and sorted (default: 8)."""
    kept_by: Literal["depth", "arrival"]
    """Of k-buffer: keep the nearest layers, or the first to arrive."""
    tail: Literal["weighted-average", "none"]
    """Of k-buffer: average the other layers, or leave them out."""
    wavelet_rank: Literal[2, 3]
    """Of wavelet: its finest level; 2 has 8 cells of depth, 3 has 16 (default: 3)."""
    wavelet_range: Literal["pixel", "scene"]
    """Of wavelet: cells lie between each pixel's first and last layer, or the clipping planes."""
    slots: Literal[2, 4, 8, 16]
    """Of multi-layer-alpha-blending: layers of a pixel that are kept apart (default: 4)."""
    nodes: Literal[4, 8, 16, 32]
    """Of adaptive: steps of the curve of visibility (default: 8)."""
    stochastic_samples: Literal[8, 16, 64]
    """Of stochastic: samples that a fragment covers some of: 8, 16 or 64 (default: 8)."""
    alpha_correction: bool
    """Correct the opacity of stochastic to that of all layers."""
    moments: Literal["4", "6", "8", "trigonometric"]
    """Of moments: how many power moments, or two trigonometric ones (default: 4)."""
    moment_precision: Literal["single", "quantized"]
    """Of moments: store them as float32, or in 16 bits each."""
    overestimation: float
    """Of moments: how much of what may hide a fragment does (default: 0.25)."""
