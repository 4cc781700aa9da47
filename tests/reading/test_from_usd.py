"""USD: stages that usd-core writes come as they say: places, polygons, colours, materials, instances."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import clpeel
from clpeel.command.main import main
from clpeel.scene.textures import srgb

pytest.importorskip("pxr", reason="needs pip install 'clpeel[usd]'")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, UsdUtils, Vt

QUAD = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 0, 1]], np.float64)
COUNTS, CORNERS = [4, 3], [0, 1, 2, 3, 0, 1, 4]
TRIANGLES = QUAD[[[0, 1, 2], [0, 2, 3], [0, 1, 4]]]
OF_CORNERS = [0, 1, 2, 0, 2, 3, 4, 5, 6]
"""The corners of the polygons that the triangles' corners are."""

TYPES = Sdf.ValueTypeNames


@pytest.fixture
def stage(tmp_path: Path) -> Usd.Stage:
    return Usd.Stage.CreateNew(str(tmp_path / "a.usda"))


def mesh(stage: Usd.Stage, path: str = "/quad", scheme: str = "none") -> UsdGeom.Mesh:
    """A quadrilateral in the plane of x and y, and a triangle on its lower edge."""
    made = UsdGeom.Mesh.Define(stage, path)
    made.CreatePointsAttr(QUAD)
    made.CreateFaceVertexCountsAttr(COUNTS)
    made.CreateFaceVertexIndicesAttr(CORNERS)
    made.CreateSubdivisionSchemeAttr(scheme)
    return made


def load(stage: Usd.Stage) -> clpeel.Scene:
    stage.GetRootLayer().Save()
    return clpeel.load(stage.GetRootLayer().realPath)


def corners(scene: clpeel.Scene) -> np.ndarray:
    return scene.vertices[scene.faces]


def surface(stage: Usd.Stage, path: str, **inputs: Any) -> UsdShade.Material:
    """A material of UsdPreviewSurface. inputs: a colour, a number, or the output of a texture."""
    made, shader = UsdShade.Material.Define(stage, path), UsdShade.Shader.Define(stage, f"{path}/surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    for name, value in inputs.items():
        kind = TYPES.Color3f if name.endswith("Color") else TYPES.Normal3f if name == "normal" else TYPES.Float
        given = shader.CreateInput(name, kind)
        given.ConnectToSource(value) if isinstance(value, UsdShade.Output) else given.Set(value)
    made.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    return made


def reader(stage: Usd.Stage, path: str, name: str, kind: str = "float2") -> UsdShade.Shader:
    made = UsdShade.Shader.Define(stage, path)
    made.CreateIdAttr(f"UsdPrimvarReader_{kind}")
    made.CreateInput("varname", TYPES.String).Set(name)
    return made


def texture(
    stage: Usd.Stage, path: str, file: str, st: UsdShade.Shader | None = None, **inputs: Any
) -> UsdShade.Shader:
    made = UsdShade.Shader.Define(stage, path)
    made.CreateIdAttr("UsdUVTexture")
    made.CreateInput("file", TYPES.Asset).Set(file)
    st = st or reader(stage, f"{path}_st", "st")
    made.CreateInput("st", TYPES.Float2).ConnectToSource(st.ConnectableAPI(), "result")
    for name, value in inputs.items():
        made.CreateInput(name, TYPES.Token if isinstance(value, str) else TYPES.Float4).Set(value)
    return made


def bind(prim: Any, material: UsdShade.Material) -> None:
    UsdShade.MaterialBindingAPI.Apply(prim.GetPrim()).Bind(material)


def coordinates(of: Any, name: str = "st") -> np.ndarray:
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0], [1, 0], [0, 0.5]])
    UsdGeom.PrimvarsAPI(of).CreatePrimvar(name, TYPES.TexCoord2fArray, "faceVarying").Set(
        Vt.Vec2fArray([Gf.Vec2f(*map(float, each)) for each in uv])
    )
    return uv


def save(path: Path, *rgba: int) -> None:
    from PIL import Image

    Image.new("RGBA", (2, 2), rgba).save(path)


# --- places -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("extension", ["usda", "usdc", "usd"])
def test_polygons_stay_polygons_where_their_prim_stands(extension: str, tmp_path: Path) -> None:
    """A prim that is turned by 90 degrees about Z, then moved."""
    stage = Usd.Stage.CreateNew(str(tmp_path / f"a.{extension}"))
    above = UsdGeom.Xform.Define(stage, "/above")
    above.AddTranslateOp().Set((5, 6, 7))
    above.AddRotateZOp().Set(90)
    mesh(stage, "/above/quad")
    scene = load(stage)
    x, y, z = np.moveaxis(TRIANGLES, -1, 0)
    np.testing.assert_allclose(corners(scene), np.stack([5 - y, 6 + x, 7 + z], axis=-1), atol=1e-12)
    assert scene.polygons is not None and scene.polygons.tolist() == [0, 0, 1]
    assert scene.materials == () and scene.notes == () and scene.single_sided is None


def test_a_stage_whose_z_is_up_is_turned(stage: Usd.Stage) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    mesh(stage)
    x, y, z = np.moveaxis(TRIANGLES, -1, 0)
    np.testing.assert_allclose(corners(load(stage)), np.stack([x, z, -y], axis=-1), atol=1e-12)


def test_left_handed_corners_are_turned_and_holes_are_left_out(stage: Usd.Stage) -> None:
    made = mesh(stage)
    made.CreateOrientationAttr(UsdGeom.Tokens.leftHanded)
    made.CreateHoleIndicesAttr([1])
    np.testing.assert_array_equal(corners(load(stage)), TRIANGLES[:2, ::-1])


def test_invisible_prims_and_those_of_other_purposes_are_not_drawn(stage: Usd.Stage) -> None:
    for number, name in enumerate(("shown", "gone", "stand_in", "help", "fine")):
        UsdGeom.XformCommonAPI(mesh(stage, f"/{name}/quad")).SetTranslate((0, 0, number))
        stage.GetPrimAtPath(f"/{name}").SetTypeName("Xform")
    UsdGeom.Imageable(stage.GetPrimAtPath("/gone")).MakeInvisible()
    for name, purpose in (("stand_in", "proxy"), ("help", "guide"), ("fine", "render")):
        UsdGeom.Imageable(stage.GetPrimAtPath(f"/{name}")).CreatePurposeAttr(purpose)
    scene = load(stage)
    np.testing.assert_array_equal(corners(scene), np.concatenate([TRIANGLES, TRIANGLES + [0, 0, 4]]))
    assert scene.notes == ("not shown, as the stage says: 1 invisible, 1 of purpose proxy, 1 of purpose guide",)


def test_references_and_instances_are_drawn_and_missing_ones_named(stage: Usd.Stage, tmp_path: Path) -> None:
    other = Usd.Stage.CreateNew(str(tmp_path / "other.usda"))
    other.SetDefaultPrim(mesh(other).GetPrim())
    other.GetRootLayer().Save()
    for number in (0, 1):
        prim = UsdGeom.Xform.Define(stage, f"/copy{number}").GetPrim()
        UsdGeom.XformCommonAPI(prim).SetTranslate((0, 0, 10 * number))
        inner = stage.DefinePrim(f"/copy{number}/held")
        inner.GetReferences().AddReference("./other.usda")
        prim.SetInstanceable(True)
    stage.DefinePrim("/lost").GetReferences().AddReference("./none.usda")
    scene = load(stage)
    np.testing.assert_allclose(corners(scene), np.concatenate([TRIANGLES, TRIANGLES + [0, 0, 10]]), atol=1e-12)
    (note,) = (note for note in scene.notes if not note.startswith("duplicate"))
    assert "none.usda" in note and "\n" not in note


def test_point_instancers_draw_their_prototypes_where_they_say(stage: Usd.Stage) -> None:
    """Prototypes are drawn by their instances alone, with their own transforms. One instance is masked."""
    made = UsdGeom.PointInstancer.Define(stage, "/many")
    UsdGeom.XformCommonAPI(made).SetTranslate((100, 0, 0))
    for name in ("one", "two"):
        mesh(stage, f"/many/{name}/quad")
        stage.GetPrimAtPath(f"/many/{name}").SetTypeName("Xform")
    UsdGeom.XformCommonAPI(stage.GetPrimAtPath("/many/two")).SetTranslate((0, 0, 0.5))
    made.CreatePrototypesRel().SetTargets(["/many/one", "/many/two"])
    made.CreateProtoIndicesAttr([0, 1, 0, 0])
    made.CreatePositionsAttr([(1, 0, 0), (2, 0, 0), (3, 0, 0), (4, 0, 0)])
    made.CreateIdsAttr([10, 11, 12, 13])
    made.InvisId(12, Usd.TimeCode.Default())
    offsets = [(101, 0, 0), (104, 0, 0), (102, 0, 0.5)]
    np.testing.assert_allclose(corners(load(stage)), np.concatenate([TRIANGLES + each for each in offsets]), atol=1e-6)


def test_values_that_change_are_those_of_the_first_moment(stage: Usd.Stage) -> None:
    made = mesh(stage)
    move = made.AddTranslateOp()
    for time in (3, 9):
        move.Set((0, 0, time), time)
    np.testing.assert_allclose(corners(load(stage)), TRIANGLES + [0, 0, 3], atol=1e-12)
    stage.SetStartTimeCode(6)
    stage.SetEndTimeCode(9)
    np.testing.assert_allclose(corners(load(stage)), TRIANGLES + [0, 0, 6], atol=1e-12)


# --- colours ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("how", "at"),
    [
        ("constant", [0] * 9),
        ("uniform", [0] * 6 + [1] * 3),
        ("vertex", [0, 1, 2, 0, 2, 3, 0, 1, 4]),
        ("faceVarying", OF_CORNERS),
    ],
)
def test_colours_are_linear_and_lie_as_their_interpolation_says(how: str, at: list[int], stage: Usd.Stage) -> None:
    made = mesh(stage)
    rgb = np.linspace(0, 1, 3 * (max(at) + 1)).reshape(-1, 3).astype(np.float32)
    primvar = made.CreateDisplayColorPrimvar(how)
    primvar.Set(Vt.Vec3fArray.FromNumpy(rgb))
    made.CreateDisplayOpacityPrimvar("constant").Set([0.5])
    scene = load(stage)
    colors = (
        np.broadcast_to(scene.color, (len(scene.vertices), 4)) if scene.vertex_colors is None else scene.vertex_colors
    )
    expected = np.concatenate([srgb(rgb[at]), np.full((9, 1), 0.5)], axis=1)
    np.testing.assert_allclose(colors[scene.faces].reshape(-1, 4), expected, atol=1e-6)


def test_normals_of_corners_split_vertices(stage: Usd.Stage) -> None:
    made = mesh(stage)
    made.CreateNormalsAttr([(0, 0, 1)] * 4 + [(0, -1, 0)] * 3)
    made.SetNormalsInterpolation("faceVarying")
    scene = load(stage)
    assert scene.vertex_normals is not None and len(scene.vertices) == 7
    expected = [[0, 0, 1]] * 6 + [[0, -1, 0]] * 3
    np.testing.assert_allclose(scene.vertex_normals[scene.faces].reshape(-1, 3), expected, atol=1e-6)


# --- materials --------------------------------------------------------------------------------------------------------


def test_surfaces_have_their_numbers_and_subsets_their_own(stage: Usd.Stage) -> None:
    glass = surface(stage, "/glass", diffuseColor=(0.1, 0.2, 0.3), opacity=0.25, roughness=0.1, metallic=1.0)
    bright = surface(stage, "/bright", emissiveColor=(2, 1, 0))
    made = mesh(stage)
    bind(made, glass)
    subset = UsdShade.MaterialBindingAPI(made.GetPrim()).CreateMaterialBindSubset("part", Vt.IntArray([1]))
    bind(subset, bright)
    scene = load(stage)
    assert scene.face_materials is not None
    first, _, last = (scene.materials[place] for place in scene.face_materials)
    np.testing.assert_allclose(first.base_color, [0.1, 0.2, 0.3, 1], atol=1e-7)
    assert (first.name, first.alpha_mode, first.opacity) == ("glass", "OPAQUE", 0.25)
    assert first.finish is not None and last.finish is not None
    np.testing.assert_allclose([first.finish.metallic, first.finish.roughness], [1, 0.1], atol=1e-7)
    np.testing.assert_allclose(last.base_color[:3], [0.18] * 3, atol=1e-7)  # what the specification says by default
    assert (last.finish.metallic, last.finish.roughness, last.finish.emissive) == (0, 0.5, (2, 1, 0))
    assert scene.surfaces == "mixed" and scene.notes == ()


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("threshold", [0.0, 0.5])
def test_textures_are_found_and_lie_as_the_coordinates_say(
    packed: bool, threshold: float, stage: Usd.Stage, tmp_path: Path
) -> None:
    """By two sets of coordinates, of which one is scaled by 2, turned by 90 degrees, then moved. v points down here."""
    save(tmp_path / "color.png", 255, 128, 0, 64)
    save(tmp_path / "bumps.png", 128, 128, 255, 255)
    turn = UsdShade.Shader.Define(stage, "/turn")
    turn.CreateIdAttr("UsdTransform2d")
    for name, kind, value in (
        ("scale", TYPES.Float2, (2, 2)),
        ("rotation", TYPES.Float, 90),
        ("translation", TYPES.Float2, (0.25, 0.5)),
    ):
        turn.CreateInput(name, kind).Set(value)
    turn.CreateInput("in", TYPES.Float2).ConnectToSource(reader(stage, "/other", "fine").ConnectableAPI(), "result")
    plain = texture(stage, "/plain", "./color.png", wrapS="mirror", wrapT="clamp")
    bumps = texture(stage, "/bumps", "./bumps.png", turn, sourceColorSpace="raw")
    outputs = {name: plain.CreateOutput(name, TYPES.Float3 if name == "rgb" else TYPES.Float) for name in ("rgb", "a")}
    made = mesh(stage)
    bind(
        made,
        surface(
            stage,
            "/look",
            diffuseColor=outputs["rgb"],
            opacity=outputs["a"],
            opacityThreshold=threshold,
            normal=bumps.CreateOutput("rgb", TYPES.Float3),
        ),
    )
    uv, fine = coordinates(made), coordinates(made, "fine")
    scene = load(stage)
    if packed:
        target = tmp_path / "alone" / "a.usdz"
        target.parent.mkdir()
        assert UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(tmp_path / "a.usda")), str(target))
        scene = clpeel.load(target)
    (only,) = scene.materials
    assert only.texture is not None and only.finish is not None and only.finish.normal_texture is not None
    assert only.texture.image[0, 0].tolist() == [255, 128, 0, 64] and only.texture.wrap == ("mirror", "clamp")
    assert (only.alpha_mode, only.base_color) == ("MASK" if threshold else "BLEND", (1, 1, 1, 1))
    assert only.finish.normal_texture.image[0, 0].tolist() == [128, 128, 255, 255]
    assert scene.uv is not None and len(scene.more_uv) == only.finish.normal_uv == 1 and scene.notes == ()
    np.testing.assert_allclose(scene.uv[scene.faces].reshape(-1, 2), (uv * [1, -1] + [0, 1])[OF_CORNERS], atol=1e-6)
    turned = np.stack([0.25 - 2 * fine[:, 1], 1 - (0.5 + 2 * fine[:, 0])], axis=1)
    np.testing.assert_allclose(scene.more_uv[0][scene.faces].reshape(-1, 2), turned[OF_CORNERS], atol=1e-6)


def test_metallic_and_roughness_may_be_channels_of_any_pictures(stage: Usd.Stage, tmp_path: Path) -> None:
    save(tmp_path / "rough.png", 51, 0, 0, 255)
    save(tmp_path / "metal.png", 0, 0, 0, 204)
    inputs = {
        "roughness": texture(stage, "/r", "./rough.png").CreateOutput("r", TYPES.Float),
        "metallic": texture(stage, "/m", "./metal.png").CreateOutput("a", TYPES.Float),
    }
    made = mesh(stage)
    coordinates(made)
    bind(made, surface(stage, "/look", **inputs))
    finish = load(stage).materials[0].finish
    assert finish is not None and finish.metallic_roughness_texture is not None
    np.testing.assert_allclose(finish.metallic_roughness_texture.image[0, 0, 1:3], [0.2, 0.8], atol=1e-6)
    assert (finish.metallic, finish.roughness) == (1, 1)


def test_what_is_not_drawn_is_named(stage: Usd.Stage) -> None:
    made = mesh(stage, scheme="catmullClark")
    UsdSkel.BindingAPI.Apply(made.GetPrim())
    bind(made, surface(stage, "/look", clearcoat=1.0))
    stage.DefinePrim("/patch", "NurbsPatch")
    stage.DefinePrim("/sun", "DistantLight")
    other = mesh(stage, "/second")
    UsdGeom.XformCommonAPI(other).SetTranslate((9, 9, 9))
    strange = UsdShade.Material.Define(stage, "/strange")
    shader = UsdShade.Shader.Define(stage, "/strange/shader")
    shader.CreateIdAttr("ND_standard_surface_surfaceshader")
    strange.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    bind(other, strange)
    assert load(stage).notes == (
        "left out: 1 DistantLight, 1 NurbsPatch",
        "subdivision surfaces are drawn as their cages (1 shape)",
        "skinned meshes are drawn in their bind pose (1 shape)",
        "clearcoat of material 'look' left out",
        "material '/strange' left out: its shader is 'ND_standard_surface_surfaceshader', not UsdPreviewSurface",
    )


# --- other shapes -----------------------------------------------------------------------------------------------------


def test_points_and_curves_become_points_and_lines(stage: Usd.Stage) -> None:
    dots = UsdGeom.Points.Define(stage, "/dots")
    dots.CreatePointsAttr([(0, 0, 5), (1, 0, 5)])
    curves = UsdGeom.BasisCurves.Define(stage, "/curves")
    curves.CreatePointsAttr([(0, 0, 0), (1, 0, 0), (1, 1, 0), (3, 0, 0), (4, 0, 0)])
    curves.CreateCurveVertexCountsAttr([3, 2])
    curves.CreateTypeAttr("linear")
    curves.CreateWidthsAttr([0.1])
    bind(curves, surface(stage, "/look", diffuseColor=(1, 0, 0), opacity=0.5))
    dots.CreateDisplayColorAttr([(0, 1, 0)])
    scene = load(stage)
    assert scene.face_colors is not None
    np.testing.assert_allclose(scene.face_colors, [[1, 0, 0, 0.5]] * 3 + [[0, 1, 0, 1]] * 2)
    assert scene.lines is not None and scene.points is not None
    segments = [[(0, 0, 0), (1, 0, 0)], [(1, 0, 0), (1, 1, 0)], [(3, 0, 0), (4, 0, 0)]]
    assert sorted(scene.vertices[scene.lines].tolist()) == np.array(segments, float).tolist()
    assert scene.vertices[scene.points].tolist() == [[0, 0, 5], [1, 0, 5]]
    assert [note for note in scene.notes if note.startswith("widths of BasisCurves left out")]


@pytest.mark.parametrize(
    ("kind", "of", "bounds", "volume"),
    [
        ("Sphere", {"radius": 2.0}, [2, 2, 2], 4 / 3 * np.pi * 8),
        ("Cube", {"size": 3.0}, [1.5, 1.5, 1.5], 27),
        ("Cylinder", {"radius": 1.0, "height": 4.0, "axis": "X"}, [2, 1, 1], 4 * np.pi),
        ("Cone", {"radius": 1.0, "height": 4.0, "axis": "Y"}, [1, 2, 1], 4 / 3 * np.pi),
        ("Capsule", {"radius": 1.0, "height": 4.0, "axis": "Z"}, [1, 1, 3], 4 * np.pi + 4 / 3 * np.pi),
    ],
)
def test_solids_have_their_size_and_face_outwards(
    kind: str, of: dict[str, Any], bounds: list[float], volume: float, stage: Usd.Stage
) -> None:
    prim = stage.DefinePrim("/solid", kind)
    for name, value in of.items():
        prim.GetAttribute(name).Set(value)
    scene = load(stage)
    np.testing.assert_allclose(scene.bounds, [np.negative(bounds), bounds], atol=0.01)
    a, b, c = np.moveaxis(corners(scene), 1, 0)
    assert np.einsum("mc,mc->m", a, np.cross(b, c)).sum() / 6 == pytest.approx(volume, rel=0.02)


def test_the_apex_of_a_cone_points_along_its_axis(stage: Usd.Stage) -> None:
    stage.DefinePrim("/solid", "Cone").GetAttribute("axis").Set("X")
    scene = load(stage)
    apex = scene.vertices[scene.vertices[:, 0] > 0.99]
    np.testing.assert_allclose(apex, np.broadcast_to([1, 0, 0], apex.shape), atol=1e-9)


# --- damage -----------------------------------------------------------------------------------------------------------


def test_damaged_files_are_one_line(stage: Usd.Stage, tmp_path: Path, capfd: Any) -> None:
    mesh(stage).CreateFaceVertexIndicesAttr([0, 1, 2, 99, 0, 1, 4])
    stage.GetRootLayer().Save()
    stage.GetRootLayer().Export(str(tmp_path / "b.usdc"))
    (tmp_path / "cut.usdc").write_bytes((tmp_path / "b.usdc").read_bytes()[:200])
    (tmp_path / "words.usda").write_text("#usda 1.0\nthese are words\n")
    (tmp_path / "words.usd").write_text("these are words\n")
    shutil.copy(tmp_path / "a.usda", tmp_path / "no.usdz")
    for name in ("a.usda", "b.usdc", "cut.usdc", "words.usda", "words.usd", "no.usdz"):
        assert main(["render", str(tmp_path / name), "-o", str(tmp_path / "x.png")]) == 2
        out, err = capfd.readouterr()
        assert out == "" and err.startswith(f"clpeel: error: {tmp_path / name}: "), err
        assert err.count("\n") == 1 and len(err) < 400 + len(str(tmp_path))


def test_references_to_pipes_do_not_block(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.usda")
    for name, other in (("c", "between"), ("between", "pipe")):
        text = f'#usda 1.0\ndef "a" (references = @./{other}.usda@) {{\n}}\ndef Sphere "s" {{\n}}\n'
        (tmp_path / f"{name}.usda").write_text(text)
    with pytest.raises(clpeel.InputError, match=r"expected references to regular files, got './pipe\.usda'"):
        clpeel.load(tmp_path / "c.usda")


def test_an_instancer_that_draws_itself_is_damage(stage: Usd.Stage) -> None:
    made = UsdGeom.PointInstancer.Define(stage, "/many")
    made.CreatePrototypesRel().SetTargets(["/many"])
    made.CreateProtoIndicesAttr([0, 0])
    made.CreatePositionsAttr([(1, 0, 0), (2, 0, 0)])
    with pytest.raises(clpeel.InputError, match="/many: it draws itself"):
        load(stage)


def test_copies_keep_their_polygons_and_colours_apart(stage: Usd.Stage) -> None:
    made = UsdGeom.PointInstancer.Define(stage, "/many")
    mesh(stage, "/many/quad").CreateDisplayColorPrimvar("uniform").Set([(1, 0, 0), (0, 0, 1)])
    made.CreatePrototypesRel().SetTargets(["/many/quad"])
    made.CreateProtoIndicesAttr([0, 0])
    made.CreatePositionsAttr([(0, 0, 0), (9, 0, 0)])
    made.CreateScalesAttr([(1, 1, 1), (-1, 1, 1)])
    scene = load(stage)
    assert scene.polygons is not None and scene.polygons.tolist() == [0, 0, 1, 2, 2, 3]
    assert scene.vertex_colors is not None
    first = [[1, 0, 0, 1]] * 6 + [[0, 0, 1, 1]] * 3
    assert scene.vertex_colors[scene.faces].reshape(-1, 4).tolist() == first * 2
    mirrored = (TRIANGLES * [-1, 1, 1] + [9, 0, 0])[:, [0, 2, 1]]
    np.testing.assert_allclose(corners(scene), np.concatenate([TRIANGLES, mirrored]), atol=1e-6)


def test_an_empty_stage_says_so(stage: Usd.Stage) -> None:
    stage.DefinePrim("/sun", "SphereLight")
    with pytest.raises(clpeel.InputError, match="expected meshes, got left out: 1 SphereLight; the stage is empty"):
        load(stage)
