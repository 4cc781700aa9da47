"""3MF: what is built is where, and in the colours, that its specifications say (core, materials, production)."""

from __future__ import annotations

import io
import random
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from reading.packages import CORNERS, RELATIONS, TETRAHEDRON, mesh, model, package, packed, read_by_hand, square

from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.scene import Scene
from clpeel.scene.textures import linear, srgb

Reals = NDArray[np.float64]
THREE = 'p1="0" p2="1" p3="2"'


@pytest.fixture
def read(tmp_path: Path) -> Callable[[bytes], Scene]:
    """Loads the bytes of a package."""

    def loaded(data: bytes) -> Scene:
        path = tmp_path / "t.3mf"
        path.write_bytes(data)
        return load(path)

    return loaded


def corners(scene: Scene) -> Reals:
    """The corners of the triangles, [m, 3, 3]."""
    return scene.vertices[scene.faces]


def volume(scene: Scene) -> float:
    """The volume inside of faces that look outward."""
    a, b, c = np.moveaxis(corners(scene), 1, 0)
    return float((np.cross(a, b) * c).sum() / 6)


def colors(scene: Scene) -> NDArray[Any]:
    """The colours of the triangles' corners, [m, 3, 4], as they are stored."""
    if scene.vertex_colors is not None:
        return scene.vertex_colors[scene.faces]
    return np.broadcast_to(scene.colors.reshape(-1, 1, 4), (len(scene.faces), 3, 4))


def light(*values: float) -> Reals:
    """Colours 0..255 as linear ones 0..1."""
    return linear(np.array(values) / 255)


# --- what is built, and where -----------------------------------------------------------------------------------------


def test_components_in_components_are_placed_by_rows(read: Callable[[bytes], Scene]) -> None:
    """Points are rows in front of matrices, whose last row is a translation (core, 3.3)."""
    resources = (
        f'<object id="3">{TETRAHEDRON}</object>'
        '<object id="2"><components><component objectid="3" transform="0 1 0 -1 0 0 0 0 1 10 20 30"/></components>'
        "</object>"
        '<object id="1"><components><component objectid="2" transform="2 0 0 0 2 0 0 0 3 0 0 1"/>'
        '<component objectid="3"/></components></object>'
    )
    scene = read(package(resources, '<item objectid="1" transform="1 0 0 0 1 0 0.5 0 1 100 0 0"/>'))
    # The corner (x, y, z) becomes (10 - y, 20 + x, 30 + z), then twice that and three times z + 1, then x + z / 2.
    turned = np.array([[10 - y, 20 + x, 30 + z] for x, y, z in CORNERS]) * (2, 2, 3) + (0, 0, 1)
    want = [[x + z / 2 + 100, y, z] for x, y, z in turned] + [[x + z / 2 + 100, y, z] for x, y, z in CORNERS]
    np.testing.assert_allclose(scene.vertices, want, rtol=1e-15)
    assert scene.notes == () and tuple(scene.colors) == DEFAULT_COLOR
    assert volume(scene) == pytest.approx(13 / 6)


def test_a_mirrored_object_keeps_its_outside(read: Callable[[bytes], Scene]) -> None:
    """The sign of its volume stays (core, 3.3)."""
    build = '<item objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/>'
    assert volume(read(package(f'<object id="1">{TETRAHEDRON}</object>', build))) == pytest.approx(1 / 6)


def test_numbers_stay_as_the_file_has_them(read: Callable[[bytes], Scene]) -> None:
    points = ((4500000.123456789, 1e-300, -2.5e3), (0.1, 0.2, 0.3), (7, 8, 9))
    data = package(f'<object id="1">{mesh(points, "012")}</object>').replace(b"<model ", b'<model unit="inch" ')
    assert read(data).vertices.tolist() == [list(point) for point in points]


def test_parts_have_numbers_of_their_own(read: Callable[[bytes], Scene]) -> None:
    """The same number in two parts is two objects; a part's own components lie in the same part (production, 3)."""
    small, large = mesh(np.array(CORNERS) * 2, "123"), mesh(np.array(CORNERS) * 5, "123 021")
    inner = f'<object id="7">{large}</object><object id="1"><components><component objectid="7"/></components></object>'
    resources = (
        f'<object id="1">{TETRAHEDRON}</object><object id="2"><components>'
        '<component p:path="/3D/a.model" objectid="1"/><component p:path="/3D/B.model" objectid="1"/></components>'
        "</object>"
    )
    build = '<item objectid="2"/><item objectid="1"/><item p:path="/3D/a.model" objectid="1"/>'
    scene = read(package(resources, build, a__model=model(f'<object id="1">{small}</object>'), b__model=model(inner)))
    assert corners(scene).max(axis=(1, 2)).tolist() == [2, 5, 5, 1, 1, 1, 1, 2] and scene.notes[:-1] == ()


def test_the_package_names_the_model_to_start_with(read: Callable[[bytes], Scene]) -> None:
    parts: dict[str, str | bytes] = {
        "3D/3dmodel.model": model(f'<object id="1">{TETRAHEDRON}</object>', '<item objectid="1"/>'),
        "Other/start.model": model(f'<object id="1">{mesh(CORNERS, "012")}</object>', '<item objectid="1"/>'),
        "_rels/.rels": RELATIONS.format("/Other/start.model"),
    }
    assert len(read(packed(parts)).faces) == 1
    del parts["_rels/.rels"]
    assert len(read(packed(parts)).faces) == 4


def test_what_is_built_is_drawn_and_nothing_else(read: Callable[[bytes], Scene]) -> None:
    """Objects of every type are, and those that are not printed; an object that no item names is not (core, 3.4.3)."""
    kinds = ("model", "solidsupport", "support", "surface", "other")
    resources = "".join(f'<object id="{n}" type="{kind}">{TETRAHEDRON}</object>' for n, kind in enumerate(kinds, 1))
    items = "".join(
        f'<item objectid="{n}" printable="0" transform="1 0 0 0 1 0 0 0 1 {n} 0 0"/>' for n in range(1, len(kinds))
    )
    scene = read(package(resources, items))
    assert len(scene.faces) == 16 and scene.bounds[1].tolist() == [5, 1, 1]


@pytest.mark.parametrize("name", ["production_components.3mf", "counterXP.3MF"])
def test_real_packages_are_as_their_xml_says(model: Callable[[str], Path], name: str) -> None:
    path = model(f"3mf/{name}")
    scene, want = load(path), read_by_hand(path)
    found = corners(scene)
    np.testing.assert_allclose(found, want, rtol=0, atol=1e-12 * np.abs(want).max())
    assert len(scene.faces) == {"production_components.3mf": 8, "counterXP.3MF": 83750}[name]
    if name == "production_components.3mf":
        assert volume(scene) == pytest.approx((10**3 + 5**3) / 6)
    else:
        assert (colors(scene) == (0xCA, 0xD1, 0xEE, 255)).any() and not scene.notes


# --- colours ----------------------------------------------------------------------------------------------------------

GROUPS = (
    '<basematerials id="5"><base name="a" displaycolor="#FF0000"/><base name="b" displaycolor="#00FF0080"/>'
    '</basematerials><m:colorgroup id="6"><m:color color="#102030"/><m:color color="#FFFFFF"/>'
    '<m:color color="#0000FF40"/></m:colorgroup>'
)
RED, GREEN, DARK, WHITE, BLUE = (
    (255, 0, 0, 255),
    (0, 255, 0, 128),
    (16, 32, 48, 255),
    (255, 255, 255, 255),
    (0, 0, 255, 64),
)


@pytest.mark.parametrize(
    ("own", "first", "second", "want"),
    [
        ("", "", "", (DEFAULT_COLOR,) * 6),
        ('pid="5" pindex="1"', "", "", (GREEN,) * 6),
        ('pid="5" pindex="0"', "", 'p1="1"', (RED,) * 3 + (GREEN,) * 3),
        ('pid="5" pindex="0"', "", 'pid="6" p1="2"', (RED,) * 3 + (BLUE,) * 3),
        ('pid="5" pindex="0"', 'pid="6"', 'pid="6" p2="1"', (RED,) * 6),  # without p1, the object's counts
        ("", 'pid="6" p1="0" p2="1" p3="2"', "", (DARK, WHITE, BLUE) + (DEFAULT_COLOR,) * 3),
        ('pid="6" pindex="1"', 'p1="0" p2="2"', "", (DARK,) * 3 + (WHITE,) * 3),  # without p3, p1 is that of all
        ('pid="5" pindex="0"', 'p1="1" p2="0" p3="0"', "", (GREEN,) * 3 + (RED,) * 3),  # no gradients of materials
    ],
)
def test_triangles_have_their_properties_or_the_objects(
    read: Callable[[bytes], Scene], own: str, first: str, second: str, want: tuple[tuple[int, ...], ...]
) -> None:
    """Core specification, 4 and 4.1.4."""
    scene = read(package(f'{GROUPS}<object id="1" {own}>{square(first, second)}</object>'))
    assert [tuple(row) for row in colors(scene).reshape(-1, 4)] == list(want)
    assert colors(scene).dtype == np.uint8 and scene.notes == () and not scene.materials
    np.testing.assert_array_equal(
        corners(scene)[:, :, :2].reshape(-1, 2), [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]]
    )


def test_an_assembly_gives_its_colour_to_parts_without_one(read: Callable[[bytes], Scene]) -> None:
    """As far as no object below has its own (core, 4)."""
    resources = (
        f'{GROUPS}<object id="3">{TETRAHEDRON}</object><object id="4" pid="5" pindex="1">{TETRAHEDRON}</object>'
        '<object id="2"><components><component objectid="3"/><component objectid="4"/></components></object>'
        '<object id="1" pid="5" pindex="0"><components><component objectid="2"/></components></object>'
    )
    found = colors(read(package(resources, '<item objectid="1"/><item objectid="3"/>')))[:, 0]
    assert [tuple(color) for color in found[::4]] == [RED, GREEN, DEFAULT_COLOR]


def test_composites_mix_light_by_their_shares(read: Callable[[bytes], Scene]) -> None:
    """Shares are divided by their sum; those not given are 0; if all are 0, they are alike (materials, 4.1)."""
    resources = (
        '<basematerials id="5"><base name="a" displaycolor="#C00040"/><base name="b" displaycolor="#0080FF"/>'
        '<base name="c" displaycolor="#00FF00"/></basematerials>'
        '<m:compositematerials id="6" matid="5" matindices="0 1"><m:composite values="0.5 1.5"/>'
        '<m:composite values="3"/><m:composite values="0 0 9"/></m:compositematerials>'
        f'<object id="1" pid="6" pindex="1">{square(THREE)}</object>'
    )
    found = colors(read(package(resources)))
    first, second = light(0xC0, 0, 0x40), light(0, 0x80, 0xFF)
    want = srgb([first * 0.25 + second * 0.75, first, (first + second) / 2])
    np.testing.assert_allclose(found[0, :, :3], want, atol=1e-6)
    np.testing.assert_allclose(found[1], [[0xC0 / 255, 0, 0x40 / 255, 1]] * 3, atol=1e-6)


# --- textures ---------------------------------------------------------------------------------------------------------


def png(pixels: Any, mode: str = "RGB") -> bytes:
    """A PNG image of these bytes [height, width, channels]."""
    file = io.BytesIO()
    Image.fromarray(np.array(pixels, np.uint8), mode).save(file, "PNG")
    return file.getvalue()


PIXELS = [[(255, 0, 0), (0, 255, 0), (0, 0, 255)], [(9, 9, 9), (200, 200, 200), (50, 60, 70)]]
TEXTURED = (
    '<m:texture2d id="7" path="/3D/wood.png" contenttype="image/png" {}/>'
    '<m:texture2dgroup id="8" texid="7"><m:tex2coord u="0" v="0"/><m:tex2coord u="1" v="0.25"/>'
    '<m:tex2coord u="2.5" v="1"/></m:texture2dgroup>'
)
ALL = f'pid="8" {THREE}'


def test_a_texture_is_a_material_with_coordinates(read: Callable[[bytes], Scene]) -> None:
    resources = f'{GROUPS}{TEXTURED.format("")}<object id="1" pid="5" pindex="0">{square(ALL)}</object>'
    scene = read(package(resources, wood__png=png(PIXELS)))
    (material,) = scene.materials
    assert scene.face_materials is not None and scene.face_materials.tolist() == [0, -1] and scene.uv is not None
    assert scene.uv[scene.faces[0]].tolist() == [[0, 1], [1, 0.75], [2.5, 0]]  # in files, v points up
    assert [tuple(row) for row in colors(scene)[:, 0]] == [WHITE, RED]
    assert material.texture is not None and material.alpha_mode == "OPAQUE"
    assert material.texture.image[..., :3].tolist() == [[list(texel) for texel in row] for row in PIXELS]
    assert material.texture.wrap == ("repeat", "repeat") and material.texture.minify == "linear-mipmap-linear"
    assert scene.notes == ()


@pytest.mark.parametrize(
    ("attributes", "wrap", "magnify", "notes"),
    [
        ('tilestyleu="mirror" tilestylev="clamp"', ("mirror", "clamp"), "linear", 0),
        ('tilestyleu="wrap" tilestylev="none" filter="nearest"', ("repeat", "clamp"), "nearest", 0),
        ('tilestyleu="none" filter="linear"', ("clamp", "repeat"), "linear", 1),
    ],
)
def test_tile_styles_and_filters(
    read: Callable[[bytes], Scene], attributes: str, wrap: tuple[str, str], magnify: str, notes: int
) -> None:
    """`none` beyond the image is the object's colour, which is not drawn so: a note says that, if it shows."""
    resources = f'{TEXTURED.format(attributes)}<object id="1">{square(ALL)}</object>'
    scene = read(package(resources, wood__png=png(PIXELS)))
    texture = scene.materials[0].texture
    assert texture is not None and texture.wrap == wrap and texture.magnify == magnify
    assert len(scene.notes) == notes and all("tile style is none" in note for note in scene.notes)


def test_transparent_texels_blend(read: Callable[[bytes], Scene]) -> None:
    resources = f'{TEXTURED.format("")}<object id="1">{square(ALL)}</object>'
    scene = read(package(resources, wood__png=png([[(1, 2, 3, 0), (4, 5, 6, 255)]], "RGBA")))
    assert scene.materials[0].alpha_mode == "BLEND" and scene.surfaces == "mixed"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "the 3MF package lacks it"),
        (b"hello", "expected an image, got text that begins with 'hello'"),
        (png(PIXELS)[:45], "the image is damaged"),
    ],
)
def test_a_texture_that_cannot_be_read_is_noted_by_name(
    read: Callable[[bytes], Scene], content: bytes | None, reason: str
) -> None:
    others = {} if content is None else {"wood__png": content}
    scene = read(package(f'{TEXTURED.format("")}<object id="1">{square(ALL)}</object>', **others))
    (note,) = scene.notes
    assert note.startswith(f"texture '/3D/wood.png' left out: {reason}") and not scene.materials


# --- multi-properties -------------------------------------------------------------------------------------------------


def layered(read: Callable[[bytes], Scene], pids: str, methods: str, indices: str, **others: bytes) -> Scene:
    """A square of one multi-property: its groups, how they are blended, and the index in each of them."""
    resources = (
        '<basematerials id="5"><base name="a" displaycolor="#C08040"/></basematerials>'
        '<m:colorgroup id="6"><m:color color="#FF000080"/><m:color color="#4080C0"/></m:colorgroup>'
        '<m:colorgroup id="9"><m:color color="#40FF8080"/></m:colorgroup>'
        f"{TEXTURED.format('')}"
        f'<m:multiproperties id="3" pids="{pids}" blendmethods="{methods}"><m:multi pindices="{indices}"/>'
        f'</m:multiproperties><object id="1" pid="3" pindex="0">{square()}</object>'
    )
    return read(package(resources, **others))


HALF = 128 / 255


def test_layers_of_colours_are_blended_as_light(read: Callable[[bytes], Scene]) -> None:
    """The lowest is opaque (materials, 5)."""
    top, low = light(0x40, 0xFF, 0x80), light(0xFF, 0, 0)
    found = colors(layered(read, "6 9", "", "0 0"))
    np.testing.assert_allclose(found[0, 0], [*srgb(top * HALF + low * (1 - HALF)), 1], atol=1e-6)
    found = colors(layered(read, "6 9", "multiply", "1"))
    np.testing.assert_allclose(found[0, 0], [*srgb(top * light(0x40, 0x80, 0xC0)), HALF], atol=1e-6)


def test_layers_on_a_material_are_blended_first(read: Callable[[bytes], Scene]) -> None:
    """Then their result lies on the material's display colour, by its alpha (materials, 5)."""
    material, second, third = light(0xC0, 0x80, 0x40), light(0xFF, 0, 0), light(0x40, 0xFF, 0x80)
    found = colors(layered(read, "5 6", "mix", "0 0"))
    np.testing.assert_allclose(found[0, 0], [*srgb(second * HALF + material * (1 - HALF)), 1], atol=1e-6)
    found = colors(layered(read, "5 6", "multiply", "0 0"))
    np.testing.assert_allclose(found[0, 0], [*srgb(second), 1], atol=1e-6)  # a multiplied second layer is opaque
    found = colors(layered(read, "5 6 9", "mix mix", "0 0 0"))
    rgb, alpha = third * HALF + second * (1 - HALF), HALF + HALF * (1 - HALF)
    np.testing.assert_allclose(found[0, 0], [*srgb(rgb * alpha + material * (1 - alpha)), 1], atol=1e-6)


def test_an_opaque_texture_on_top_is_all_that_shows(read: Callable[[bytes], Scene]) -> None:
    scene = layered(read, "5 8", "mix", "0 1", wood__png=png(PIXELS))
    assert scene.materials[0].texture is not None and scene.materials[0].texture.image.dtype == np.uint8
    assert scene.uv is not None and scene.uv[scene.faces].reshape(-1, 2).tolist() == [[1, 0.75]] * 6


@pytest.mark.parametrize("method", ["mix", "multiply"])
def test_a_texture_is_blended_with_the_colour_below(read: Callable[[bytes], Scene], method: str) -> None:
    texels = np.array([[(255, 0, 0, 51), (0, 255, 0, 255)]])
    scene = layered(read, "6 8", method, "1 0", wood__png=png(texels, "RGBA"))
    (material,) = scene.materials
    assert material.texture is not None and material.texture.image.dtype == np.float32
    own, cover, below = linear(texels[0, :, :3] / 255), texels[0, :, 3:] / 255, light(0x40, 0x80, 0xC0)
    rgb = own * cover + below * (1 - cover) if method == "mix" else own * below
    np.testing.assert_allclose(material.texture.image[0, :, :3], rgb, atol=1e-6)
    np.testing.assert_allclose(material.texture.image[0, :, 3], [1, 1] if method == "mix" else [0.2, 1], atol=1e-6)
    assert material.alpha_mode == ("OPAQUE" if method == "mix" else "BLEND")


def test_a_colour_lies_on_a_texture(read: Callable[[bytes], Scene]) -> None:
    scene = layered(read, "8 6", "mix", "0 0", wood__png=png(PIXELS))
    assert scene.materials[0].texture is not None
    want = linear(np.array(PIXELS) / 255) * (1 - HALF) + light(255, 0, 0) * HALF
    np.testing.assert_allclose(scene.materials[0].texture.image[..., :3], want, atol=1e-6)


def test_two_textures_are_noted(read: Callable[[bytes], Scene]) -> None:
    scene = layered(read, "8 8", "multiply", "0 0", wood__png=png(PIXELS))
    assert len(scene.materials) == 1 and "several textures" in scene.notes[0]


# --- what is left out -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("resources", "note"),
    [
        ('<object id="1">{}</object>', ""),
        (
            '<object id="1"><mesh><vertices/><triangles/><b:beamlattice/></mesh></object><object id="2">{}</object>',
            "left out of the 3MF package, as it is not read: 'beamlattice'",
        ),
        ('<m:pbmetallicdisplayproperties id="3"/><object id="1">{}</object>', "not read: display properties"),
        (
            '<object id="1" pid="9" pindex="0">{}</object>',
            "properties left out, as group 9 of the 3MF package lacks them",
        ),
        (
            '<m:colorgroup id="9"/><object id="1" pid="9" pindex="4">{}</object>',
            "as group 9 of the 3MF package lacks them",
        ),
        (
            '<m:colorgroup id="9"><m:color color="red"/></m:colorgroup><object id="1" pid="9" pindex="0">{}</object>',
            "colours of the 3MF package left out, as they are none: 'red'",
        ),
    ],
)
def test_what_is_left_out_is_noted(read: Callable[[bytes], Scene], resources: str, note: str) -> None:
    item = '<item objectid="2"/>' if 'id="2"' in resources else '<item objectid="1"/>'
    scene = read(package(resources.format(TETRAHEDRON), item))
    assert note in "".join(scene.notes) and len(scene.notes) == bool(note) and len(scene.faces) == 4
    assert tuple(scene.colors) == DEFAULT_COLOR


def test_painted_triangles_are_noted(read: Callable[[bytes], Scene]) -> None:
    shape = square('paint_color="4"')
    scene = read(package(f'<object id="1">{shape}</object>'))
    assert scene.notes == (
        "left out of the 3MF package, as it is not read: colours painted on triangles (paint_color)",
    )


@pytest.mark.parametrize(
    ("component", "lost"),
    [
        ('<component objectid="9"/>', "object 9 of '3d/3dmodel.model'"),
        ('<component p:path="/3D/gone.model" objectid="1"/>', "part '/3D/gone.model'"),
        ('<component p:path="/../../../etc/passwd" objectid="1"/>', "part '/../../../etc/passwd'"),
    ],
)
def test_what_is_missing_is_noted(read: Callable[[bytes], Scene], component: str, lost: str) -> None:
    whole = f'<object id="1"><components>{component}<component objectid="2"/></components></object>'
    scene = read(package(f'<object id="2">{TETRAHEDRON}</object>{whole}'))
    assert scene.notes == (f"1 component(s) left out, as the 3MF package lacks: {lost}",) and len(scene.faces) == 4
    alone = f'<object id="1"><components>{component}</components></object>'
    with pytest.raises(InputError, match="expected triangles, got none; 1 component.s. left out"):
        read(package(alone))


# --- what is damaged --------------------------------------------------------------------------------------------------


def nested(levels: int, each: int) -> str:
    """Objects of so many components each of the one before, the last one being number 1."""
    text = f'<object id="{levels}">{TETRAHEDRON}</object>'
    for level in range(levels - 1, 0, -1):
        inside = f'<component objectid="{level + 1}"/>' * each
        text += f'<object id="{level}"><components>{inside}</components></object>'
    return text


FROM_BELOW = "".join(f'<item objectid="{number}"/>' for number in range(200, 0, -1))
WRONG = square(f'pid="6" {THREE}').replace('v3="3"', 'v3="7"')
CYCLE = (
    '<object id="1"><components><component objectid="2"/></components></object>'
    '<object id="2"><components><component objectid="1"/></components></object>'
)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (package(CYCLE), "object 1 of its 3MF package is a part of itself"),
        (package(nested(2000, 1)), "at most 100 levels of components"),
        (package(nested(8, 10).replace(TETRAHEDRON, "<mesh/>")), "at most 1,048,576 objects"),
        (package(nested(40, 10)), "and 268,435,456 triangles"),
        (package(nested(200, 1), FROM_BELOW), "at most 100 levels of components"),
        (package(f'<object id="1">{mesh(CORNERS, "129")}</object>'), "faces: expected indices 0..3, got 9"),
        (package(f'{GROUPS}<object id="1">{WRONG}</object>'), "faces: expected indices 0..3, got 7"),
        (
            package(f'<object id="1">{TETRAHEDRON}</object>', ""),
            "expected triangles, got none; the package builds nothing",
        ),
        (package('<object id="1"><mesh><vertices><vertex x="1"/></vertices></mesh></object>'), "KeyError: 'y'"),
        (package(f'<object id="1">{mesh(CORNERS, "01x")}</object>'), "ValueError: invalid literal"),
        (package('<object id="1">'), "ExpatError: mismatched tag"),
        (
            packed({"3D/3dmodel.model": '<!DOCTYPE m [<!ENTITY a "b">]><model/>'}),
            "a model of a 3MF package has no document type, this one has",
        ),
        (
            package('<object id="1"><components><component objectid="2" transform="1 0 0"/></components></object>'),
            "cannot reshape",
        ),
    ],
)
def test_a_damaged_package_is_refused_in_one_line(read: Callable[[bytes], Scene], data: bytes, says: str) -> None:
    with pytest.raises(InputError) as error:
        read(data)
    assert says in str(error.value) and "\n" not in str(error.value)


def test_a_package_that_unpacks_to_too_much_is_refused(read: Callable[[bytes], Scene], monkeypatch: Any) -> None:
    monkeypatch.setattr("clpeel.reading.three_mf_parts._FREE", 1 << 20)
    data = package(f'<object id="1">{TETRAHEDRON}</object>' + " " * (1 << 21))
    with pytest.raises(
        InputError, match="it would unpack to 2,[0-9,]+ bytes and more, which is over 200 times its size"
    ):
        read(data)
    assert len(read(package(f'<object id="1">{TETRAHEDRON}</object>' + " " * (1 << 19))).faces) == 4


def damaged(data: bytes, chance: random.Random) -> bytes:
    """A copy that is cut or has other bytes."""
    copy = bytearray(data[: chance.randrange(len(data))] if chance.random() < 0.3 else data)
    for _ in range(chance.choice((1, 3, 10)) if copy else 0):
        copy[chance.randrange(len(copy))] = chance.choice([chance.randrange(256), *b'019-. <"/#'])
    return bytes(copy)


def test_no_damage_does_more_than_a_refusal(read: Callable[[bytes], Scene], model: Callable[[str], Path]) -> None:
    """In the archive, and in the parts of a whole archive."""
    chance = random.Random(11)
    whole = layered_package()
    with zipfile.ZipFile(io.BytesIO(whole)) as archive:
        parts: dict[str, str | bytes] = {name: archive.read(name) for name in archive.namelist()}
    refused = 0
    for turn in range(400):
        name = chance.choice(sorted(parts))
        content = parts[name]
        assert isinstance(content, bytes)
        data = packed(parts | {name: damaged(content, chance)}) if turn % 2 else damaged(whole, chance)
        try:
            lines = read(data).notes
        except InputError as error:
            refused += 1
            lines = (str(error),)
        assert all(line.isprintable() and len(line) < 500 for line in lines), lines
    assert 100 < refused < 400


def layered_package() -> bytes:
    """A package with something of everything."""
    shape = square(ALL, f'pid="6" {THREE}')
    resources = (
        f"{GROUPS}{TEXTURED.format('')}"
        '<m:compositematerials id="10" matid="5" matindices="0 1"><m:composite values="1 2"/></m:compositematerials>'
        '<m:multiproperties id="3" pids="10 6 8"><m:multi pindices="0 1 1"/></m:multiproperties>'
        f'<object id="4" pid="3" pindex="0">{shape}</object>'
        '<object id="1"><components><component objectid="4" transform="1 0 0 0 1 0 0 0 2 1 2 3"/>'
        '<component p:path="/3D/a.model" objectid="1"/></components></object>'
    )
    return package(resources, a__model=model(f'<object id="1">{TETRAHEDRON}</object>'), wood__png=png(PIXELS))
