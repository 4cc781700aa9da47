"""FBX: files that the tests write themselves come as the format says: places, polygons, colours and textures."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading import fbxs
from reading.fbxs import color, geometry, layer, material, model, node, number, properties, scene, vector

import clpeel
from clpeel.command.main import main
from clpeel.scene.textures import linear

pytest.importorskip("ufbx", reason="needs pip install 'clpeel[fbx]'")

Written = Callable[..., clpeel.Scene]


@pytest.fixture(params=["text", "binary"])
def load(request: pytest.FixtureRequest, tmp_path: Path) -> Written:
    def written(nodes: list[fbxs.Node]) -> clpeel.Scene:
        (tmp_path / "a.fbx").write_bytes(getattr(fbxs, request.param)(nodes))
        return clpeel.load(tmp_path / "a.fbx")

    return written


def corners(loaded: clpeel.Scene) -> np.ndarray:
    return loaded.vertices[loaded.faces]


TRIANGLES = fbxs.QUAD[[[0, 1, 2], [0, 2, 3], [0, 1, 4]]]


def test_polygons_stay_polygons_where_their_node_stands(load: Written) -> None:
    """A node that is scaled by 2, turned by 90 degrees about Z, and moved, in this order."""
    at = model(
        20,
        "box",
        **{
            "Lcl Translation": vector(5.0, 6.0, 7.0),
            "Lcl Rotation": vector(0.0, 0.0, 90.0),
            "Lcl Scaling": vector(2.0, 2.0, 2.0),
        },
    )
    loaded = load(scene(geometry(), at, links=[(10, 20), (20, 0)]))
    x, y, z = np.moveaxis(TRIANGLES, -1, 0)
    np.testing.assert_allclose(corners(loaded), np.stack([5 - 2 * y, 6 + 2 * x, 7 + 2 * z], axis=-1), atol=1e-6)
    assert loaded.polygons is not None and loaded.polygons.tolist() == [0, 0, 1]
    assert loaded.materials == () and loaded.notes == () and loaded.vertex_normals is None


def test_a_file_whose_z_is_up_is_turned(load: Written) -> None:
    loaded = load(scene(geometry(), model(20, "box"), links=[(10, 20), (20, 0)], up=2))
    x, y, z = np.moveaxis(TRIANGLES, -1, 0)
    np.testing.assert_allclose(corners(loaded), np.stack([x, z, -y], axis=-1), atol=1e-12)


def test_nodes_that_share_a_mesh_are_drawn_each_and_hidden_ones_are_named(load: Written) -> None:
    moved = model(21, "moved", **{"Lcl Translation": vector(0.0, 0.0, 3.0)})
    hidden = model(22, "ghost", Visibility=("Visibility", (0.0,)))
    links = [(10, 20), (10, 21), (10, 22), (20, 0), (21, 0), (22, 0)]
    loaded = load(scene(geometry(), model(20, "box"), moved, hidden, links=links))
    np.testing.assert_allclose(corners(loaded), np.concatenate([TRIANGLES, TRIANGLES + [0, 0, 3]]), atol=1e-12)
    assert loaded.notes == ("hidden and left out: 'ghost'",)


def test_normals_texture_coordinates_and_colours_are_those_of_corners(load: Written) -> None:
    """Polygons meet along an edge with two normals, so its ends are two vertices each. v points down in a scene."""
    normals = np.array([[0, 0, 1.0]] * 4 + [[0, -1, 0.0]] * 3)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0], [1, 0], [0, 0.5]])
    rgba = np.array([[1, 0, 0, 1], [0, 1, 0, 0.5]], np.float64)
    layers = [
        layer("LayerElementNormal", ("ByPolygonVertex", "Direct"), Normals=normals.reshape(-1)),
        layer(
            "LayerElementUV", ("ByPolygonVertex", "IndexToDirect"), UV=uv.reshape(-1), UVIndex=np.arange(7, dtype=int)
        ),
        layer(
            "LayerElementColor",
            ("ByPolygonVertex", "IndexToDirect"),
            Colors=rgba.reshape(-1),
            ColorIndex=np.array([0, 0, 0, 0, 1, 1, 1]),
        ),
    ]
    loaded = load(scene(geometry(*layers), model(20, "box"), links=[(10, 20), (20, 0)]))
    at = [0, 1, 2, 0, 2, 3, 4, 5, 6]
    assert loaded.vertex_normals is not None and loaded.vertex_colors is not None
    np.testing.assert_array_equal(loaded.vertex_normals[loaded.faces].reshape(-1, 3), normals[at])
    np.testing.assert_array_equal(loaded.vertex_colors[loaded.faces].reshape(-1, 4), rgba[[0] * 6 + [1] * 3])
    assert len(loaded.vertices) == 7


@pytest.mark.parametrize(
    ("says", "alpha"),
    [
        ({"TransparencyFactor": number(0.25)}, 0.75),
        ({"TransparencyFactor": number(0.0), "Opacity": number(0.4)}, 0.4),
        ({"TransparencyFactor": number(1.0), "Opacity": number(0.4)}, 0.4),
        ({"TransparencyFactor": number(1.0), "TransparentColor": color(0.3, 0.3, 0.3)}, 0.7),
        ({}, 1.0),
    ],
)
def test_materials_have_their_colour_and_an_opacity_however_it_is_written(
    load: Written, says: dict[str, Any], alpha: float
) -> None:
    of_faces = layer("LayerElementMaterial", ("ByPolygon", "IndexToDirect"), Materials=np.array([1, 0]))
    red, glass = material(30, "red", DiffuseColor=color(1.0, 0.0, 0.0)), material(31, "glass", **says)
    glass.within[1].within.append(node("P", "DiffuseColor", "Color", "", "A", 0.0, 0.5, 1.0))
    links = [(10, 20), (20, 0), (30, 20), (31, 20)]
    loaded = load(scene(geometry(of_faces), model(20, "box"), red, glass, links=links))
    assert loaded.face_materials is not None
    found = [loaded.materials[place] for place in loaded.face_materials]
    assert [each.name for each in found] == ["glass", "glass", "red"]
    np.testing.assert_allclose(found[0].base_color, [0, linear(0.5), 1, alpha], atol=1e-7)
    assert found[0].alpha_mode == ("OPAQUE" if alpha == 1 else "BLEND")
    assert found[2].base_color == (1, 0, 0, 1)


def picture(*rgba: int) -> bytes:
    from PIL import Image

    data = io.BytesIO()
    Image.new("RGBA", (2, 3), rgba).save(data, "PNG")
    return data.getvalue()


@pytest.mark.parametrize("embedded", [False, True])
def test_textures_lie_beside_the_file_or_in_it(embedded: bool, tmp_path: Path) -> None:
    """A texture stands for the colour, which is red. Without its picture, the colour is drawn, and a note says so."""
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0], [1, 0], [0, 0.25]])
    coordinates = layer("LayerElementUV", ("ByPolygonVertex", "Direct"), UV=uv.reshape(-1))
    names = [node("FileName", "C:\\away\\t.png"), node("RelativeFilename", "maps\\t.png")]
    content = [node("Content", picture(0, 255, 0, 128))] if embedded else []
    texture = node("Texture", 40, "Texture::t", "", within=[*names])
    video = node("Video", 50, "Video::t", "Clip", within=[node("Type", "Clip"), *names, *content])
    links = [(10, 20), (20, 0), (30, 20), (40, 30, "DiffuseColor"), (50, 40)]
    objects = [geometry(coordinates), model(20, "box"), material(30, "red", DiffuseColor=color(1.0, 0.0, 0.0))]
    (tmp_path / "a.fbx").write_bytes(fbxs.binary(scene(*objects, texture, video, links=links)))
    bare = clpeel.load(tmp_path / "a.fbx")
    if not embedded:
        assert bare.materials[0].texture is None and bare.materials[0].base_color == (1, 0, 0, 1)
        assert [note for note in bare.notes if "t.png" in note and "no such file" in note]
        (tmp_path / "maps").mkdir()
        (tmp_path / "maps" / "t.png").write_bytes(picture(0, 255, 0, 128))
    loaded = clpeel.load(tmp_path / "a.fbx")
    (only,) = loaded.materials
    assert only.texture is not None and only.texture.image[0, 0].tolist() == [0, 255, 0, 128]
    assert only.base_color == (1, 1, 1, 1) and only.alpha_mode == "BLEND" and loaded.notes == ()
    assert loaded.uv is not None
    expected = (uv * [1, -1] + [0, 1])[[0, 1, 2, 0, 2, 3, 4, 5, 6]]
    np.testing.assert_allclose(loaded.uv[loaded.faces].reshape(-1, 2), expected, atol=1e-6)


def test_skinned_meshes_stand_as_their_joints_do(load: Written) -> None:
    """A joint that was bound at the origin has moved by (0, 0, 7). It takes the first four points with it."""
    eye, indices, weights = np.eye(4).reshape(-1), np.arange(4), np.ones(4)
    held = [node("Indexes", indices), node("Weights", weights), node("Transform", eye), node("TransformLink", eye)]
    skin = node("Deformer", 80, "Deformer::skin", "Skin", within=[node("Link_DeformAcuracy", 50.0)])
    cluster = node("Deformer", 81, "SubDeformer::part", "Cluster", within=held)
    place = properties(**{"Lcl Translation": vector(0.0, 0.0, 7.0)})
    joint = node("Model", 90, "Model::joint", "LimbNode", within=[node("Version", 232), place])
    links = [(10, 20), (20, 0), (80, 10), (81, 80), (90, 81), (90, 0)]
    loaded = load(scene(geometry(), model(20, "box"), skin, cluster, joint, links=links))
    moved = np.where(np.arange(5)[:, None] < 4, fbxs.QUAD + [0, 0, 7], fbxs.QUAD)
    np.testing.assert_allclose(corners(loaded), moved[[[0, 1, 2], [0, 2, 3], [0, 1, 4]]], atol=1e-6)


def test_what_is_not_drawn_is_named(load: Written) -> None:
    light = node("NodeAttribute", 60, "NodeAttribute::sun", "Light", within=[node("TypeFlags", "Light")])
    holder = node("Model", 61, "Model::sun", "Light", within=[node("Version", 232)])
    stack = node("AnimationStack", 70, "AnimStack::walk", "")
    links = [(10, 20), (20, 0), (60, 61), (61, 0)]
    loaded = load(scene(geometry(), model(20, "box"), light, holder, stack, links=links))
    assert loaded.notes == ("left out: 1 lights, 1 animations",)


@pytest.mark.parametrize("cut", [0, 10, 200, 900, -40])
def test_damaged_files_are_one_line(cut: int, tmp_path: Path, capfd: Any) -> None:
    whole = fbxs.binary(scene(geometry(), model(20, "box"), links=[(10, 20), (20, 0)]))
    (tmp_path / "a.fbx").write_bytes(whole[:cut])
    assert main(["render", str(tmp_path / "a.fbx"), "-o", str(tmp_path / "a.png")]) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.startswith(f"clpeel: error: {tmp_path / 'a.fbx'}: not a readable mesh: ")
    assert err.count("\n") == 1 and not (tmp_path / "a.png").exists()


def test_a_file_with_nothing_to_draw_says_so(load: Written) -> None:
    with pytest.raises(clpeel.InputError, match="expected triangles or lines, got none; the mesh is empty"):
        load(scene(node("Model", 20, "Model::null", "Null", within=[node("Version", 232)]), links=[(20, 0)]))
