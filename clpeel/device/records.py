"""Records: the structs that the host and the kernels share, as NumPy dtypes and as OpenCL C."""

from __future__ import annotations

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
        ("flags", np.uint32),  # SMALL | BACK_FACING | OPAQUE
        ("left_right", np.uint32),  # its bounds, as in `bounds`: first column | last column << 16
        ("top_bottom", np.uint32),  # first row | last row << 16
    ]
)
"""A record: what the rasterizer needs of a triangle. It has 64 bytes, a cache line."""

MATERIAL = np.dtype(
    [
        ("base_color", np.float32, 4),  # linear
        ("opacity", np.float32),
        ("alpha_cutoff", np.float32),
        ("flags", np.uint32),  # CUT | BLENDED | ... (layout.py)
        ("texture", np.uint32),  # where its texture begins among all words of textures
        ("width", np.int32),  # of its texture, in texels
        ("height", np.int32),
        ("last_level", np.int32),  # of its texture's mip map
        ("spare", np.uint32),
    ]
)
"""A material (clpeel/scene/materials.py)."""

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
        ("spare", np.uint32),
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

STRUCTS = {"Vertex": VERTEX, "Triangle": TRIANGLE, "Material": MATERIAL, "Screen": SCREEN}

_C_TYPES = {np.dtype(np.int32): "int", np.dtype(np.uint32): "uint", np.dtype(np.float32): "float"}


def declarations() -> str:
    """OpenCL C text that declares the shared constants, the structs, and the places of totals."""
    lines = [
        f"#define {name} {value}"
        for name, value in vars(layout).items()
        if name.isupper() and not name.startswith("_") and isinstance(value, int)
    ]
    lines.append(f"#define AMBIENT {layout.AMBIENT!r}f")
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
