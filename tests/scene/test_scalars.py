"""Scalars: which numbers are mapped, what becomes of a scene's colours and opacities, and which errors there are."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clpeel
from clpeel.pictures.colormaps import ColorMap, sampled
from clpeel.scene.fields import with_arrays
from clpeel.scene.scene import joined, with_part, with_vertex_colors
from clpeel.scene.transfer import NAMES, transfer

CORNERS = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]]
FACES = [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
TENT = clpeel.Scene.from_arrays(CORNERS, FACES)
NUMBERS = [0.0, 1, 2, 3, 4]


def coordinates(scene: clpeel.Scene) -> np.ndarray:
    assert scene.uv is not None
    return scene.uv[:, 0]


def test_an_opaque_map_keeps_the_scene_opaque() -> None:
    scene = clpeel.with_scalars(TENT, NUMBERS)
    assert scene.opaque and scene.notes == () and scene.counts == TENT.counts
    assert clpeel.with_scalars(TENT, NUMBERS[:4]).opaque  # of faces
    for opacity in (0.5, "linear", np.linspace(0, 1, 5), np.linspace(0, 1, 4)):
        assert not clpeel.with_scalars(TENT, NUMBERS, opacity=opacity).opaque
    assert not clpeel.with_scalars(TENT, NUMBERS, below_color=(1, 0, 0, 0.5)).opaque
    assert clpeel.with_scalars(TENT, NUMBERS, opacity=1).opaque


def test_vectors_count_by_length_or_component() -> None:
    vectors = np.array([[3.0, 4], [0, 0], [6, 8], [1, 0], [0, 2]])
    for component, want in [(None, (0.0, 10.0)), (-1, (0.0, 10.0)), (0, (0.0, 6.0)), (1, (0.0, 8.0))]:
        [colors] = clpeel.with_scalars(TENT, vectors, component=component).color_maps
        assert colors.clim == want
    [huge] = clpeel.with_scalars(TENT, vectors * 1e300).color_maps
    assert huge.clim == (0.0, 1e301)


def test_categories() -> None:
    kinds = [7, 3, 7, 40]
    for values in (kinds, [f"k{kind:02}" for kind in kinds]):
        scene = clpeel.with_scalars(TENT, values, categories=True, cmap=["red", "lime", "blue", "white"])
        assert scene.face_colors is not None and scene.opaque
        assert scene.face_colors[:, :3].tolist() == [[0, 255, 0], [255, 0, 0], [0, 255, 0], [0, 0, 255]]
    assert scene.color_maps[0].categories == ("k03", "k07", "k40")
    named = clpeel.with_scalars(TENT, kinds, categories={40: "forty", 7: "seven"}, cmap=["red", "lime"])
    assert named.color_maps[0].categories == ("forty", "seven") and len(named.faces) == 3
    assert named.face_colors is not None and named.face_colors[:, 0].tolist() == [0, 0, 255]
    of_vertices = clpeel.with_scalars(TENT, [1, 1, 2, 3, 2], categories=True, cmap=["red", "lime", "blue"])
    assert of_vertices.face_colors is not None
    # Faces 0, 1 and 2 have corners (1, 1, 2), (1, 2, 2) and (2, 3, 2); those of face 3 are all different.
    assert of_vertices.face_colors[:3, :2].tolist() == [[255, 0], [0, 255], [0, 255]]
    assert "4 faces between categories" in of_vertices.notes[0]


def test_qualitative_maps_give_their_first_colors() -> None:
    pytest.importorskip("matplotlib")
    tab = (np.array([[31, 119, 180], [255, 127, 14], [44, 160, 44]])).tolist()  # of tab10, as Tableau has them
    assert sampled("tab10", 3, kinds=True)[:, :3].tolist() == tab
    assert len(np.unique(sampled("tab10", 12, kinds=True), axis=0)) == 10


def test_maps_by_name_by_list_and_of_libraries() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    want = np.rint(np.array(matplotlib.colormaps["plasma"](np.arange(256))) * 255)
    assert (sampled("plasma") == want).all() and (sampled("plasma_r") == want[::-1]).all()
    assert (sampled(matplotlib.colormaps["plasma"]) == want).all()
    assert np.abs(sampled("viridis") - np.array(matplotlib.colormaps["viridis"](np.arange(256))) * 255).max() <= 2
    assert (sampled("viridis_r") == sampled("viridis")[::-1]).all()
    assert sampled(["red", (0, 1, 0), "#0000ff80"]).tolist() == [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 128]]
    assert sampled(["black", "white"], 3)[:, 0].tolist() == [0, 128, 255]
    assert sampled("gray", 2).tolist() == [[0, 0, 0, 255], [255, 255, 255, 255]]


def test_cmap_knows_more_names() -> None:
    cmap = pytest.importorskip("cmap")
    assert (
        np.abs(
            sampled("cmocean:thermal", 5) - np.array(cmap.Colormap("cmocean:thermal")(np.linspace(0, 1, 5))) * 255
        ).max()
        <= 0.5
    )


def test_without_libraries_few_names_are_known(monkeypatch: pytest.MonkeyPatch) -> None:
    for library in ("matplotlib", "cmap"):
        monkeypatch.setitem(sys.modules, library, None)
    assert len(sampled("viridis")) == 256
    with pytest.raises(clpeel.InputError, match=r"one of viridis, gray, got 'plasma'.*pip install matplotlib cmap$"):
        sampled("plasma")


def test_a_map_takes_numbers_as_matplotlib_does() -> None:
    matplotlib = pytest.importorskip("matplotlib")
    theirs = matplotlib.colormaps["plasma"].with_extremes(under="red", over="lime", bad="blue")
    ours = ColorMap(
        sampled("plasma"), (-1.0, 3.0), below=(255, 0, 0, 255), above=(0, 255, 0, 255), nan=(0, 0, 255, 255)
    )
    values = np.array([-1, 3, np.nextafter(3, 4), np.nextafter(-1, -2), 0, 1, np.nan, np.inf, -np.inf, 2.999, 0.3])
    # matplotlib cuts off what is a byte, and this rounds it.
    assert np.abs(ours(values).astype(int) - theirs((values + 1) / 4, bytes=True)).max() <= 1


@pytest.mark.parametrize("count", [2, 7, 256])
def test_transfer_functions_are_those_of_pyvista(count: int) -> None:
    pyvista = pytest.importorskip("pyvista")
    for name in NAMES:
        assert (transfer(name, count) == pyvista.opacity_transfer_function(name, count)).all(), name
    for name in ("linear_r", "geom_r", "sigmoid_r", "sigmoid_5_r"):
        assert (transfer(name, count) == pyvista.opacity_transfer_function(name, count)).all(), name


def test_transfer_functions_by_their_formulas() -> None:
    step = np.arange(256) / 255
    assert np.abs(transfer("linear", 256) / 255 - step).max() < 1 / 255
    assert np.abs(transfer("sigmoid", 256) / 255 - 1 / (1 + np.exp(-(20 * step - 10)))).max() < 1 / 255
    assert np.abs(transfer("sigmoid_4_r", 256) / 255 - 1 / (1 + np.exp(8 * step - 4))).max() < 1 / 255
    assert np.abs(transfer("geom", 256) / 255 - 1e-6 * (255e6) ** step / 255).max() < 1 / 255
    assert transfer("foreground", 4).tolist() == [0, 255, 255, 255]
    assert np.abs(transfer([0, 1, 0.5], 5) / 255 - [0, 0.5, 1, 0.75, 0.5]).max() <= 0.5 / 255
    assert transfer([0, 0.5, 1], 3).tolist() == [0, 128, 255]


def test_a_range_and_its_default() -> None:
    def clim(values: Any, **options: Any) -> tuple[float, float]:
        [colors] = clpeel.with_scalars(TENT, values, **options).color_maps
        return colors.clim

    assert clim([np.nan, 1, np.inf, -np.inf, 5]) == (1, 5)
    assert clim([-2, 0, 0.1, 10, 5], log_scale=True) == (0.1, 10)
    assert clim(NUMBERS, clim=3) == (-3, 3) and clim(NUMBERS, clim=[1, 2]) == (1, 2)
    for value in (0, 5, -5, 1e-300, 1e300):
        low, high = clim([value] * 5)
        assert low < value < high
    assert clim(np.array([True, False, True, True, False])) == (0, 1)


def test_what_is_beyond_the_logarithm_is_below() -> None:
    scene = clpeel.with_scalars(TENT, [-1, 0, 1, 10, 100], log_scale=True, below_color="red")
    assert (coordinates(scene)[:2] < 0).all() and "2 numbers of 0 or less" in scene.notes[0]
    np.testing.assert_allclose(coordinates(scene)[3], (1 + 128) / 258, atol=1e-4)


def test_the_scenes_opacities_stay() -> None:
    faded = clpeel.load(TENT, opacity=0.4)
    assert clpeel.with_scalars(faded, NUMBERS).materials[0].opacity == pytest.approx(0.4, abs=1e-7)
    assert clpeel.with_scalars(faded, NUMBERS[:4]).colors[0, 3] == pytest.approx(0.4, abs=1 / 255)
    assert clpeel.with_scalars(faded, NUMBERS, opacity=1).opaque
    each = np.full((5, 4), 255, np.uint8)
    each[:, 3] = [0, 50, 100, 150, 255]
    of_vertices = clpeel.with_scalars(clpeel.Scene.from_arrays(CORNERS, FACES, vertex_colors=each), NUMBERS)
    assert np.rint(of_vertices.colors[:, 3] * 255).tolist() == each[:, 3].tolist()
    assert of_vertices.materials[0].alpha_of_scene and not of_vertices.materials[0].rgb_of_scene
    glass = clpeel.Material(base_color=(1, 1, 1, 0.25), alpha_mode="BLEND")
    solid = clpeel.Material(base_color=(1, 1, 1, 0.25))
    mixed = clpeel.Scene.from_arrays(CORNERS, FACES, materials=[glass, solid], face_materials=[0, 0, 1, 1])
    found = clpeel.with_scalars(mixed, NUMBERS)
    assert found.face_materials is not None
    assert [found.materials[place].opacity for place in found.face_materials] == [0.25, 0.25, 1, 1]
    assert np.rint(clpeel.with_scalars(mixed, NUMBERS[:4]).colors[:, 3] * 255).tolist() == [64, 64, 255, 255]


def test_textures_that_are_lost_are_noted() -> None:
    texture = clpeel.Texture.of(np.zeros((2, 2, 3), np.uint8))
    scene = clpeel.Scene.from_arrays(CORNERS, FACES, materials=[clpeel.Material(texture=texture)], uv=np.zeros((5, 2)))
    found = clpeel.with_scalars(scene, NUMBERS)
    assert found.notes == ("textures of 1 materials left out: the colours are those of scalars",)
    assert clpeel.with_scalars(found, NUMBERS[::-1]).notes == found.notes


def test_numbers_of_faces_and_opacities_of_vertices_go_together() -> None:
    scene = clpeel.with_scalars(TENT, NUMBERS[:4], opacity=np.linspace(0, 1, 5), clim=(0, 4))
    assert scene.vertex_colors is not None and len(scene.vertices) == 12
    wanted = np.linspace(0, 1, 5)[np.array(FACES)].reshape(-1)
    np.testing.assert_allclose(scene.vertex_colors[:, 3], wanted, atol=1e-6)
    assert len(np.unique(coordinates(scene))) == 4
    other = clpeel.with_scalars(TENT, NUMBERS, opacity=[0, 0.2, 0.4, 0.6])
    np.testing.assert_allclose(other.colors[:, 3], np.repeat([0, 0.2, 0.4, 0.6], 3), atol=1e-6)


def test_opacities_outside_of_their_range_are_noted() -> None:
    scene = clpeel.with_scalars(TENT, NUMBERS, opacity=[0, 0.5, 1, 2, -1.0])
    assert "2 numbers of the array outside 0..1" in scene.notes[0] and scene.colors[:, 3].max() == 1


def test_what_has_no_number_is_left_out_and_the_bounds_stay() -> None:
    apart = clpeel.Scene.from_arrays([*CORNERS, [9, 9, 9]], [*FACES, [0, 1, 5]])
    scene = clpeel.with_scalars(apart, [*NUMBERS, np.nan])
    assert len(scene.faces) == 4 and (scene.bounds == apart.bounds).all() and scene.bounds[1, 2] == 9
    assert scene.notes == ("scalars: 1 faces without a number left out; nan_color shows them",)


# --- arrays of scenes -------------------------------------------------------------------------------------------------


def test_arrays_stay_with_their_rows() -> None:
    tent = with_arrays(TENT, {"a": np.arange(5), "v": np.ones((5, 3))}, {"f": np.arange(4.0)})
    dotted = clpeel.Scene.from_arrays(CORNERS, FACES[:1], points=[3])
    both = joined([tent, with_arrays(dotted, {"a": np.arange(5) + 10}, {"g": [1.0]})])
    assert both.vertex_arrays["a"].tolist() == [*range(5), *range(10, 15)]
    np.testing.assert_array_equal(both.vertex_arrays["v"][5:], np.full((5, 3), np.nan))
    np.testing.assert_array_equal(both.face_arrays["f"], [0, 1, 2, 3, np.nan, np.nan])
    np.testing.assert_array_equal(both.face_arrays["g"], [*[np.nan] * 4, 1, np.nan])
    split = with_vertex_colors(both)
    assert split.vertex_arrays["a"].tolist() == [*both.vertex_arrays["a"][both.faces.reshape(-1)], 13]
    some = with_part(both, np.array([True, False, True, False, False, True]))
    np.testing.assert_array_equal(some.face_arrays["f"], [0, 2, np.nan])
    assert some.counts == (2, 0, 1)


def test_a_name_is_of_vertices_or_of_faces() -> None:
    tent = with_arrays(TENT, {"a": np.arange(5)}, {"a": np.arange(4.0), "f": np.arange(4.0)})
    assert clpeel.with_scalars(tent, "a").uv is not None
    assert clpeel.with_scalars(tent, "a", preference="face").face_colors is not None
    assert clpeel.with_scalars(tent, "f").color_maps[0].label == "f"
    four = clpeel.Scene.from_arrays(CORNERS[:4], FACES_OF_FOUR)
    assert clpeel.with_scalars(four, NUMBERS[:4]).uv is not None
    assert clpeel.with_scalars(four, NUMBERS[:4], preference="face").face_colors is not None


FACES_OF_FOUR = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]

PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float quality
element face 2
property list uchar int vertex_indices
property int part
element edge 1
property int vertex1
property int vertex2
end_header
0 0 0 1
1 0 0 2
1 1 0 3
0 1 0 4
4 0 1 2 3 7
3 0 1 3 9
0 2
"""


def test_files_carry_arrays(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_text(PLY)
    scene = clpeel.load(path)
    assert scene.notes == ("arrays left out: 'quality', 'part'; --coloring-array, or scalars, shows one",)
    np.testing.assert_array_equal(scene.vertex_arrays["quality"], [1, 2, 3, 4, 1, 3])
    np.testing.assert_array_equal(scene.face_arrays["part"], [7, 7, 9, np.nan])
    shown = clpeel.load(path, scalars="quality", cmap=["red", "lime"], clim=(0, 4), opacity=0.5)
    assert shown.color_maps[0].clim == (0, 4) and shown.materials[0].opacity == 0.5
    assert not any("left out" in note for note in shown.notes)
    assert clpeel.with_scalars(scene, "quality").notes == (
        "scalars: lines have the colours of their ends, and mixtures of these between them",
    )
    parts = clpeel.load(path, scalars="part", categories=True)
    assert parts.color_maps[0].categories == ("7", "9") and parts.counts == (3, 0, 0)


# --- errors -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"values": "height"}, "scalars: expected an array, or a name in a scene that has some, got 'height'"),
        ({"values": [1, 2]}, "scalars: expected 5 (vertices) or 4 (faces) rows, got 2"),
        ({"values": 3.0}, "scalars: expected numbers in rows, [rows] or [rows, components], got []"),
        ({"values": [1j] * 5}, "scalars: expected real numbers, got complex128"),
        ({"values": np.ones((5, 2)), "component": 2}, "component: expected 0..1, got 2"),
        ({"component": 1}, "component: expected 0, as scalars are single numbers, got 1"),
        ({"clim": (2, 2)}, "clim: expected (low, high) with low < high, or a number above 0, got (2, 2)"),
        ({"clim": "wide"}, "clim: expected (low, high) with low < high, or a number above 0, got 'wide'"),
        ({"clim": (0, 1), "log_scale": True}, "clim: expected numbers above 0 with log_scale, got 0, 1"),
        ({"values": [-1.0] * 5, "log_scale": True}, "log_scale: expected a number above 0 among the scalars, got none"),
        ({"values": [-1.7e308, 1.7e308, 0, 0, 0]}, "scalars: expected numbers whose range is finite"),
        ({"cmap": "virdis"}, "got 'virdis'; did you mean viridis?"),
        ({"cmap": 3}, "cmap: expected a name, a list of colours or a map, got int"),
        ({"cmap": []}, "cmap: expected 1..16,382 colours, got 0"),
        (
            {"cmap": ["red", "rad"]},
            "cmap: expected R,G,B in 0..1, #rrggbb or a colour name, got 'rad'; did you mean red?",
        ),
        ({"n_colors": 0}, "n_colors: expected 1..16382, got 0"),
        ({"nan_color": (1, 2, 3)}, "nan_color: expected text, or 3 or 4 numbers 0..1, got (1, 2, 3)"),
        ({"opacity": 2}, "opacity: expected 0..1, got 2"),
        ({"opacity": "linar"}, "got 'linar'; did you mean linear?"),
        ({"opacity": [0, 2, 1]}, "opacity: expected numbers 0..1, got 0 to 2"),
        ({"opacity": np.zeros(300)}, "opacity: expected 1..256 numbers for 256 colours, got [300]"),
        ({"preference": "cell"}, "preference: expected one of vertex, face; got 'cell'"),
    ],
)
def test_errors_are_one_line(options: dict[str, Any], error: str) -> None:
    with pytest.raises(clpeel.InputError) as caught:
        clpeel.with_scalars(TENT, **{"values": NUMBERS, **options})
    assert error in str(caught.value) and "\n" not in str(caught.value)


def test_options_of_scalars_need_them() -> None:
    with pytest.raises(clpeel.InputError, match="cmap: expected scalars with it, got none"):
        clpeel.load(TENT, cmap="gray")
