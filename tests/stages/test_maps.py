"""Maps of surfaces in pictures: each against the same surface without it, whose numbers say what its texels say."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import plainly
import pytest
from numpy.typing import NDArray
from reading.documents import png
from reading.test_gltf_finish import BLUE, lit
from twins import textured

import clpeel
from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.images import LateImage
from clpeel.scene.lights import AmbientLight, DirectionalLight, PointLight
from clpeel.scene.materials import Finish, Material
from clpeel.scene.scene import Scene
from clpeel.scene.tangents import tangents_of
from clpeel.scene.textures import Texture
from clpeel.stages import shading
from clpeel.stages.shading import readable

pytestmark = pytest.mark.usefixtures("shared_devices")

SIDE = 4
AMBIENT = AmbientLight(sky=(0.3, 0.2, 0.1), ground=(0.1, 0.2, 0.2))
SUN = DirectionalLight(direction=(0.6, -0.5, -1), color=(1, 0.9, 0.8), intensity=2.0)
LIGHTS = (
    AMBIENT,
    SUN,
    PointLight(position=(-0.5, 0.7, 1.5), color=(0.2, 0.4, 1), intensity=1.0),
    DirectionalLight(direction=(0.5, -0.6, 1), intensity=2.0),  # for what is seen from behind
)
UPRIGHT = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float64)
"""Texture coordinates of the quad's corners where the image stands upright."""

SAME = 4e-6
"""How far a shown value, 0..1, may be off where the same is computed from texels and from vertices: sRGB is steep in
the dark, where a rounding of light counts for 13."""

Floats = NDArray[np.float64]


def turned(vectors: Any, turn: float) -> Floats:
    """Vectors turned about y, and then tilted about x by a third of that."""
    a, b = math.radians(turn), math.radians(turn / 3)
    about_y = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    about_x = np.array([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]])
    return np.asarray(vectors, float) @ (about_x @ about_y).T


def quad(
    finish: Finish, *, uv: Any = UPRIGHT, more_uv: Any = (), normal: Any = None, turn: float = 20.0, **material: Any
) -> Scene:
    """A quad that fills the picture. normal: at all of its vertices, before it is turned; by default its own."""
    corners = turned([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], turn)
    return Scene.from_arrays(
        corners,
        [(0, 1, 2), (0, 2, 3)],
        materials=[Material(finish=finish, **({"base_color": (0.5, 0.3, 0.2, 1.0)} | material))],
        uv=uv,
        more_uv=more_uv,
        lights=LIGHTS,
        vertex_normals=None if normal is None else np.tile(turned(normal, turn), (4, 1)),
    )


def drawn(scene: Scene, *, behind: bool = False, lanes: int = 1, **options: Any) -> NDArray[np.float32]:
    """The picture's colours, float32 [SIDE, SIDE, 3], from +z, or from behind the quad."""
    camera = clpeel.Camera((0, 0, -3.0 if behind else 3.0), (0, 0, 0), view_angle=40)
    renderer = plainly.Renderer(scene, lanes=lanes)
    return renderer.render(camera, (SIDE, SIDE), lighting="scene", background=None, **options).color[..., :3]


def constant(*values: float) -> Texture:
    """A texture of floats that is the same everywhere: red, green and blue."""
    return Texture(np.array([[[*values, 1.0]]], np.float32), minify="linear")


def bump(normal: Any) -> Texture:
    """A texture of floats with this direction in the space of tangents everywhere."""
    return constant(*(np.asarray(normal, float) / np.linalg.norm(normal) / 2 + 0.5))


def differ(one: Any, other: Any) -> bool:
    """Whether two pictures are plainly not the same, so that comparing them means something."""
    return bool(np.abs(one - other).max() > 0.02)


# --- normals ----------------------------------------------------------------------------------------------------------

# Along which way u grows and against which v grows, where the image lies on the quad: glTF's tangent and bitangent.
LIES = {
    "upright": (UPRIGHT, (1, 0, 0), (0, 1, 0)),
    "a quarter to the left": (np.roll(UPRIGHT, 1, axis=0), (0, 1, 0), (-1, 0, 0)),
    "half": (np.roll(UPRIGHT, 2, axis=0), (-1, 0, 0), (0, -1, 0)),
    "mirrored along u": (UPRIGHT * [-1, 1], (-1, 0, 0), (0, 1, 0)),
    "mirrored along v": (UPRIGHT * [1, -1], (1, 0, 0), (0, -1, 0)),
    "repeated": (UPRIGHT * [7, 3], (1, 0, 0), (0, 1, 0)),
}


@pytest.mark.parametrize("behind", [False, True])
@pytest.mark.parametrize("lies", LIES)
@pytest.mark.parametrize("texel", [(0.5, 0.1, 0.8), (-0.1, 0.6, 0.7)])
def test_a_normal_map_is_as_tilted_normals_of_vertices(texel: Any, lies: str, behind: bool, lanes: int) -> None:
    uv, tangent, bitangent = LIES[lies]
    tilted = np.array(texel) @ [tangent, bitangent, (0, 0, 1)]
    got = drawn(quad(Finish(0.2, 0.4, normal_texture=bump(texel)), uv=uv), behind=behind, lanes=lanes)
    want = drawn(quad(Finish(0.2, 0.4), normal=tilted), behind=behind, lanes=lanes)
    np.testing.assert_allclose(got, want, atol=SAME)
    assert differ(want, drawn(quad(Finish(0.2, 0.4)), behind=behind, lanes=lanes))
    assert differ(want, drawn(quad(Finish(0.2, 0.4), normal=tilted * [-1, -1, 1]), behind=behind, lanes=lanes))


@pytest.mark.parametrize("winding", [False, True])
def test_the_order_of_corners_matters_to_no_normal_map(winding: bool) -> None:
    """A face that is wound the other way is seen from behind: its own normal and what the map does to it are turned."""
    scene = quad(Finish(0.2, 0.4, normal_texture=bump((0.5, 0.1, 0.8))))
    want = quad(Finish(0.2, 0.4), normal=(0.5, 0.1, 0.8))
    if winding:
        scene, want = (replace(each, faces=each.faces[:, ::-1].copy()) for each in (scene, want))
        # The front is on the other side now, where the map's normals are: so its third axis, and no other, is turned.
        want = replace(want, vertex_normals=np.tile(turned((0.5, 0.1, -0.8), 20), (4, 1)).astype(np.float32))
    np.testing.assert_allclose(drawn(scene), drawn(want), atol=SAME)


def test_green_points_up_in_the_image() -> None:
    """Light from above makes what leans up brighter."""
    above = (DirectionalLight(direction=(0, -1, -1), intensity=2.0),)
    up, down = (replace(quad(Finish(0, 1, normal_texture=bump((0, y, 1))), turn=0), lights=above) for y in (0.5, -0.5))
    assert (drawn(up) > drawn(down) + 0.1).all()


def test_the_scale_counts_for_red_and_green(lanes: int) -> None:
    for scale in (0.5, -1.5, 0.0):
        got = drawn(quad(Finish(0.2, 0.4, normal_scale=scale, normal_texture=bump((0.4, 0.2, 0.6)))), lanes=lanes)
        want = drawn(quad(Finish(0.2, 0.4), normal=(0.4 * scale, 0.2 * scale, 0.6)), lanes=lanes)
        np.testing.assert_allclose(got, want, atol=SAME)


def test_maps_bend_the_normals_of_vertices() -> None:
    """The tangent is what is left of the direction of u beside the vertex normal (glTF 2.0, section 3.9.3)."""
    n = np.array([0.3, -0.2, 0.9]) / math.sqrt(0.94)
    t = np.array([1, 0, 0]) - n[0] * n
    t /= np.linalg.norm(t)
    b = np.cross(n, t)
    texel = (0.3, 0.4, 0.8)
    got = drawn(quad(Finish(0.2, 0.4, normal_texture=bump(texel)), normal=n))
    np.testing.assert_allclose(got, drawn(quad(Finish(0.2, 0.4), normal=np.array(texel) @ [t, b, n])), atol=SAME)


def test_tangents_vary_over_a_face(lanes: int) -> None:
    """They are those of the vertices, by each pixel's shares of them. The faces around the one in view bend them."""
    points = [(-20, -20, 0), (20, -20, 0), (0, 20, 0), (0, -60, 0), (60, 20, 0), (-60, 20, 0)]
    uv = [(0, 1), (1, 0.7), (0.3, 0), (2, 1.5), (1.5, -3), (-1, -2)]
    texel, base = (0.5, 0.1, 0.8), {"base_color": (0.5, 0.3, 0.2, 1.0)}
    scene = Scene.from_arrays(
        points,
        [(0, 1, 2), (1, 0, 3), (2, 1, 4), (0, 2, 5)],
        materials=[Material(finish=Finish(0.2, 0.4, normal_texture=bump(texel)), **base)],  # type: ignore[arg-type]
        uv=uv,
        lights=LIGHTS,
    )
    tangents = tangents_of(scene)[:3].astype(float)
    assert (tangents @ tangents.T).min() < 0.9, "they are plainly not all alike"
    got = drawn(scene, lanes=lanes)
    half = 3 * math.tan(math.radians(20))
    for row in range(SIDE):
        for column in range(SIDE):
            x, y = (2 * column + 1 - SIDE) / SIDE * half, (SIDE - 1 - 2 * row) / SIDE * half
            share = np.linalg.solve(np.vstack([np.array(points[:3]).T[:2], np.ones(3)]), [x, y, 1])
            tangent = share @ tangents
            tangent /= np.linalg.norm(tangent)
            bitangent = np.cross((0, 0, 1), tangent)  # as the image is not mirrored on the face in view
            normal = np.array(texel) @ [tangent, bitangent, (0, 0, 1)]
            want = drawn(quad(Finish(0.2, 0.4), normal=normal, turn=0), lanes=lanes)
            np.testing.assert_allclose(got[row, column], want[row, column], atol=SAME)


def test_each_texel_counts_where_it_lies(lanes: int) -> None:
    """Four texels on a quad that just fills the picture: each quarter is as if its texel were everywhere."""
    rng = np.random.default_rng(5)
    image = rng.uniform(0.2, 0.8, (2, 2, 4)).astype(np.float32)
    image[..., 2:] = 0.9
    half = 3 * math.tan(math.radians(20)) / 9
    uv = 0.5 + (UPRIGHT - 0.5) / half

    def surface(texels: Any) -> Finish:
        texture = Texture(np.ascontiguousarray(texels), ("clamp", "clamp"), "nearest", "nearest")
        return Finish(0.8, 0.9, normal_texture=texture, metallic_roughness_texture=texture, occlusion_texture=texture)

    got = drawn(quad(surface(image), uv=uv, turn=0), lanes=lanes)
    for row in range(2):
        for column in range(2):
            rows, columns = slice(2 * row, 2 * row + 2), slice(2 * column, 2 * column + 2)
            want = drawn(quad(surface(image[row : row + 1, column : column + 1]), uv=uv, turn=0), lanes=lanes)
            np.testing.assert_allclose(got[rows, columns], want[rows, columns], atol=1e-6)


# --- numbers ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("texel", [(0.1, 0.6, 0.7), (1.0, 1.0, 0.0), (0.5, 0.3, 1.0)])
def test_a_metallic_roughness_map_multiplies_its_factors(texel: Any, lanes: int) -> None:
    """Green is roughness and blue is metallic. Red is left to others."""
    got = drawn(quad(Finish(0.9, 0.8, metallic_roughness_texture=constant(*texel))), lanes=lanes)
    texel = np.float32(texel).astype(float)
    want = drawn(quad(Finish(0.9 * texel[2], 0.8 * texel[1])), lanes=lanes)
    np.testing.assert_allclose(got, want, atol=SAME)


def test_a_map_of_no_roughness_is_as_smooth_as_a_factor_of_none() -> None:
    got = drawn(quad(Finish(0.9, 0.8, metallic_roughness_texture=constant(0, 0, 1))))
    np.testing.assert_allclose(got, drawn(quad(Finish(0.9, 0.0))), atol=SAME)
    assert np.isfinite(got).all()


@pytest.mark.parametrize("strength", [0.0, 0.4, 1.0])
def test_an_occlusion_map_dims_light_from_all_around_alone(strength: float, lanes: int) -> None:
    finish = Finish(0.3, 0.5, occlusion_strength=strength, occlusion_texture=constant(0.25, 1, 1))
    left = 1 + strength * (0.25 - 1)
    dimmed = replace(quad(Finish(0.3, 0.5)), lights=(replace(AMBIENT, intensity=left), *LIGHTS[1:]))
    np.testing.assert_allclose(drawn(quad(finish), lanes=lanes), drawn(dimmed, lanes=lanes), atol=SAME)
    lamps = {"lights": LIGHTS[1:]}
    np.testing.assert_allclose(
        drawn(replace(quad(finish), **lamps)), drawn(replace(quad(Finish(0.3, 0.5)), **lamps)), atol=SAME
    )


def test_an_emissive_map_multiplies_its_factor(lanes: int) -> None:
    texel = (0.2, 0.5, 0.25)
    got = drawn(quad(Finish(0.3, 0.5, (0.4, 0.8, 0.1), emissive_texture=constant(*texel))), lanes=lanes)
    want = drawn(quad(Finish(0.3, 0.5, (0.08, 0.4, 0.025))), lanes=lanes)
    np.testing.assert_allclose(got, want, atol=SAME)
    assert differ(want, drawn(quad(Finish(0.3, 0.5)), lanes=lanes))


def test_a_base_color_texture_may_lie_beside_maps(lanes: int) -> None:
    """Its texels are colours: 188 is a light of 0.5029."""
    image = np.array([[[188, 188, 188, 255]]], np.uint8)
    light = ((188 / 255 + 0.055) / 1.055) ** 2.4
    finish = Finish(0.8, 0.9, metallic_roughness_texture=constant(1, 0.5, 0.5))
    got = drawn(quad(finish, texture=Texture(image, minify="linear")), lanes=lanes)
    want = drawn(quad(Finish(0.4, 0.45), base_color=(0.5 * light, 0.3 * light, 0.2 * light, 1)), lanes=lanes)
    np.testing.assert_allclose(got, want, atol=SAME)


def test_unlit_materials_have_no_maps() -> None:
    finish = Finish(0.3, 0.5, (1, 1, 1), normal_texture=bump((0.5, 0, 1)), emissive_texture=constant(1, 1, 1))
    got, want = drawn(quad(finish, unlit=True)), drawn(quad(Finish(), unlit=True))
    np.testing.assert_array_equal(got, want)


# --- texels -----------------------------------------------------------------------------------------------------------


def coded(bytes_: tuple[int, int, int], floats: bool, minify: Any = "linear") -> Texture:
    """A texture of 8 bits, 3 x 2, or of the same numbers as floats."""
    image = np.broadcast_to(np.array([*bytes_, 255], np.uint8), (2, 3, 4)).copy()
    return Texture((image / np.float32(255)) if floats else image, minify=minify)


@pytest.mark.parametrize("most", [1 << 28, 0], ids=["floats", "bytes"])
@pytest.mark.parametrize("minify", ["linear", "linear-mipmap-linear"])
def test_texels_of_8_bits_are_numbers(most: int, minify: Any, lanes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As sRGB, 128 would be 0.216. It is 0.502, however the texels are stored."""
    monkeypatch.setattr(shading, "MOST_FLOAT_BYTES", most)
    level = 128 / 255
    rough = drawn(quad(Finish(0.9, 0.8, metallic_roughness_texture=coded((0, 128, 64), False, minify))), lanes=lanes)
    np.testing.assert_allclose(rough, drawn(quad(Finish(0.9 * 64 / 255, 0.8 * level)), lanes=lanes), atol=SAME)
    dim = drawn(quad(Finish(0.3, 0.5, occlusion_texture=coded((128, 0, 0), False, minify))), lanes=lanes)
    dimmed = replace(quad(Finish(0.3, 0.5)), lights=(replace(AMBIENT, intensity=level), *LIGHTS[1:]))
    np.testing.assert_allclose(dim, drawn(dimmed, lanes=lanes), atol=SAME)
    bent = drawn(quad(Finish(0.3, 0.5, normal_texture=coded((192, 64, 230), False, minify))), lanes=lanes)
    tilted = np.array([192, 64, 230]) / 255 * 2 - 1
    np.testing.assert_allclose(bent, drawn(quad(Finish(0.3, 0.5), normal=tilted), lanes=lanes), atol=SAME)


@pytest.mark.parametrize("most", [1 << 28, 0], ids=["floats", "bytes"])
def test_texels_of_8_bits_are_colours_in_emissive_maps(most: int, lanes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shading, "MOST_FLOAT_BYTES", most)
    light = [((v / 255 + 0.055) / 1.055) ** 2.4 for v in (128, 64, 200)]
    got = drawn(quad(Finish(0.3, 0.5, (0.5, 0.5, 0.5), emissive_texture=coded((128, 64, 200), False))), lanes=lanes)
    want = drawn(quad(Finish(0.3, 0.5, (light[0] / 2, light[1] / 2, light[2] / 2))), lanes=lanes)
    np.testing.assert_allclose(got, want, atol=SAME)


def every_map(floats: bool) -> Finish:
    """All maps at once, of one noisy image; only the emissive one has colours."""
    image = textured.noise(7, 8, 8)
    numbers = Texture((image / np.float32(255)) if floats else image, minify="linear-mipmap-linear")
    return Finish(
        0.9,
        0.8,
        (0.2, 0.1, 0.3),
        metallic_roughness_texture=numbers,
        normal_texture=numbers,
        occlusion_texture=numbers,
        emissive_texture=Texture(image, minify="linear"),
    )


def test_pictures_have_the_same_bits_however_texels_are_stored(lanes: int, monkeypatch: pytest.MonkeyPatch) -> None:
    small = UPRIGHT * 3
    want = drawn(quad(every_map(False), uv=small), lanes=lanes)
    monkeypatch.setattr(shading, "MOST_FLOAT_BYTES", 0)
    np.testing.assert_array_equal(drawn(quad(every_map(False), uv=small), lanes=lanes), want)


def test_numbers_of_8_bits_and_floats_are_alike(lanes: int) -> None:
    """Where a texel is a pixel or larger: mip maps of bytes are rounded to bytes."""
    bytes_, floats = (drawn(quad(every_map(f), uv=UPRIGHT * 0.5, turn=0), lanes=lanes) for f in (False, True))
    np.testing.assert_array_equal(bytes_, floats)


# --- coordinates ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["metallic_roughness", "occlusion", "emissive"])
def test_a_map_may_lie_on_other_coordinates(name: str, lanes: int) -> None:
    """Two texels. The first coordinates are all in the left one, the second in the right one."""
    image = np.array([[[0.2, 0.4, 0.6, 1], [0.9, 0.8, 0.3, 1]]], np.float32)
    left, right = np.tile([0.25, 0.5], (4, 1)), np.tile([0.75, 0.5], (4, 1))
    texture = Texture(image, magnify="nearest", minify="nearest")
    for number, texel in enumerate(image[0]):
        maps: dict[str, Any] = {f"{name}_texture": texture, f"{name}_uv": number}
        got = drawn(quad(Finish(0.9, 0.8, (0.1, 0.2, 0.3), **maps), uv=left, more_uv=[right]), lanes=lanes)
        alone: dict[str, Any] = {f"{name}_texture": constant(*texel[:3])}
        want = drawn(quad(Finish(0.9, 0.8, (0.1, 0.2, 0.3), **alone)), lanes=lanes)
        np.testing.assert_allclose(got, want, atol=1e-6)


def test_a_normal_map_has_the_tangents_of_its_own_coordinates(lanes: int) -> None:
    sets = [LIES["half"][0], LIES["a quarter to the left"][0], UPRIGHT]
    finish = Finish(0.2, 0.4, normal_texture=bump((0.5, 0.1, 0.8)))
    for number, name in enumerate(("half", "a quarter to the left", "upright")):
        got = drawn(quad(replace(finish, normal_uv=number), uv=sets[0], more_uv=sets[1:]), lanes=lanes)
        _, tangent, bitangent = LIES[name]
        tilted = np.array((0.5, 0.1, 0.8)) @ [tangent, bitangent, (0, 0, 1)]
        np.testing.assert_allclose(got, drawn(quad(Finish(0.2, 0.4), normal=tilted), lanes=lanes), atol=SAME)


# --- all at once ------------------------------------------------------------------------------------------------------


def crowd() -> Scene:
    """Crossing quads, some half transparent, with all maps, some, or none, in front of one another."""
    bumpy = every_map(False)
    materials = (
        Material(finish=bumpy, base_color=(1, 0.8, 0.6, 0.5), alpha_mode="BLEND"),
        Material(finish=replace(bumpy, normal_texture=None, occlusion_texture=None)),
        Material(finish=replace(bumpy, emissive_texture=None), texture=Texture(textured.noise(8, 8, 8, [0, 90, 255]))),
        Material(plain=True, finish=Finish(1.0, 0.3)),
        Material(finish=bumpy, unlit=True),
        textured.textured(textured.noise(9, 6, 6, [0, 255]), alpha_mode="MASK"),
    )
    soup = textured.crossing(11, 16, materials)
    kinds = np.repeat(np.arange(16) % 7, 2) - 1
    return replace(replace(soup, face_materials=kinds).scene(), lights=LIGHTS)


def test_lanes_and_techniques_have_the_same_bits() -> None:
    """Fragments are shaded in vectors of any number, and in any order."""
    scene = crowd()

    def picture(technique: str, lanes: int) -> NDArray[np.float32]:
        camera = clpeel.Camera((0, 0, 3), (0, 0, 0), view_angle=45)
        return plainly.Renderer(scene, lanes=lanes).render(camera, (40, 30), technique, lighting="scene").color

    want = picture("sort", 1)
    assert np.isfinite(want).all()
    np.testing.assert_array_equal(picture("sort", 64), want)
    for lanes in (1, 64):
        np.testing.assert_array_equal(picture("multi-layer-peeling", lanes), want)


# --- images that cannot be decoded ------------------------------------------------------------------------------------


def test_a_damaged_map_is_left_out_with_a_note(tmp_path: Path) -> None:
    whole = png(np.random.default_rng(1).integers(0, 256, (64, 64, 3)))
    document = lit(whole[: len(whole) // 2], "normalTexture")
    document.more["materials"][0] |= {"name": "oak", "occlusionTexture": {"index": 1}}
    scene = document.load(tmp_path)
    assert scene.notes == ()
    renderer = plainly.Renderer(scene)
    result = renderer.render(size=(16, 16), lighting="kit")
    notes = [note for note in result.stats.notes if "left out" in note]
    assert [note.split(" (")[0] for note in notes] == [
        f"{kind} texture of material 'oak' left out: texture 'bumps' cannot be decoded: the image is damaged"
        for kind in ("normal", "occlusion")
    ]
    assert not [note for note in renderer.render(size=(16, 16)).stats.notes if "cannot be decoded" in note]
    document.more["materials"][0] = {
        key: document.more["materials"][0][key] for key in ("name", "pbrMetallicRoughness")
    }
    without = plainly.render(load(document.path(tmp_path)), size=(16, 16), lighting="kit")
    np.testing.assert_array_equal(result.color, without.color)
    assert len({tuple(pixel) for pixel in result.image.reshape(-1, 4).tolist()}) > 1


def test_only_what_lights_need_is_decoded() -> None:
    asked = list[str]()

    def broken(name: str) -> Texture:
        def decode() -> Any:
            asked.append(name)
            raise InputError("it is damaged")

        return Texture(LateImage(decode))

    whole = constant(0.5, 0.5, 1)
    finish = Finish(normal_texture=broken("normal"), occlusion_texture=whole, emissive_texture=broken("emissive"))
    scene = quad(finish, name="oak")
    plainly.render(scene, size=(4, 4))
    assert asked == []
    found, notes = readable(scene)
    assert asked == ["normal", "emissive"] and notes == [
        "normal texture of material 'oak' left out: it is damaged",
        "emissive texture of material 'oak' left out: it is damaged",
    ]
    left = found.materials[0].finish
    assert left is not None and left.normal_texture is None and left.emissive_texture is None
    assert left.occlusion_texture is whole and scene.materials[0].finish is finish
    asked.clear()
    unlit = quad(finish, unlit=True)
    assert readable(unlit) == (unlit, []) and asked == []


def test_a_scene_whose_maps_can_be_read_stays_as_it_is(tmp_path: Path) -> None:
    scene = lit(png(BLUE)).load(tmp_path)
    found, notes = readable(scene)
    assert found is scene and notes == []
