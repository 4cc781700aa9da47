"""Records: the structs that the host and the kernels share, as NumPy dtypes and as OpenCL C."""

from __future__ import annotations

from typing import Any

import numpy as np

from clpeel.device import layout

VERTEX = np.dtype(
    [
        ("x", np.int32),  # subpixels right of the image's centre, rounded to nearest
        ("y", np.int32),  # subpixels below the image's centre
        ("offset_x", np.float32),  # exact minus snapped position, subpixels, within +-0.5
        ("offset_y", np.float32),
        ("depth", np.float32),  # reversed: near / view distance, or (far - distance) / (far - near)
        ("outcode", np.uint32),
    ]
)
"""A vertex after projection. If `outcode` is not zero, the other fields mean nothing."""

TRIANGLE = np.dtype(
    [
        ("x", np.int32, 3),  # snapped corners in subpixels, farthest first; area positive, y down
        ("y", np.int32, 3),
        ("depth", np.float32, 3),  # of its plane: at the first snapped corner, and how much more at the others
        ("depth_min", np.float32),  # the least and the greatest depth of the exact corners: fragments stay within these
        ("depth_max", np.float32),
        ("inverse_area", np.float32),  # 1 / twice the area in square subpixels
        ("source", np.uint32),  # submission index: the number of its face
        ("flags", np.uint32),  # SMALL | BACK_FACING | OPAQUE | TURNED
        ("left_right", np.uint32),  # its bounds, as in `bounds`: first column | last column << 16
        ("top_bottom", np.uint32),  # first row | last row << 16
    ]
)
"""A record: what the rasterizer needs of a triangle. It has 64 bytes, a cache line."""

MAPPING = np.dtype(
    [
        ("texture", np.uint32),  # where the texture begins among all words of textures
        ("flags", np.uint32),  # FLOAT_TEXELS | MIRROR_U | ... (layout.py)
        ("width", np.int32),  # in texels
        ("height", np.int32),
        ("last_level", np.int32),  # of its mip map
        ("uv", np.uint32),  # where its coordinates begin among those of all sets, in vertices
        ("used", np.uint32),  # whether there is a texture
        ("tangents", np.uint32),  # of a map of normals: where tangents begin among normals, in vertices
    ]
)
"""A texture, and how it is sampled (clpeel/scene/textures.py)."""

MATERIAL = np.dtype(
    [
        ("base_color", np.float32, 4),  # linear
        ("opacity", np.float32),
        ("alpha_cutoff", np.float32),
        ("flags", np.uint32),  # CUT | BLENDED | ... (layout.py)
        ("metallic", np.float32),
        ("roughness", np.float32),
        ("emissive", np.float32, 3),  # linear
        ("normal_scale", np.float32),
        ("occlusion_strength", np.float32),
        ("mapped", np.uint32),  # whether any texture but the first is used
        ("spare", np.uint32),
        ("base", MAPPING),
        ("metallic_roughness_map", MAPPING),
        ("normal_map", MAPPING),
        ("occlusion_map", MAPPING),
        ("emissive_map", MAPPING),
        ("albedo", np.float32, 2 * layout.ALBEDO_SIDE),  # of its roughness (clpeel/stages/albedo.py)
    ]
)
"""A material (clpeel/scene/materials.py)."""

LIGHTING = np.dtype(
    [
        ("right", np.float32, 3),  # the camera's axes in the scene, of length 1
        ("up", np.float32, 3),
        ("back", np.float32, 3),  # against the view
        ("zenith", np.float32, 3),  # where the sky is, in the camera's space, of length 1
        ("sky", np.float32, 3),  # light from above, linear
        ("ground", np.float32, 3),  # light from below
        (
            "ray",
            np.float32,
            2,
        ),  # a subpixel, across and down, on a plane at distance 1; in parallel projection its sides
        ("near", np.float32),  # distances as in positions on the device: of the near plane and the far plane
        ("far", np.float32),
        ("span", np.float32),  # far - near
        ("perspective", np.uint32),
        ("count", np.uint32),  # of lamps, which follow
    ]
)
"""The light on a scene, as a camera sees it (clpeel/stages/lighting.py)."""

LAMP = np.dtype(
    [
        ("toward", np.float32, 3),  # its direction, of length 1, or its place, in the camera's space
        ("placed", np.uint32),
        ("color", np.float32, 3),  # linear; its intensity / pi
        ("shines", np.uint32),  # whether it makes highlights
        ("along", np.float32, 3),  # where its beam goes
        ("cone_scale", np.float32),  # its share is (cosine * scale + offset)^2, within 0 .. 1
        ("cone_offset", np.float32),
        ("inverse_range2", np.float32),
        ("unit2", np.float32),  # the square of a scene unit on the device
        ("spare", np.uint32),
    ]
)
"""A light (clpeel/scene/lights.py)."""

WIRING = np.dtype(
    [
        ("color", np.float32, 4),  # sRGB, or linear where blending is, and its opacity
        ("first_band", np.uint32),  # the first triangle of bands, behind all others
        ("bands", np.uint32),  # where their wires begin, behind those of edges
        ("faces", np.uint32),  # of the scene, which have lists of edges
        ("spare", np.uint32),
    ]
)
"""How edges are drawn (kernels/shading/wires.h)."""

WIRE = np.dtype(
    [
        ("x", np.float32),  # where it begins, from the image's centre: subpixels of a sample's height
        ("y", np.float32),
        ("right", np.float32),  # how far it goes
        ("down", np.float32),
        ("inverse_length2", np.float32),
        ("reach", np.float32),  # half of its width where it begins, in the same subpixels; -1 if it is not seen
        ("growth", np.float32),  # how much more that is where it ends
        ("face", np.uint32),  # of a band: the face beside it, whose strokes reach over it, too; else FROM_FRONT | ...
    ]
)
"""An edge as a view sees it, cut by the planes (kernels/stages/wires.cl)."""

SCREEN = np.dtype(
    [
        ("first_tile", np.uint32),  # of the batch, in the picture
        ("columns", np.int32),  # tiles in a row of the picture
        ("width", np.int32),  # of the picture, in samples
        ("height", np.int32),
        ("depth_scale", np.float32),  # what window depths are multiplied with (depth.h)
        ("view", np.float32, 3),  # the direction that the camera looks in, of length 1
    ]
)
"""Where a batch's tiles are, and how they are seen: a kernel argument by value.

What compositing needs stays loose: in a struct like this one it made `draw` 3 % slower, and the background as a float4
by value made it 2 % slower (PoCL, one lane).
"""

PEEL_TOTALS = np.dtype(
    [
        ("fragments", np.uint32),
        ("layers", np.uint32),  # layers that were peeled of the deepest pixel
        ("passes", np.uint32),  # issued; where passes are repeated: 1 + a pixel whose passes have no end, or 0
        ("truncated", np.uint32),  # samples with layers that no pass reached
        ("hidden", np.float32),  # the greatest transmittance in front of such layers
        ("opaque", np.uint32),  # samples with an opaque surface
    ]
)
"""What peeling counts of a tile (many_passes.h)."""

ONE_PASS_TOTALS = np.dtype(
    [
        ("fragments", np.uint32),
        ("layers", np.uint32),  # fragments of the deepest pixel
        ("opaque", np.uint32),  # samples with an opaque surface
        ("truncated", np.uint32),  # samples with fragments that are lost
    ]
)
"""What one pass counts of a tile: a uint4 (one_pass.h)."""

WINDOW_TOTALS = np.dtype([("fragments", np.uint32), ("layers", np.uint32)])
"""Fragments of a tile and of its deepest pixel, counted before the fragments are emitted: a uint2 (windows.cl)."""

COUNT_TOTALS = np.dtype(
    [
        ("fragments", np.uint32),  # transparent fragments in front of opaque surfaces
        ("layers", np.uint32),  # such fragments of the deepest pixel
        ("opaque", np.uint32),  # samples with an opaque surface
        ("all_fragments", np.uint32),  # fragments of all surfaces, even behind opaque ones
        ("all_layers", np.uint32),  # such fragments of the deepest pixel
        ("visits", np.uint32),  # strips visited for transparent records
        ("opaque_visits", np.uint32),  # strips visited for opaque records
        ("opaque_records", np.uint32),
    ]
)
"""What counting finds in a tile (counting.cl)."""

TOTALS = {"PEEL": PEEL_TOTALS, "COUNT": COUNT_TOTALS}
"""Totals that kernels keep as arrays of uints. In a kernel, PEEL_LAYERS is the place of `layers` in PEEL_TOTALS."""

STRUCTS = {
    "Vertex": VERTEX,
    "Triangle": TRIANGLE,
    "Mapping": MAPPING,
    "Material": MATERIAL,
    "Lighting": LIGHTING,
    "Lamp": LAMP,
    "Wiring": WIRING,
    "Wire": WIRE,
    "Screen": SCREEN,
}
"""The structs by their names in OpenCL C. A field may be a struct that stands before."""

_NUMBERS = ("AMBIENT", "DIELECTRIC", "LEAST_FACING", "LEAST_ROUGHNESS")
"""Constants of the layout that are no whole numbers, as kernels know them."""

_C_TYPES: dict[np.dtype[Any], str] = {
    np.dtype(np.int32): "int",
    np.dtype(np.uint32): "uint",
    np.dtype(np.float32): "float",
}
_C_TYPES |= {dtype: name for name, dtype in STRUCTS.items()}


def declarations() -> str:
    """OpenCL C text that declares the shared constants, the structs, and the places of totals."""
    lines = [
        f"#define {name} {value}"
        for name, value in vars(layout).items()
        if name.isupper() and not name.startswith("_") and isinstance(value, int)
    ]
    lines += [f"#define {name} {getattr(layout, name)!r}f" for name in _NUMBERS]
    for name, dtype in STRUCTS.items():
        fields = []
        for field in dtype.names or ():
            base, shape = dtype[field].base, dtype[field].shape
            fields.append(f"{_C_TYPES[base]} {field}{f'[{shape[0]}]' if shape else ''};")
        lines.append(f"typedef struct {{ {' '.join(fields)} }} {name};")
    for name, dtype in TOTALS.items():
        names = dtype.names or ()
        lines.append(f"#define {name}_TOTALS {len(names)}")
        lines += [f"#define {name}_{field.upper()} {place}" for place, field in enumerate(names)]
    return "\n".join(lines) + "\n"
