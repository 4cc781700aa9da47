"""Known layers: a small scene whose picture is known, because it can be computed in a few lines, by every technique.

Some triangles lie one behind the other, and are submitted out of order. Two cross each other between two columns of
samples, and two lie at the same depth. Edges, crossings and cuts are clear of all samples, so no rounding changes which
fragments there are, or in which order they lie. All numbers are computed here in float64, from the papers' formulas.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.device.layout import AMBIENT, REGULAR, Features
from clpeel.device.samples import PATTERNS, Pattern
from clpeel.options import Options
from clpeel.rendering.known_lights import KNOWN_LIGHTS, covering, under_lights
from clpeel.rendering.known_masks import Masks, masks_of
from clpeel.rendering.known_moments import seen_of
from clpeel.scene.camera import Camera
from clpeel.scene.lights import KIT, PointLight
from clpeel.scene.materials import Finish, Material
from clpeel.scene.scene import Scene
from clpeel.scene.textures import Minify, Texture, linear, srgb
from clpeel.stages.shading import MATT
from clpeel.techniques import TECHNIQUES, AnyTechnique
from clpeel.techniques.moments import MomentsOptions
from clpeel.techniques.translucency import LIGHT_COLOR, OPTICAL_DIAGONAL, REFLECTANCE

Floats = NDArray[np.float64]

HEIGHT = 32
"""Samples of the picture from top to bottom. Half of it is the focal length in samples (a view angle of 90 degrees)."""

WIDTH = 40
"""Samples of the picture from left to right: two whole tiles and half a tile, except where a pixel has 256 samples."""

NEAR, FAR = 1.0, 8.0
"""The clipping range."""

FLAT_BACK, FLAT_FRONT = (4.0, 4.0, 4.0), (1.5, 1.5, 1.5)
LEFT_NEARER, RIGHT_NEARER = (2.0, 2.0, 3.0), (3.0, 3.0, 2.0)

FACES: tuple[tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]], ...] = (
    ((-14.25, 11.0, 10.75), (-11.75, -12.25, 13.25), FLAT_BACK),
    ((-16.0, -16.0, 16.0), (-15.0, 13.0, -3.0), LEFT_NEARER),
    ((-9.25, 15.0, 3.25), (-5.25, -5.25, 10.25), FLAT_FRONT),
    ((-8.0, 12.75, 13.0), (12.0, 12.25, -14.25), FLAT_BACK),
    ((-16.0, -16.0, 16.0), (10.0, -10.0, 6.0), RIGHT_NEARER),
)
"""The triangles in the order of submission: three x and three y in samples from the picture's centre, and three view
distances. All of these numbers are exact in float32, as positions and as distances.
"""

CUT = ((-16.0, -16.0, 16.0), (-12.0, 7.75, 8.0), (0.5, 0.5, 4.0))
"""One more triangle for pictures in which triangles are clipped: the near plane cuts it."""

NUDGE = (0.0625, -0.046875, 0.0)
"""Added to all corners where samples lie in a rotated pattern, so that edges are clear of all of them."""

OPAQUE_FACE = 4
"""Which of FACES is opaque where some are. It crosses another one."""

COLORS = np.array(
    [
        (0.25, 0.75, 0.5, 0.5),
        (0.75, 0.25, 1.0, 0.25),
        (0.5, 1.0, 0.25, 0.75),
        (1.0, 0.5, 0.75, 0.5),
        (0.25, 0.5, 1.0, 0.5),
        (0.5, 0.25, 0.75, 0.25),
    ]
)
"""The colours of FACES and CUT: straight, and exact binary fractions."""

TEXELS = ((255, 128, 64), (200, 255, 100), (90, 180, 255), (255, 220, 160), (120, 240, 200), (255, 255, 140))
"""The texel of each of FACES and CUT where faces have materials: red, green and blue, sRGB."""

SPREAD = 1
"""Which of FACES shows a texture of one colour many times over, so that its texels are smaller than pixels."""

LEAST_APART = 1e-9
"""View distances that differ by less are equal: they are, but for the rounding of float64."""


@dataclass(frozen=True)
class Wanted:
    """What the scene has to be like, so that the very kernels of a picture draw it.

    features: of the kernels, but for `surfaces`, which also depends on the request. surfaces: "transparent", "mixed" or
    "opaque", of the scene. perspective: or parallel projection. pairs: positions need more than float32. cut: a
    triangle is clipped.
    """

    features: Features
    surfaces: str
    perspective: bool
    pairs: bool
    cut: bool

    @property
    def faces(self) -> Floats:
        """x, y and distance of each corner of each triangle: float64 [faces, 3, 3]."""
        faces = np.array([*FACES, CUT] if self.cut else FACES, np.float64)
        return faces if self.features.pattern == REGULAR else faces + np.array(NUDGE)[:, None]

    @property
    def view(self) -> str:
        """How positions are projected, in words."""
        return f"{'perspective' if self.perspective else 'parallel'}{', exact positions' if self.pairs else ''}"

    @property
    def offset(self) -> float:
        """How far scene and camera are moved, so that positions are no float32 numbers if they should not be."""
        return 1 / 3 if self.pairs else 0.0

    def camera(self) -> Camera:
        """Sees the scene so that a sample is one unit at a distance of HEIGHT / 2, or at any in parallel projection."""
        eye = (self.offset, self.offset, 0.0)
        return Camera(
            eye, (*eye[:2], -1.0), view_angle=90.0, clipping_range=(NEAR, FAR), orthographic=not self.perspective
        )

    def straight(self) -> Floats:
        """The colour of each corner as it is given, 0..1: float64 [faces, 3, 4]."""
        count, rate = len(self.faces), self.features.color_rate
        colors = np.repeat(COLORS[:count, None], 3, axis=1)
        if rate == "scene":
            colors[:] = COLORS[0]
        if rate == "vertex":
            for corner in (1, 2):
                colors[:, corner] = np.roll(COLORS[:count], corner, axis=1)
        if self.surfaces != "transparent":
            colors[OPAQUE_FACE if self.surfaces == "mixed" else slice(None), :, 3] = 1.0
        return colors

    def scene(self) -> Scene:
        """The scene. No two triangles share a corner."""
        x, y, distance = self.faces.swapaxes(0, 1)
        spread = distance if self.perspective else np.ones_like(distance)
        corners = np.stack([x * spread, y * spread, -distance * HEIGHT / 2], axis=-1).reshape(-1, 3) / (HEIGHT / 2)
        corners[:, :2] += self.offset
        faces = np.arange(len(corners)).reshape(-1, 3)
        given = self.given()
        materials = self.materials() if self.features.materials else {}
        if self.features.positioned:
            materials["lights"] = KNOWN_LIGHTS
        if self.features.color_rate == "scene":
            return Scene.from_arrays(corners, faces, color=given[0, 0], **materials)
        if self.features.color_rate == "face":
            return Scene.from_arrays(corners, faces, face_colors=given[:, 0], **materials)
        return Scene.from_arrays(corners, faces, vertex_colors=given.reshape(-1, 4), **materials)

    def materials(self) -> dict[str, Any]:
        """The materials as arguments of Scene.from_arrays.

        Each face shows the centre of a texel, and SPREAD a texture whose texels are all alike. Where texels route
        fragments, another texel is a hole. Then what is opaque is a cut-out, or hides as its texels have alpha 1.
        """
        features, count = self.features, len(self.faces)
        minify: Minify = "linear-mipmap-linear" if features.levels else "linear"
        image = np.full((1, 8, 4), 255, np.uint8)
        image[0, : len(TEXELS), :3] = TEXELS
        image[0, -1, 3] = 0 if features.routed else 255
        alike_texels = np.full((16, 16, 4), 255, np.uint8)
        alike_texels[..., :3] = TEXELS[SPREAD]
        texture, spread = Texture(image, minify=minify), Texture(alike_texels, minify=minify)
        kinds = [Material(texture=texture, alpha_mode="BLEND"), Material(texture=spread, alpha_mode="BLEND")]
        kinds.append(Material(texture=texture, alpha_mode="MASK"))
        of_faces = np.zeros(count, np.int32)
        of_faces[SPREAD] = 1
        if features.routed and not features.hiding and self.surfaces != "transparent":
            of_faces[OPAQUE_FACE if self.surfaces == "mixed" else slice(None)] = 2
        if (
            features.color_rate == "scene" and self.surfaces == "mixed"
        ):  # the scene's one alpha is not that of what is opaque
            kinds.append(replace(kinds[of_faces[OPAQUE_FACE]], alpha_of_scene=False))
            of_faces[OPAQUE_FACE] = len(kinds) - 1
        if features.maps:
            kinds = [replace(kind, finish=known_finish(minify)) for kind in kinds]
        uv = np.repeat(np.stack([(np.arange(count) + 0.5) / 8, np.full(count, 0.5)], axis=-1)[:, None], 3, axis=1)
        uv[SPREAD] = ((0.0, 0.0), (40.0, 0.0), (0.0, 40.0)) if of_faces[SPREAD] == 1 else uv[SPREAD]
        return {"materials": kinds, "face_materials": of_faces, "uv": uv.reshape(-1, 2)}

    @property
    def shaded_at_samples(self) -> NDArray[np.bool_]:
        """Which faces have a colour of their own at each sample: those whose texels say which of them are there."""
        scene = self.scene()
        if scene.face_materials is None:
            return np.zeros(len(scene.faces), bool)
        return np.isin(scene.face_materials, scene.face_materials[scene.kinds.routed])

    def given(self) -> NDArray[Any]:
        """The colours as the scene has them: [faces, 3, 4], uint8 or float32."""
        colors = self.straight()
        return np.rint(colors * 255).astype(np.uint8) if self.features.packed_color else colors.astype(np.float32)


@dataclass(frozen=True)
class Stack:
    """The fragments of each sample, the nearest first; of equal distances, the first submitted one first.

    All arrays are [samples, faces], and [samples, faces, 4] for color. present: whether there is a fragment; those that
    there are come first. color: straight, as it is blended. light: the headlight's share of it, 1 if unlit; color has
    it. surface: the same colour without it, [samples, faces, 3]. distance: along the view axis. back: whether the face
    is seen from behind. opaque: whether it is drawn first and hides what is behind. Then only the nearest such fragment
    is here, and nothing behind it. face: its number.
    """

    present: NDArray[np.bool_]
    color: Floats
    light: Floats
    surface: Floats
    distance: Floats
    back: NDArray[np.bool_]
    opaque: NDArray[np.bool_]
    face: NDArray[np.int64]

    @property
    def transparent(self) -> NDArray[np.bool_]:
        """Whether there is a fragment that is not an opaque one, drawn first."""
        return self.present & ~self.opaque

    @property
    def coincident(self) -> NDArray[np.bool_]:
        """Whether the fragment before is at the same distance."""
        same = np.zeros_like(self.present)
        same[:, 1:] = self.present[:, 1:] & (self.distance[:, 1:] == self.distance[:, :-1])
        return same

    @property
    def behind(self) -> Floats:
        """The opaque surface's colour and its transmittance 0; or no colour and 1 where there is none: [samples, 4]."""
        solid = (self.opaque[..., None] * self.color).sum(axis=1)
        solid[:, 3] = ~self.opaque.any(axis=1)
        return solid


def _places(size: tuple[int, int], pattern: Pattern) -> tuple[Floats, Floats]:
    """Where samples lie from the picture's centre, right and up, in rows of samples: [samples] each."""
    places = np.array(pattern.places, np.float64)
    right, down = np.moveaxis(places.reshape(pattern.rows, pattern.columns, 2), -1, 0)
    x = np.tile(right, size[::-1]) + np.repeat(np.arange(size[0]), pattern.columns) - size[0] / 2
    y = np.tile(down, size[::-1]) + np.repeat(np.arange(size[1]), pattern.rows)[:, None] - size[1] / 2
    return x.reshape(-1) * pattern.rows, -y.reshape(-1) * pattern.rows


def _centres(size: tuple[int, int], pattern: Pattern) -> tuple[Floats, Floats]:
    """The centre of the pixel that each sample is of, as in `_places`."""
    shape = size[1], 1, size[0], 1
    centres = (each.reshape(shape) * pattern.rows for each in _places(size, PATTERNS[1]))
    x, y = (np.tile(each, (1, pattern.rows, 1, pattern.columns)).reshape(-1) for each in centres)
    return x, y


def stack_of(wanted: Wanted, size: tuple[int, int], opaque_first: bool, pattern: Pattern = PATTERNS[1]) -> Stack:
    """The fragments of a picture of `size` (width, height) in pixels, row by row of samples from the top left."""
    x, y = _places(size, pattern)
    corner_x, corner_y, corner_distance = wanted.faces.swapaxes(0, 1)  # [faces, 3]

    def barycentric(x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Barycentric weights on the screen, [places, faces, 3], and twice the signed area of each face, [faces]."""

        def area(a: int, b: int) -> Floats:
            across, up = corner_x[:, b] - corner_x[:, a], corner_y[:, b] - corner_y[:, a]
            return across * (y[:, None] - corner_y[:, a]) - up * (x[:, None] - corner_x[:, a])

        areas = np.stack([area(1, 2), area(2, 0), area(0, 1)], axis=-1)
        return areas / areas.sum(axis=-1, keepdims=True), areas[0].sum(axis=-1)

    weights, areas = barycentric(x, y)
    if wanted.perspective:  # 1 / distance is linear on the screen, and so is anything linear divided by the distance
        weights /= corner_distance
        with np.errstate(divide="ignore", invalid="ignore"):  # of samples that the triangle does not cover
            distance = 1 / weights.sum(axis=-1)
            weights *= distance[..., None]
    else:
        distance = (weights * corner_distance).sum(axis=-1)
    present = (weights > 0).all(axis=-1) & (distance > NEAR) & (distance < FAR)
    values = wanted.given() / (255.0 if wanted.features.packed_color else 1.0)
    color = np.repeat(values[None, :, 0], len(weights), axis=0)  # exact, where a face has one colour
    if wanted.features.color_rate == "vertex":
        shares = weights
        if pattern.down is not None:  # shaded once for each pixel, at its centre, or as near as the face comes
            shares = np.maximum(barycentric(*_centres(size, pattern))[0], 0)
            shares /= corner_distance if wanted.perspective else 1.0
            shares /= shares.sum(axis=-1, keepdims=True)
            shares = np.where(wanted.shaded_at_samples[:, None], weights, shares)
        color = np.einsum("pfc,fcd->pfd", shares, values)
    color[..., :3] = np.where(present[..., None], color[..., :3], 0.0)
    if wanted.features.materials:
        texels = linear(np.array(TEXELS[: len(wanted.faces)]) / 255)
        color[..., :3] = srgb(color[..., :3] * texels)
    if wanted.features.lights:
        at = np.repeat(np.stack([x, y], axis=-1)[:, None], len(values), axis=1)
        away = distance
        if pattern.down is not None:
            centres = np.stack(_centres(size, pattern), axis=-1)[:, None]
            inverse = barycentric(*_centres(size, pattern))[0]
            inverse = inverse / corner_distance if wanted.perspective else inverse * corner_distance
            with np.errstate(divide="ignore"):
                there = inverse.sum(axis=-1) ** (-1 if wanted.perspective else 1)
            nearest, farthest = corner_distance.min(axis=1), corner_distance.max(axis=1)
            there = np.where(there > 0, np.clip(there, nearest, farthest), farthest)  # beyond infinity it is negative
            at = np.where(wanted.shaded_at_samples[:, None], at, centres)
            away = np.where(wanted.shaded_at_samples, away, there)
        away = np.where(present, away, 1.0)[..., None]
        ray = at / (HEIGHT / 2)
        color = _under_lights(wanted, color, np.append(ray * away if wanted.perspective else ray, -away, axis=-1))
    opaque = present & bool(opaque_first) & (values[..., 3] == 1).all(axis=1)
    light = np.broadcast_to(_light(wanted), present.shape)
    surface = color[..., :3].copy()
    color[..., :3] *= light[..., None]
    if wanted.features.linear and not wanted.features.lights:
        surface, color[..., :3] = linear(surface), linear(color[..., :3])

    order = np.argsort(np.where(present, np.round(distance / LEAST_APART), np.inf), axis=1, kind="stable")

    def ordered(values: NDArray[Any]) -> NDArray[Any]:
        return np.take_along_axis(values, order.reshape(*order.shape, *[1] * (values.ndim - 2)), axis=1)

    opaque = ordered(opaque)
    seen = np.cumsum(opaque, axis=1) - opaque == 0  # not behind an opaque one
    here = ordered(present) & seen
    back = np.broadcast_to(areas < 0, present.shape)
    return Stack(
        here,
        ordered(color) * here[..., None],
        ordered(light),
        ordered(surface),
        np.round(ordered(distance) / LEAST_APART) * LEAST_APART,
        ordered(back),
        opaque & here,
        order,
    )


KNOWN_EMISSIVE = (0.125, 0.0625, 0.25)
"""The light of materials with maps, whose texels are all alike, and say what a surface without maps is."""


def known_finish(minify: Minify) -> Finish:
    """A finish with maps that leave a surface as it is, but for its emissive light."""

    def alike(red: float, green: float, blue: float) -> Texture:
        return Texture(np.full((2, 2, 4), (red, green, blue, 1.0), np.float32), minify=minify)

    return Finish(
        metallic=1.0,
        roughness=2 * MATT.roughness,
        emissive=(2 * KNOWN_EMISSIVE[0], 4 * KNOWN_EMISSIVE[1], KNOWN_EMISSIVE[2]),
        metallic_roughness_texture=alike(0.0, 0.5, MATT.metallic),
        normal_texture=alike(0.5, 0.5, 1.0),
        occlusion_texture=alike(1.0, 0.0, 0.0),
        emissive_texture=alike(0.5, 0.25, 1.0),
    )


def _under_lights(wanted: Wanted, color: Floats, place: Floats) -> Floats:
    """The colours of faces [samples, faces, 4] under lights. place: in the camera's space, [samples, faces, 3]."""
    corners = wanted.scene().vertices.reshape(-1, 3, 3)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where((normals * place).sum(axis=-1, keepdims=True) > 0, -normals, normals)
    eye = np.array([wanted.offset, wanted.offset, 0.0])
    lights = KIT
    if wanted.features.positioned:
        lights = tuple(
            replace(light, position=tuple(np.array(light.position) - eye)) if isinstance(light, PointLight) else light
            for light in KNOWN_LIGHTS
        )
    finish = replace(MATT, emissive=KNOWN_EMISSIVE) if wanted.features.maps else MATT
    base, highlight = under_lights(linear(color[..., :3]), normals, place, lights, finish, wanted.perspective)
    shown, plain = np.minimum(base + highlight, 1.0), np.minimum(base, 1.0)
    if not wanted.features.linear:
        shown, plain = srgb(shown), srgb(plain)
    if not wanted.features.full_highlights:
        return np.append(shown, color[..., 3:], axis=-1)
    return np.concatenate(covering(shown, plain, color[..., 3:]), axis=-1)


def _light(wanted: Wanted) -> Floats:
    """The headlight's share of each face's colour: float64 [faces]."""
    if not wanted.features.headlight:
        return np.ones(len(wanted.faces))
    corners = wanted.scene().vertices.reshape(-1, 3, 3)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return AMBIENT + (1 - AMBIENT) * np.abs(normals[:, 2]) / np.linalg.norm(normals, axis=1)


# --- what techniques show of it ---------------------------------------------------------------------------------------

Maps = Mapping[str, Floats]
Shown = tuple[Floats, Maps]
"""Premultiplied colours with transmittances, float64 [samples, 4], and maps by name, [samples].

Where a technique makes its picture on the host from a map, the colours have no meaning, and are None.
"""


def over(front: Floats, behind: Floats) -> Floats:
    """A front layer over what is behind it; both premultiplied, with transmittances: [..., 4]."""
    through = front[..., 3:]
    return np.concatenate([front[..., :3] + through * behind[..., :3], through * behind[..., 3:]], axis=-1)


def blended(stack: Stack, kept: NDArray[np.bool_], behind: Floats | None = None) -> Floats:
    """The kept layers blended in order, over `behind` or what is opaque: C = Ai Ci + (1 - Ai) C, the farthest first."""
    color = stack.behind if behind is None else behind
    for k in reversed(range(kept.shape[1])):
        alpha = np.where(kept[:, k], stack.color[:, k, 3], 0.0)[:, None]
        color = over(np.concatenate([alpha * stack.color[:, k, :3], 1 - alpha], axis=1), color)
    return color


def peeled(stack: Stack, technique: AnyTechnique, options: Options) -> NDArray[np.bool_]:
    """Which layers a technique that sorts takes: so many from the front, and so many from the back."""
    kept = peelable(stack, options)
    front, back = technique.peeled(options) or (0, 0)
    from_front = np.cumsum(kept, axis=1)
    from_back = from_front[:, -1:] - from_front + 1
    return kept & ((from_front <= front) | (from_back <= back))


def peelable(stack: Stack, options: Options) -> NDArray[np.bool_]:
    """Which layers there are to peel: all that are transparent, or the first of each distance."""
    first_alone = getattr(options, "coincident", "keep") == "paper"
    return stack.transparent & ~stack.coincident if first_alone else stack.transparent


def lost(stack: Stack, technique: AnyTechnique, options: Options) -> Floats:
    """The transmittance in front of the first layer that no pass reaches, or 0 where there is none: [samples]."""
    there = peelable(stack, options)
    missed = there & ~peeled(stack, technique, options)
    before = np.cumsum(missed, axis=1) == 0
    through = np.where(there & before, 1 - stack.color[..., 3], 1.0).prod(axis=1)
    return np.where(missed.any(axis=1), through, 0.0)


def in_order(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """What a technique shows that sorts."""
    return blended(stack, peeled(stack, technique, options)), {}


def _sums(stack: Stack, options: Options, of: NDArray[np.bool_] | None = None) -> tuple[Floats, Floats, Floats]:
    """sum(Ai Ci) [samples, 3], sum(Ai) and n [samples, 1] of transparent fragments. 8 bits hold sums up to 1."""
    of = stack.transparent if of is None else of
    alpha = np.where(of, stack.color[..., 3], 0.0)
    colors, alphas = (alpha[..., None] * stack.color[..., :3]).sum(axis=1), alpha.sum(axis=1, keepdims=True)
    if getattr(options, "precision", "") == "unorm8":
        colors, alphas = np.minimum(colors, 1.0), np.minimum(alphas, 1.0)
    return colors, alphas, of.sum(axis=1, keepdims=True)


def weighted_sum(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """sum(Ai Ci) + C0 (1 - sum(Ai)) (Meshkin 2007)."""
    colors, alphas, _ = _sums(stack, options)
    return over(np.concatenate([colors, 1 - alphas], axis=1), stack.behind), {}


def weighted_average(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """C A (1 - (1 - A)^n) / A + C0 (1 - A)^n with the average colour C and alpha A (Bavoil and Myers 2008)."""
    return over(_average(*_sums(stack, options)), stack.behind), {}


def _average(colors: Floats, alphas: Floats, n: Floats) -> Floats:
    """The layer that stands for n of the average colour and alpha, from their sums: [samples, 4]."""
    through = (1 - alphas / np.maximum(n, 1)) ** n
    share = np.divide(1 - through, alphas, out=np.zeros_like(alphas), where=alphas > 0)
    return np.concatenate([colors * share, through], axis=1)


def k_buffer(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """The nearest or the first k layers in order, over the weighted average of the others (Maule et al. 2013)."""
    there, k = stack.transparent, getattr(options, "kept_layers", 8)
    place = stack.face if getattr(options, "kept_by", "depth") == "arrival" else np.arange(there.shape[1])[None]
    kept = there & ((there[:, None] & (place[:, None] < place[..., None])).sum(axis=2) < k)
    rest = there & ~kept & (getattr(options, "tail", "") != "none")
    return blended(stack, kept, over(_average(*_sums(stack, options, rest)), stack.behind)), {}


def weighted_blended(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """sum(Ai Ci wi) / sum(Ai wi) (1 - R) + C0 R, R the product of all 1 - Ai (McGuire and Bavoil 2013, equation 6)."""
    alpha = np.where(stack.transparent, stack.color[..., 3], 0.0)
    z = np.where(stack.present, stack.distance, NEAR)
    near = {
        "7": lambda: 10 / (1e-5 + (z / 5) ** 2 + (z / 200) ** 6),
        "8": lambda: 10 / (1e-5 + (z / 10) ** 3 + (z / 200) ** 6),
        "9": lambda: 0.03 / (1e-5 + (z / 200) ** 4),
        "10": lambda: 3e3 * (1 - _window_depth(z, wanted.perspective)) ** 3,
    }[getattr(options, "weight", "10")]()
    weight = alpha * alpha * np.maximum(np.minimum(near, 3e3), 1e-2)
    through, total = (1 - alpha).prod(axis=1, keepdims=True), weight.sum(axis=1, keepdims=True)
    colors = (weight[..., None] * stack.color[..., :3]).sum(axis=1)
    mean = np.divide(colors, total, out=np.zeros_like(colors), where=total > 0)
    return over(np.concatenate([mean * (1 - through), through], axis=1), stack.behind), {}


def wavelet(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """sum(wi Ci) / sum(wi) (1 - R) + C0 R with wi = Ai e^-A(xi) (Aizenshtein, Smal and McGuire 2022).

    A(x) is the sum of the absorbances before x, as Haar wavelets give it, linear from the end of a cell to that of the
    next. 8 bits hold sums up to 1.
    """
    cells, most = 2 ** (getattr(options, "wavelet_rank", 3) + 1), np.inf
    if getattr(options, "precision", "") == "unorm8":
        most = 1.0
    alpha = np.where(stack.transparent, stack.color[..., 3], 0.0)
    absorbed = -np.log(np.maximum(1 - alpha, 2.0**-17))
    first, end = wavelet_range(stack, options)
    x = np.clip((stack.distance - first) / np.where(end > first, end - first, np.inf), 0, 1) * (cells - 1)
    x = np.where(stack.transparent, x, 0.0)
    means = np.minimum((absorbed * (1 - x / cells)).sum(axis=1, keepdims=True), most)
    while (size := means.shape[1]) < cells:
        off = np.abs(x[..., None] * size / cells - np.arange(size) - 0.5)
        share = np.minimum((absorbed[..., None] * np.maximum(0.5 - off, 0)).sum(axis=1), most)
        means = np.stack([means - share, means + share], axis=-1).reshape(len(x), 2 * size)
    before = np.pad(means, ((0, 0), (1, 0)))  # nothing is absorbed before the first cell
    at = np.floor(x).astype(int)
    here, there = np.take_along_axis(before, at, axis=1), np.take_along_axis(before, at + 1, axis=1)
    front = here + (there - here) * (x - at) - absorbed * (x - at) * (1 - (x - at))  # without the layer's own
    weight = np.minimum(alpha * np.exp(-np.clip(front, 0, 60)), most)
    through, total = (1 - alpha).prod(axis=1, keepdims=True), np.minimum(weight.sum(axis=1, keepdims=True), most)
    colors = np.minimum((weight[..., None] * stack.color[..., :3]).sum(axis=1), most)
    mean = np.divide(colors, total, out=np.zeros_like(colors), where=total > 0)
    return over(np.concatenate([mean * (1 - through), through], axis=1), stack.behind), {}


def wavelet_range(stack: Stack, options: Options) -> tuple[Floats, Floats]:
    """The distances where wavelets begin and end, [samples, 1] each. Where there is no layer, they mean nothing."""
    if getattr(options, "wavelet_range", "pixel") == "scene":
        return np.full((len(stack.distance), 1), NEAR), np.full((len(stack.distance), 1), FAR)
    first = np.where(stack.transparent, stack.distance, FAR).min(axis=1, keepdims=True)
    return first, np.where(stack.transparent, stack.distance, NEAR).max(axis=1, keepdims=True)


def _as_submitted(stack: Stack) -> Iterator[tuple[NDArray[np.int64], NDArray[np.bool_]]]:
    """For one face after the other: its place in the order of each sample, [samples, 1], and whether it is there."""
    for face in range(len(stack.face[0])):
        there = stack.transparent & (stack.face == face)
        yield np.argmax(there, axis=1)[:, None], there.any(axis=1, keepdims=True)


def multi_layer_alpha_blending(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """Layers (Ai Ci, 1 - Ai, zi), of which the two farthest are blended where there are too many (Salvi 2014)."""
    count, slots = len(stack.present), getattr(options, "slots", 4)
    place, layers = np.full((count, slots), np.inf), np.tile((0.0, 0.0, 0.0, 1.0), (count, slots, 1))
    for k, there in _as_submitted(stack):
        *color, alpha = np.moveaxis(np.take_along_axis(stack.color, k[..., None], axis=1), -1, 0)
        new = np.stack([*(alpha * channel for channel in color), 1 - alpha], axis=-1)
        new = np.where(there[..., None], new, (0.0, 0.0, 0.0, 1.0))
        place = np.append(place, np.where(there, k, np.inf), axis=1)
        order = np.argsort(place, axis=1, kind="stable")
        place = np.take_along_axis(place, order, axis=1)[:, :-1]
        layers = np.take_along_axis(np.append(layers, new, axis=1), order[..., None], axis=1)
        layers = np.append(layers[:, :-2], over(layers[:, -2], layers[:, -1])[:, None], axis=1)
    shown = stack.behind
    for slot in reversed(range(slots)):
        shown = over(layers[:, slot], shown)
    return shown, {}


def adaptive(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """sum(Ci Ai vis(zi)), vis being a curve of some steps, of which the least area is lost (Salvi et al. 2011)."""
    place, through, _ = compressed(stack, options)
    order = np.arange(stack.present.shape[1])
    seen = np.where(place[:, None] < order[:, None], through[:, None], 1.0).min(axis=2)
    alpha = np.where(stack.transparent, stack.color[..., 3], 0.0)
    colors = ((seen * alpha)[..., None] * stack.color[..., :3]).sum(axis=1)
    front = np.concatenate([colors, (1 - alpha).prod(axis=1, keepdims=True)], axis=1)
    return over(front, stack.behind), {}


def compressed(stack: Stack, options: Options) -> tuple[Floats, Floats, Floats]:
    """The curve of visibility of `adaptive`: places of its steps, and what comes through behind them, [samples, nodes].

    A place is that in the order of a sample's layers, or infinity if there is no step. Also returns by how much more
    area any other step would have lost, [samples]; infinity where none had to go.
    """
    count, nodes = len(stack.present), getattr(options, "nodes", 8)
    place, distance, through = np.full((count, nodes), np.inf), np.zeros((count, nodes)), np.ones((count, nodes))
    clear = np.full(count, np.inf)
    for k, there in _as_submitted(stack):
        left = 1 - np.take_along_axis(stack.color[..., 3], k, axis=1) * there
        before = np.where(place < k, through, 1.0).min(axis=1, keepdims=True)
        through = np.append(np.where(place > k, through * left, through), before * left, axis=1)
        distance = np.append(distance, np.take_along_axis(stack.distance, k, axis=1), axis=1)
        place = np.append(place, np.where(there, k, np.inf), axis=1)
        order = np.argsort(place, axis=1, kind="stable")
        place, distance, through = (np.take_along_axis(each, order, axis=1) for each in (place, distance, through))
        full = np.isfinite(place[:, -1])
        with np.errstate(invalid="ignore"):
            area = -np.diff(distance[:, :-1], axis=1) * np.diff(through[:, :-1], axis=1)
        area = np.where(full[:, None], area, 0.0)
        least, second = np.moveaxis(np.sort(area, axis=1)[:, :2], 1, 0)
        clear = np.where(full, np.minimum(clear, second - least), clear)
        away = np.where(full, np.argmin(area, axis=1) + 1, nodes)
        through[full, away[full] - 1] = through[full, away[full]]
        kept = np.arange(nodes + 1) != away[:, None]
        place, distance, through = (each[kept].reshape(count, nodes) for each in (place, distance, through))
    return place, through, clear


def masks(stack: Stack, options: Options) -> Masks:
    """The masks of transparent fragments. Samples are in HEIGHT rows."""
    alpha = np.where(stack.transparent, stack.color[..., 3], 0.0)
    return masks_of(alpha, len(alpha) // HEIGHT, getattr(options, "stochastic_samples", 8))


def stochastic(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """sum(vi Ai Ci), by the shares vi of masks that are visible (Enderton et al. 2010), and what is left of them.

    With alpha correction it is times (1 - T) / sum(vi Ai), and T is the product of all 1 - Ai.
    """
    alpha, known = np.where(stack.transparent, stack.color[..., 3], 0.0), masks(stack, options)
    seen = (known.visible * alpha)[..., None]
    colors, total, through = (seen * stack.color[..., :3]).sum(axis=1), seen.sum(axis=1), known.left[:, None]
    if getattr(options, "alpha_correction", True):
        through = (1 - alpha).prod(axis=1, keepdims=True)
        colors *= np.divide(1 - through, total, out=np.zeros_like(total), where=total > 0)
    return over(np.concatenate([colors, through], axis=1), stack.behind), {}


def moments(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """sum(Ai Ti Ci) / sum(Ai Ti) (1 - R) + C0 R with Ti from moments (Muenstermann et al. 2018, equation 2)."""
    assert isinstance(options, MomentsOptions)
    alpha = np.where(stack.transparent, stack.color[..., 3], 0.0)
    z = np.where(stack.present, stack.distance, FAR)
    place = np.log(z / NEAR) / np.log(FAR / NEAR) if wanted.perspective else (z - NEAR) / (FAR - NEAR)
    seen, through = seen_of(alpha, 2 * place - 1, options)
    weight = alpha * seen
    colors, total = (weight[..., None] * stack.color[..., :3]).sum(axis=1), weight.sum(axis=1, keepdims=True)
    if options.precision == "unorm8":
        colors, total = np.minimum(colors, 1.0), np.minimum(total, 1.0)
    mean = np.divide(colors, total, out=np.zeros_like(colors), where=total > 0)
    return over(np.concatenate([mean * (1 - through), through], axis=1), stack.behind), {}


def layer_count(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """How many fragments a sample has."""
    return np.empty((0, 4)), {"layer_count": stack.present.sum(axis=1).astype(np.float64)}


def thickness(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """How far the ray runs within surfaces, by the option `variant`, in scene units or window depths."""
    lengths, unpaired = _lengths(stack, wanted, options)
    return np.empty((0, 4)), {"thickness": lengths, "unpaired": unpaired.astype(np.float64)}


def translucency(stack: Stack, wanted: Wanted, technique: AnyTechnique, options: Options) -> Shown:
    """F + (1 - F) light S exp(-extinction thickness), with S and F of the foremost fragment (translucency.cl)."""
    lengths, unpaired = _lengths(stack, wanted, options)
    low, high = wanted.scene().bounds
    through = np.exp(-OPTICAL_DIAGONAL / np.linalg.norm(high - low) * lengths)[:, None]
    surface, behind = stack.surface[:, 0], np.array(LIGHT_COLOR)
    if wanted.features.linear:
        behind = linear(behind)
    reflected = REFLECTANCE * stack.light[:, :1] * surface
    lit = reflected + (1 - reflected) * surface * behind * through
    color = np.concatenate([lit, np.zeros_like(through)], axis=1)
    shown = np.where(stack.present[:, :1], color, (0.0, 0.0, 0.0, 1.0))
    return shown, {"thickness": lengths, "unpaired": unpaired.astype(np.float64)}


def _window_depth(distance: Floats, perspective: bool) -> Floats:
    """OpenGL's window depth of what is at this distance: 0 at the near plane, 1 at the far one."""
    return FAR / (FAR - NEAR) * (1 - NEAR / distance) if perspective else (distance - NEAR) / (FAR - NEAR)


def _lengths(stack: Stack, wanted: Wanted, options: Options) -> tuple[Floats, NDArray[np.bool_]]:
    """The length of each sample, and whether its crossings do not pair up."""
    variant, present = getattr(options, "variant", "exact"), stack.present
    distance = stack.distance
    if getattr(options, "projected", False):
        distance = _window_depth(distance, wanted.perspective)
    distance = np.where(present, distance, 0.0)
    any_there, no = present.any(axis=1), np.zeros(len(present), bool)
    if variant == "total":
        last = np.take_along_axis(distance, np.maximum(present.sum(axis=1) - 1, 0)[:, None], axis=1)[:, 0]
        return np.where(any_there, last - distance[:, 0], 0.0), no
    if variant == "first-solid":
        entries, exits = (np.where(present & side, distance, np.inf).min(axis=1) for side in (~stack.back, stack.back))
        paired = np.isfinite(entries) & np.isfinite(exits) & (entries <= exits)
        with np.errstate(invalid="ignore"):
            return np.where(paired, exits - entries, 0.0), any_there & ~paired
    winding = np.cumsum(np.where(present, np.where(stack.back, -1, 1), 0), axis=1)
    steps = np.where(present[:, 1:] & (winding[:, :-1] != 0), np.diff(distance, axis=1), 0.0)
    return steps.sum(axis=1), winding[:, -1] != 0


SHOWN: dict[str, Callable[[Stack, Wanted, AnyTechnique, Options], Shown]] = {
    **{name: in_order for name, technique in TECHNIQUES.items() if technique.sorts},
    "weighted-sum": weighted_sum,
    "weighted-average": weighted_average,
    "weighted-blended": weighted_blended,
    "k-buffer": k_buffer,
    "wavelet": wavelet,
    "multi-layer-alpha-blending": multi_layer_alpha_blending,
    "adaptive": adaptive,
    "stochastic": stochastic,
    "moments": moments,
    "layer-count": layer_count,
    "thickness": thickness,
    "translucency": translucency,
}
"""What each technique shows of a stack. One that sorts needs no entry of its own."""
