"""Scene: arrays are checked, files of every format come back as written, positions lose nothing that matters."""

from __future__ import annotations

import gzip
import math
import os
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.scene import Positions, Scene

trimesh = pytest.importorskip("trimesh")

ROOT = Path(__file__).resolve().parents[2]
MODELS = Path(os.environ.get("CLPEEL_SHARED", ROOT.parent / "shared")) / "models"

TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
TETRAHEDRON_FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
FORMATS = ("ply", "stl", "obj", "off", "glb", "gltf", "3mf")


def model(name: str) -> Path:
    """The path of a shared model; skips the test where there is none."""
    path = MODELS / name
    if not path.is_file():
        pytest.skip(f"needs the model {name} in a folder models below CLPEEL_SHARED (now {MODELS.parent})")
    return path


def tetrahedron(**options: Any) -> Any:
    """A trimesh tetrahedron, unprocessed."""
    return trimesh.Trimesh(TETRAHEDRON, TETRAHEDRON_FACES, process=False, **options)


def written(thing: Any, path: Path) -> Path:
    """A trimesh object exported to path, through gzip where it ends in .gz; glTF gets its buffers beside it."""
    kind = path.name.removesuffix(".gz").rsplit(".", 1)[1]
    data = thing.export(file_type=kind)
    if isinstance(data, dict):
        for name, part in data.items():
            if not name.endswith(".gltf"):
                (path.parent / name).write_bytes(part)
        (data,) = (part for name, part in data.items() if name.endswith(".gltf"))
    data = data.encode() if isinstance(data, str) else data
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return path


def triangles(scene: Scene) -> np.ndarray:
    """float64 [m, 3, 3], the corners of each face."""
    return scene.vertices[scene.faces]


def as_set(corners: np.ndarray) -> list[Any]:
    """Triangles in a canonical order that forgets the order of faces, and which corner is first."""
    rounded = np.round(corners, 6) + 0.0
    turned = [min(np.roll(t, k, axis=0).tolist() for k in range(3)) for t in rounded]
    return sorted(turned)


def message(error: pytest.ExceptionInfo[InputError]) -> str:
    """The error's text, which must be one line."""
    text = str(error.value)
    assert text and "\n" not in text and len(text) < 400
    assert error.value.exit_code == 2
    return text


# --- from_arrays ----------------------------------------------------------------------------------------------------


def test_from_arrays_keeps_what_it_is_given() -> None:
    vertices = TETRAHEDRON.astype(np.float32)
    scene = Scene.from_arrays(vertices, TETRAHEDRON_FACES.tolist())
    assert scene.vertices.dtype == np.float64 and scene.faces.dtype == np.int32
    assert scene.vertices.flags.c_contiguous and scene.faces.flags.c_contiguous
    np.testing.assert_array_equal(scene.vertices, vertices)
    np.testing.assert_array_equal(scene.faces, TETRAHEDRON_FACES)
    assert scene.color is not None and scene.color.dtype == np.uint8 and tuple(scene.color) == DEFAULT_COLOR
    assert scene.face_colors is None and scene.vertex_colors is None and scene.vertex_normals is None
    assert scene.opaque and scene.notes == ()


def test_from_arrays_does_not_copy_what_fits() -> None:
    faces = TETRAHEDRON_FACES.astype(np.int32)
    scene = Scene.from_arrays(TETRAHEDRON, faces)
    assert np.shares_memory(scene.vertices, TETRAHEDRON) and np.shares_memory(scene.faces, faces)


@pytest.mark.parametrize(
    ("given", "dtype", "want"),
    [
        ([10, 20, 30], np.uint8, [10, 20, 30, 255]),
        ([10, 20, 30, 40], np.uint8, [10, 20, 30, 40]),
        (np.array([0, 255, 7], np.int16), np.uint8, [0, 255, 7, 255]),
        ([0.25, 0.5, 1.0], np.float32, [0.25, 0.5, 1, 1]),
        (np.array([0.25, 0.5, 1, 0], np.float16), np.float32, [0.25, 0.5, 1, 0]),
    ],
)
@pytest.mark.parametrize(("name", "count"), [("color", 0), ("face_colors", 4), ("vertex_colors", 4)])
def test_colors_of_every_kind(name: str, count: int, given: Any, dtype: Any, want: list[float]) -> None:
    colors = np.tile(given, (count, 1)) if count else given
    scene = Scene.from_arrays(TETRAHEDRON, TETRAHEDRON_FACES, **{name: colors})
    got = getattr(scene, name)
    assert got.dtype == dtype
    np.testing.assert_array_equal(got, np.tile(want, (count, 1)) if count else want)
    assert scene.opaque == (want[3] in (1, 255))
    assert sum(c is not None for c in (scene.face_colors, scene.vertex_colors, scene.color)) == 1


def test_opacity_keeps_bytes_where_it_is_a_byte() -> None:
    exact = Scene.from_arrays(TETRAHEDRON, TETRAHEDRON_FACES, color=[1, 2, 3, 4], opacity=0.6)
    assert exact.color is not None and exact.color.dtype == np.uint8
    assert exact.color.tolist() == [1, 2, 3, 153]
    half = Scene.from_arrays(TETRAHEDRON, TETRAHEDRON_FACES, color=[51, 0, 255, 4], opacity=0.5)
    assert half.color is not None and half.color.dtype == np.float32
    np.testing.assert_array_equal(half.color, np.array([0.2, 0, 1, 0.5], np.float32))
    given = np.full((4, 4), 0.5, np.float32)
    scene = Scene.from_arrays(TETRAHEDRON, TETRAHEDRON_FACES, face_colors=given, opacity=0)
    assert scene.face_colors is not None and (scene.face_colors[:, 3] == 0).all()
    assert (given == 0.5).all(), "the caller's array was changed"


NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"vertices": [[0, 0]] * 3}, "vertices: expected [n, 3] real numbers, got [3, 2]"),
        ({"vertices": TETRAHEDRON * 1j}, "vertices: expected [n, 3] real numbers"),
        ({"vertices": "mesh"}, "vertices: expected [n, 3] real numbers"),
        ({"vertices": [[0, 0, 0], [1, 0]]}, "vertices: expected an array of numbers"),
        ({"vertices": np.zeros((0, 3))}, "faces: expected indices"),
        ({"faces": []}, "faces: expected at least one triangle, got none"),
        ({"faces": np.zeros((0, 3), int)}, "faces: expected at least one triangle, got none"),
        ({"faces": [[0, 1, 2, 3]]}, "faces: expected [m, 3] integers, got [1, 4]"),
        ({"faces": [[0.0, 1.0, 2.0]]}, "faces: expected [m, 3] integers, got [1, 3] float64"),
        ({"faces": [[0, 1, 2], [0, 1, -1]]}, "faces: expected indices 0..3, got -1 in face 1"),
        ({"faces": [[0, 1, 4]]}, "faces: expected indices 0..3, got 4 in face 0"),
        ({"faces": [[0, 1, 2**31]]}, "faces: expected indices 0..3, got 2147483648 in face 0"),
        ({"faces": np.array([[0, 1, 2**32 - 1]], np.uint32)}, "got 4294967295 in face 0"),
        ({"faces": np.array([[0, 1, 2**64 - 1]], np.uint64)}, "got 18446744073709551615 in face 0"),
        ({"color": [1, 2]}, "color: expected [3 or 4] integers 0..255 or floats 0..1, got [2] int64"),
        ({"color": [0, 0, 256]}, "color: expected integers 0..255, got 256"),
        ({"color": [0, 0, -1]}, "color: expected integers 0..255, got -1"),
        ({"color": [0.0, 0, 1.5]}, "color: expected floats 0..1, got 1.5"),
        ({"color": [0.0, 0, -0.1]}, "color: expected floats 0..1, got -0.1"),
        ({"color": [0.0, 0, NAN]}, "color: expected floats 0..1, got nan"),
        ({"color": [0.0, 0, 0, INF]}, "color: expected floats 0..1, got inf"),
        ({"color": "redd"}, "color: expected R,G,B in 0..1, #rrggbb or a colour name, got 'redd'; did you mean red?"),
        ({"color": [True, True, False]}, "color: expected [3 or 4] integers"),
        ({"face_colors": np.full((3, 4), 9)}, "face_colors: expected [4, 3 or 4] integers"),
        ({"face_colors": np.full((4, 4), NAN)}, "face_colors: expected floats 0..1, got nan"),
        ({"vertex_colors": np.full((5, 3), 9)}, "vertex_colors: expected [4, 3 or 4] integers"),
        ({"vertex_colors": np.full((4, 3), 1.01)}, "vertex_colors: expected floats 0..1, got 1.01"),
        ({"color": [0, 0, 0], "face_colors": np.full((4, 3), 9)}, "at most one of face_colors, vertex_colors, color"),
        ({"vertex_normals": np.zeros((3, 3))}, "vertex_normals: expected [4, 3] real numbers, got [3, 3]"),
        ({"opacity": 1.01}, "opacity: expected a number 0..1, got 1.01"),
        ({"opacity": -0.01}, "opacity: expected a number 0..1, got -0.01"),
        ({"opacity": NAN}, "opacity: expected a number 0..1, got nan"),
        ({"opacity": "half"}, "opacity: expected a number 0..1, got half"),
    ],
)
def test_bad_arrays_are_refused(options: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError) as error:
        Scene.from_arrays(**({"vertices": TETRAHEDRON, "faces": TETRAHEDRON_FACES} | options))
    assert says in message(error)


def test_bounds_are_of_finite_used_vertices() -> None:
    vertices = [[0, 0, 0], [1, 2, 3], [-1, 5, 0], [NAN, 50, 0], [0, INF, 0], [99, 99, 99]]
    scene = Scene.from_arrays(vertices, [[0, 1, 2], [2, 3, 4]])
    np.testing.assert_array_equal(scene.bounds, [[-1, 0, 0], [1, 5, 3]])
    lost = Scene.from_arrays(np.full((3, 3), NAN), [[0, 1, 2]])
    np.testing.assert_array_equal(lost.bounds, np.zeros((2, 3)))
    assert np.isnan(lost.positions().hi).all()


# --- positions ------------------------------------------------------------------------------------------------------


def points(*rows: Any) -> Scene:
    """A scene of one face a row, all of whose vertices are used."""
    vertices = np.array(rows, dtype=np.float64)
    index = np.arange(len(vertices))
    return Scene.from_arrays(vertices, np.stack([index, index, index], axis=1))


def restored(positions: Positions) -> np.ndarray:
    """The vertices that the device positions stand for, float64."""
    p = positions.hi.astype(np.float64) + (0 if positions.lo is None else positions.lo)
    return p / positions.scale + positions.origin


def test_positions_of_float32_input_are_exact_and_alone() -> None:
    rng = np.random.default_rng(1)
    vertices = rng.normal(size=(50, 3)).astype(np.float32)
    positions = points(*vertices).positions()
    assert positions.lo is None and positions.scale == 1 and not positions.origin.any()
    assert positions.hi.dtype == np.float32 and positions.origin.dtype == np.float64
    np.testing.assert_array_equal(positions.hi, vertices)


def test_positions_of_float64_input_have_a_remainder() -> None:
    positions = points([0.1, 0.2, 0.3], [1, 1, 1], [-1, -1, -1]).positions()
    assert positions.lo is not None and positions.lo.dtype == np.float32
    assert np.abs(restored(positions)[0] - [0.1, 0.2, 0.3]).max() < 2.0**-48


def test_detail_far_from_the_origin_survives() -> None:
    rng = np.random.default_rng(2)
    detail = rng.integers(-1000, 1000, size=(100, 3)) * 1e-3
    vertices = np.array([1e8, -1e8, 3e8]) + detail
    positions = points(*vertices).positions()
    assert positions.scale == 1
    assert np.abs(positions.hi).max() < 4, "not re-centred"
    np.testing.assert_array_equal(restored(positions), vertices)


def test_float32_input_far_from_the_origin_needs_no_remainder() -> None:
    rng = np.random.default_rng(3)
    vertices = (1e8 + rng.normal(size=(100, 3)) * 1e3).astype(np.float32)
    positions = points(*vertices).positions()
    assert positions.origin.any() and positions.lo is None
    np.testing.assert_array_equal(restored(positions), vertices)


def test_the_origin_stays_while_the_scene_is_near_it() -> None:
    for distance, moves in ((15.0, False), (17.0, True)):
        scene = points([distance - 1, 0, 0], [distance + 1, 0, 0])
        assert bool(scene.positions().origin.any()) == moves
    single = points([3, 4, 5]).positions()
    np.testing.assert_array_equal(single.origin, [3, 4, 5])
    np.testing.assert_array_equal(single.hi, [[0, 0, 0]])
    np.testing.assert_array_equal(points([1.7, 1e8 + 0.1, -3e-9]).positions().hi, [[0, 0, 0]])


@pytest.mark.parametrize("size", [1e30, 1e-30, 1e150, 1e-150, 1.7e308, 5e-324, 2.0**61, 2.0**-61])
def test_huge_and_tiny_scenes_are_scaled_by_a_power_of_two(size: float) -> None:
    vertices = size * np.array([[1, -1, 0.5], [-1, 1, 0], [0.25, 0, -1]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        positions = points(*vertices).positions()
    assert math.frexp(positions.scale)[0] == 0.5
    assert 2.0**-80 < np.abs(positions.hi).max() < 2.0**30
    if 1e-300 < size:
        np.testing.assert_allclose(restored(positions), vertices, rtol=2.0**-46, atol=0)


def test_usual_sizes_are_not_scaled() -> None:
    for size in (1e-15, 1e-3, 1.0, 1e6, 1e15):
        assert points([size, -size, size], [-size, size, 0]).positions().scale == 1


def test_non_finite_vertices_stay_so() -> None:
    positions = points([0, 0, 0.1], [1, 1, 1], [NAN, 0, 0], [0, INF, 0], [0, 0, -INF]).positions()
    assert np.isnan(positions.hi[2, 0]) and positions.hi[3, 1] == INF and positions.hi[4, 2] == -INF
    assert positions.lo is not None and np.isfinite(positions.lo).all()


@given(
    hnp.arrays(np.float64, (5, 3), elements=st.floats(-1e3, 1e3, allow_nan=False)),
    st.floats(-1e12, 1e12),
    st.integers(-200, 200),
)
def test_positions_are_within_float32_pairs_of_the_vertices(values: np.ndarray, offset: float, exponent: int) -> None:
    vertices = np.ldexp(values + offset, exponent)
    scene = points(*vertices)
    positions = scene.positions()
    p = (vertices - positions.origin) * positions.scale
    np.testing.assert_array_equal(positions.hi, p.astype(np.float32))
    error = np.abs(positions.hi.astype(np.float64) + (0 if positions.lo is None else positions.lo) - p)
    assert (error <= np.abs(p) * 2.0**-47 + 2.0**-140).all()
    low, high = scene.bounds
    radius = math.dist(low, high) / 2
    assert np.linalg.norm((low + high) / 2 - positions.origin) <= 16 * radius * (1 + 1e-9) + 1e-300


# --- files ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("zipped", ["", ".gz"])
@pytest.mark.parametrize("kind", FORMATS)
def test_every_format_comes_back(tmp_path: Path, kind: str, zipped: str) -> None:
    path = written(tetrahedron(), tmp_path / f"tetrahedron.{kind}{zipped}")
    for given_path in (path, str(path)):
        scene = load(given_path)
        assert as_set(triangles(scene)) == as_set(TETRAHEDRON[TETRAHEDRON_FACES])
        plain = (255, 255, 255, 255) if "gl" in path.name else DEFAULT_COLOR  # glTF has a default of its own
        assert scene.color is not None and tuple(scene.color) == plain, "a grey that trimesh made up"
        assert scene.notes == ()


def test_upper_case_extensions_are_known(tmp_path: Path) -> None:
    path = written(tetrahedron(), tmp_path / "t.stl").rename(tmp_path / "T.STL")
    assert len(load(path).faces) == 4


@pytest.mark.parametrize("kind", ["ply", "glb", "obj"])
def test_vertex_colors_come_back(tmp_path: Path, kind: str) -> None:
    colors = np.array([[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [10, 20, 30, 255]], np.uint8)
    scene = load(written(tetrahedron(vertex_colors=colors), tmp_path / f"t.{kind}"))
    assert scene.vertex_colors is not None and scene.vertex_colors.dtype == np.uint8
    got = {tuple(v): tuple(c) for v, c in zip(scene.vertices, scene.vertex_colors, strict=True)}
    assert got == {tuple(v): tuple(c) for v, c in zip(TETRAHEDRON, colors, strict=True)}


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
@pytest.mark.parametrize("where", ["face_colors", "vertex_colors"])
def test_ply_colors_and_alpha_come_back(tmp_path: Path, where: str, encoding: str) -> None:
    colors = np.arange(16, dtype=np.uint8).reshape(4, 4) * 16
    path = tmp_path / "t.ply"
    path.write_bytes(tetrahedron(**{where: colors}).export(file_type="ply", encoding=encoding))
    np.testing.assert_array_equal(getattr(load(path), where), colors)


@pytest.mark.parametrize("kind", ["ply", "glb", "obj"])
def test_normals_come_back_only_where_the_file_has_them(tmp_path: Path, kind: str) -> None:
    normals = np.array([[0, 0, 1.0], [0, 1, 0], [1, 0, 0], [0.6, 0.8, 0]])
    scene = load(written(tetrahedron(vertex_normals=normals), tmp_path / f"with.{kind}"))
    assert scene.vertex_normals is not None and scene.vertex_normals.dtype == np.float32
    got = {tuple(v): n for v, n in zip(scene.vertices, scene.vertex_normals, strict=True)}
    for vertex, normal in zip(TETRAHEDRON, normals, strict=True):
        np.testing.assert_allclose(got[tuple(vertex)], normal, atol=1e-6)
    assert load(written(tetrahedron(), tmp_path / f"without.{kind}")).vertex_normals is None


PLY = """ply
format ascii 1.0
comment by hand
element vertex 4
property float x
property float y
property float z
property float confidence
element face 2
property list uchar int vertex_indices
end_header
0 0 0 1
1 0 0 1
0 1 0 1
1 1 0.1 1
3 0 1 2
3 1 3 2
"""


def as_trimesh_reads(path: Path) -> Scene:
    """The file through trimesh alone."""
    return load(trimesh.load_scene(path, process=False))


def first_corner_first(faces: np.ndarray) -> np.ndarray:
    """The faces, each turned so that its least corner is the first."""
    return np.array([np.roll(face, -face.argmin()) for face in faces])


@pytest.mark.parametrize(
    "text",
    [
        PLY,
        PLY.replace("\n", "\r\n"),
        PLY.replace("vertex_indices", "vertex_index"),
        PLY.replace("0 1 0 1", "0 1e-3 -0 1"),
        PLY.replace("0 1 0 1", "nan inf -inf 1"),
        PLY.replace("float x", "double x"),
        PLY.replace("3 1 3 2", "4 0 1 3 2"),  # a quad: two triangles
        PLY.replace("element face 2", "element face 1"),
        PLY.replace("comment by hand", "obj_info by hand"),
    ],
)
def test_plain_ply_text_is_read_as_by_trimesh(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.ply"
    path.write_bytes(text.encode())
    got, want = load(path), as_trimesh_reads(path)
    np.testing.assert_array_equal(got.vertices, want.vertices)
    np.testing.assert_array_equal(first_corner_first(got.faces), first_corner_first(want.faces))


@pytest.mark.parametrize("name", ["bunny.ply", "suzanne.ply", "dragon_vrip_res3.ply.gz"])
def test_shared_ply_models_are_read_as_by_trimesh(tmp_path: Path, name: str) -> None:
    path = model(name)
    data = path.read_bytes()
    plain = tmp_path / name.removesuffix(".gz")
    plain.write_bytes(gzip.decompress(data) if name.endswith(".gz") else data)
    got, want = load(path), as_trimesh_reads(plain)
    np.testing.assert_array_equal(got.vertices, want.vertices)
    # trimesh puts triangles before quads.
    assert sorted(first_corner_first(got.faces).tolist()) == sorted(first_corner_first(want.faces).tolist())
    assert (got.vertex_normals is None) == (want.vertex_normals is None)


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_ply_of_both_byte_orders(tmp_path: Path, order: str) -> None:
    name = {"<": "little", ">": "big"}[order]
    header = PLY[: PLY.index("end_header")].replace("ascii", f"binary_{name}_endian").replace("float x", "double x")
    rows = np.array(
        [(0.1, 0, 0, 1), (1, 0, 0, 1), (0, 1, 0, 1), (1, 1, 0, 1)], f"{order}f8,{order}f4,{order}f4,{order}f4"
    )
    faces = np.array([(3, (0, 1, 2)), (3, (1, 3, 2))], np.dtype([("n", "u1"), ("i", order + "i4", 3)]))
    path = tmp_path / "t.ply"
    path.write_bytes(header.encode() + b"end_header\n" + rows.tobytes() + faces.tobytes())
    scene = load(path)
    assert scene.faces.tolist() == [[0, 1, 2], [1, 3, 2]] and scene.vertices[0, 0] == 0.1
    assert scene.faces.dtype.isnative and scene.vertices.dtype.isnative


def test_binary_ply_of_quads_is_read_as_by_trimesh(tmp_path: Path) -> None:
    header = PLY[: PLY.index("end_header")].replace("ascii", "binary_little_endian") + "end_header\n"
    rows = np.array([[0, 0, 0, 1], [1, 0, 0, 1], [1, 1, 0, 1], [0, 1, 0, 1]], "<f4")
    faces = np.array([(4, (0, 1, 2, 3)), (4, (3, 2, 1, 0))], np.dtype([("n", "u1"), ("i", "<i4", 4)]))
    path = tmp_path / "t.ply"
    path.write_bytes(header.encode() + rows.tobytes() + faces.tobytes())
    got = load(path)
    assert got.faces.tolist() == [[0, 1, 2], [0, 2, 3], [3, 2, 1], [3, 1, 0]]
    assert as_set(triangles(got)) == as_set(triangles(as_trimesh_reads(path)))


def test_the_loader_is_silent(tmp_path: Path, caplog: Any, capfd: Any, recwarn: Any) -> None:
    path = tmp_path / "t.ply"
    path.write_text(PLY.replace("comment by hand", "comment TextureFile none.png"))
    assert len(load(path).faces) == 2
    assert not caplog.records and not recwarn.list and capfd.readouterr() == ("", "")


def test_text_stl_and_binary_stl_are_alike(tmp_path: Path) -> None:
    (tmp_path / "text.stl").write_text(tetrahedron().export(file_type="stl_ascii"))
    text, binary = load(tmp_path / "text.stl"), load(written(tetrahedron(), tmp_path / "binary.stl"))
    np.testing.assert_array_equal(triangles(text), TETRAHEDRON[TETRAHEDRON_FACES])
    np.testing.assert_array_equal(triangles(binary), TETRAHEDRON[TETRAHEDRON_FACES])


@pytest.mark.parametrize("kind", ["ply", "stl", "obj", "off"])
def test_plain_files_need_no_trimesh(tmp_path: Path, kind: str) -> None:
    path = written(tetrahedron(), tmp_path / f"t.{kind}")
    code = f"import sys; from clpeel.reading.load import load; load({str(path)!r}); sys.exit('trimesh' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


@pytest.mark.parametrize(
    ("name", "faces", "vertices"),
    [
        ("ADIS16480.STL", 7436, 22308),
        ("Duck.glb", 4212, 2399),
        ("CesiumMilkTruck.glb", 3624, 3564),
        ("chair_model.obj", 12756, None),
        ("AlphaBlendModeTest.glb", 61, 137),
    ],
)
def test_shared_models(name: str, faces: int, vertices: int | None) -> None:
    scene = load(model(name))
    assert len(scene.faces) == faces and (vertices is None or len(scene.vertices) == vertices)
    assert np.isfinite(scene.bounds).all() and (scene.bounds[1] > scene.bounds[0]).any()
    if name.endswith(".glb"):
        assert scene.vertex_normals is not None and np.isfinite(scene.vertex_normals).all()
        assert any(material.texture is not None for material in scene.materials) and scene.uv is not None
        assert scene.single_sided is not None
    else:
        assert scene.color is not None and tuple(scene.color) == DEFAULT_COLOR and scene.vertex_normals is None


def test_truck_wheels_stand_in_their_two_places() -> None:
    """The wheels are one mesh in two nested nodes; the truck spans what its accessors and matrices say."""
    scene = load(model("CesiumMilkTruck.glb"))
    np.testing.assert_allclose(scene.bounds, [[-2.4309, 0.0015, -1.3960], [2.4380, 2.5844, 1.3960]], atol=1e-3)
    assert scene.opaque and scene.face_colors is not None and scene.face_materials is not None
    shown = [1.055 * value ** (1 / 2.4) - 0.055 for value in (0.04050629958510399, 0.021240700036287308)]
    glass = np.isclose(scene.face_colors, [0, *shown, 1], atol=1e-7).all(axis=1)
    assert glass.any() and scene.plain_faces[glass].all()
    # "glass" of the file: its base colour alone, metallicFactor 0, and roughnessFactor 1 by default.
    of_glass = {scene.materials[place] for place in scene.face_materials[glass]}
    finishes = {(m.plain, m.finish.metallic, m.finish.roughness, m.finish.emissive) for m in of_glass if m.finish}
    assert finishes == {(True, 0, 1, (0, 0, 0))}, "the glass has its base colour"


def test_alpha_modes_of_the_khronos_model() -> None:
    scene = load(model("AlphaBlendModeTest.glb"))
    assert scene.surfaces == "mixed" and scene.face_materials is not None
    assert {m.name: (m.alpha_mode, m.alpha_cutoff) for m in scene.materials} == {
        "MatBed": ("OPAQUE", 0.5),
        "MatOpaque": ("OPAQUE", 0.5),
        "MatBlend": ("BLEND", 0.5),
        "MatCutoff25": ("MASK", 0.25),
        "MatCutoffDefault": ("MASK", 0.5),
        "MatCutoff75": ("MASK", 0.75),
    }
    names = [scene.materials[place].name.removeprefix("Mat") for place in scene.face_materials]
    counts = {"Bed": 30, "Opaque": 21, "Blend": 4, "Cutoff25": 2, "CutoffDefault": 2, "Cutoff75": 2}
    assert {name: names.count(name) for name in counts} == counts and len(names) == sum(counts.values())
    assert scene.single_sided is not None
    assert [name == "Bed" for name in names] == scene.single_sided.tolist()


# --- scene graphs and several sources -------------------------------------------------------------------------------


def nested() -> tuple[Any, np.ndarray]:
    """A trimesh scene with a mirror below a rotation below an offset, and its triangles, in float64 by hand."""
    offset, turn, mirror = np.eye(4), np.eye(4), np.diag([-1.0, 2, 3, 1])
    offset[:3, 3] = (10, -20, 30)
    turn[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    scene = trimesh.Scene()
    scene.graph.update(frame_from="world", frame_to="a", matrix=offset)
    scene.add_geometry(tetrahedron(), node_name="first", geom_name="shape", parent_node_name="a")
    scene.graph.update(frame_from="a", frame_to="b", matrix=turn)
    scene.graph.update(frame_from="b", frame_to="c", matrix=mirror, geometry="shape")
    chain = offset @ turn @ mirror
    corners = TETRAHEDRON[TETRAHEDRON_FACES]
    return scene, np.concatenate([corners + offset[:3, 3], corners @ chain[:3, :3].T + chain[:3, 3]])


def test_scene_graph_transforms_of_an_object() -> None:
    source, want = nested()
    scene = load(source)
    np.testing.assert_allclose(triangles(scene), want, atol=1e-12)
    assert scene.color is not None and tuple(scene.color) == DEFAULT_COLOR


@pytest.mark.parametrize("kind", ["glb", "gltf", "3mf"])
def test_scene_graph_transforms_of_a_file(tmp_path: Path, kind: str) -> None:
    source, want = nested()
    want[4:] = want[4:, ::-1]  # the mirror of these formats leaves the front in front
    assert as_set(triangles(load(written(source, tmp_path / f"nested.{kind}")))) == as_set(want)


@given(hnp.arrays(np.float64, (3, 3), elements=st.floats(-10, 10)), st.sampled_from([1e-20, 1.0, 1e20]))
def test_normals_stay_perpendicular_under_any_transform(turn: np.ndarray, size: float) -> None:
    if abs(np.linalg.det(turn)) < 1e-2:
        return
    matrix = np.eye(4)
    matrix[:3, :3] = turn * size
    corners = np.array([[0.0, 0, 0], [1, 0.25, 0], [0, 1, 0.5]])
    normal = np.cross(corners[1], corners[2])
    mesh = trimesh.Trimesh(corners, [[0, 1, 2]], vertex_normals=np.tile(normal, (3, 1)), process=False)
    source = trimesh.Scene()
    source.add_geometry(mesh, transform=matrix)
    scene = load(source)
    assert scene.vertex_normals is not None
    a, b, c = scene.vertices
    for edge in (b - a, c - a):
        assert abs(scene.vertex_normals[0] @ (edge / np.linalg.norm(edge))) < 1e-3
    assert abs(np.linalg.norm(scene.vertex_normals[0]) - 1) < 1e-5


def test_several_sources_are_joined_in_order(tmp_path: Path) -> None:
    red = tetrahedron(face_colors=[255, 0, 0, 128])
    files = [written(red, tmp_path / "red.ply"), written(tetrahedron(), tmp_path / "plain.stl")]
    own = Scene.from_arrays(TETRAHEDRON + 5, TETRAHEDRON_FACES, color=[0, 0, 9])
    scene = load(*files, own)
    assert scene.vertex_colors is None and scene.color is None and scene.face_colors is not None
    want = [[255, 0, 0, 128]] * 4 + [list(DEFAULT_COLOR)] * 4 + [[0, 0, 9, 255]] * 4
    np.testing.assert_array_equal(scene.face_colors, want)
    corners = TETRAHEDRON[TETRAHEDRON_FACES]
    np.testing.assert_allclose(triangles(scene), np.concatenate([corners, corners, corners + 5]))


def test_joining_splits_face_colors_only_beside_vertex_colors() -> None:
    faces = Scene.from_arrays(TETRAHEDRON, TETRAHEDRON_FACES, face_colors=np.arange(16, dtype=np.uint8).reshape(4, 4))
    flat = Scene.from_arrays(TETRAHEDRON, TETRAHEDRON_FACES, color=[0.5, 0.25, 0.125])
    vertices = Scene.from_arrays(TETRAHEDRON, TETRAHEDRON_FACES, vertex_colors=np.full((4, 3), 51))
    scene = load(faces, flat, vertices)
    assert scene.vertex_colors is not None and scene.vertex_colors.dtype == np.float32
    assert len(scene.vertices) == 12 + 4 + 4 and len(scene.faces) == 12
    assert faces.face_colors is not None
    corner_colors = scene.vertex_colors[scene.faces]
    for corner in range(3):
        np.testing.assert_allclose(corner_colors[:4, corner], faces.face_colors / 255, atol=1e-7)
    assert (corner_colors[4:8] == [0.5, 0.25, 0.125, 1]).all()
    np.testing.assert_allclose(corner_colors[8:], np.broadcast_to([0.2, 0.2, 0.2, 1], (4, 3, 4)), atol=1e-7)
    np.testing.assert_array_equal(triangles(scene), np.tile(TETRAHEDRON[TETRAHEDRON_FACES], (3, 1, 1)))


def test_joining_keeps_the_normals_that_are_known() -> None:
    with_normals = Scene.from_arrays(TETRAHEDRON, TETRAHEDRON_FACES, vertex_normals=np.full((4, 3), 2.0))
    without = Scene.from_arrays(TETRAHEDRON, TETRAHEDRON_FACES)
    normals = load(without, with_normals).vertex_normals
    assert normals is not None and np.isnan(normals[:4]).all() and (normals[4:] == 2).all()


def test_overrides() -> None:
    colors = np.array([[10, 20, 30, 40]] * 3 + [[50, 60, 70, 80]], np.uint8)
    source = Scene.from_arrays(TETRAHEDRON, TETRAHEDRON_FACES, vertex_colors=colors)
    rgb = load(source, color=[1, 2, 3])
    assert rgb.vertex_colors is not None
    assert rgb.vertex_colors.tolist() == [[1, 2, 3, 40]] * 3 + [[1, 2, 3, 80]]
    rgba = load(source, color=(1, 2, 3, 4))
    assert rgba.vertex_colors is None and rgba.color is not None and rgba.color.tolist() == [1, 2, 3, 4]
    both = load(source, color=(1, 2, 3, 4), opacity=0.2)
    assert both.color is not None and both.color.tolist() == [1, 2, 3, 51]
    floats = load(source, color=(0.5, 0, 0), opacity=0.3)
    assert floats.vertex_colors is not None and floats.vertex_colors.dtype == np.float32
    np.testing.assert_allclose(floats.vertex_colors, np.tile([0.5, 0, 0, 0.3], (4, 1)), atol=1e-7)
    clear = load(source, opacity=0.2)
    assert clear.vertex_colors is not None and (clear.vertex_colors == [10, 20, 30, 51])[:3].all()
    assert load(source).vertex_colors is source.vertex_colors
    np.testing.assert_array_equal(source.vertex_colors, colors)


def test_points_and_lines_beside_triangles_are_drawn() -> None:
    scene = load(trimesh.Scene([tetrahedron(), trimesh.PointCloud(TETRAHEDRON, colors=[[1, 2, 3, 4]] * 4)]))
    assert scene.counts == (4, 0, 4) and scene.notes == ()
    assert scene.vertex_colors is not None and scene.points is not None
    assert (scene.vertex_colors[scene.points] == [1, 2, 3, 4]).all()


def test_paths_of_trimesh_are_lines() -> None:
    pytest.importorskip("scipy")
    path = trimesh.load_path(np.array([[[0, 0, 0], [1, 0, 0]], [[1, 0, 0], [1, 2, 0]]], float))
    for source in (path, trimesh.Scene([path])):
        scene = load(source)
        assert scene.lines is not None and len(scene.lines) == 2 and scene.notes == ()
        assert scene.vertices[scene.lines].reshape(-1, 3).max(axis=0).tolist() == [1, 2, 0]


def test_non_finite_vertices_in_a_file_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "t.ply"
    path.write_text(PLY.replace("1 1 0.1 1", "nan 1 0.1 1"))
    scene = load(path)
    assert np.isnan(scene.vertices).sum() == 1 and len(scene.faces) == 2


# --- bad files ------------------------------------------------------------------------------------------------------

UNSIGNED_PLY = PLY.replace("int vertex", "uint vertex")
CLOUD = PLY[: PLY.index("element face")] + "end_header\n0 0 0 1\n1 0 0 1\n0 1 0 1\n1 1 0 1\n"


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("empty.ply", b"", "not a readable mesh"),
        ("noise.ply", os.urandom(500), "not a readable mesh"),
        ("noise.glb", b"glTF" + bytes(200), "expected glTF 2, got version 0"),
        ("noise.stl", b"\x01" * 300, "the file is cut: its header promises 16,843,009 triangles, it holds 4"),
        ("noise.obj", b"hello world\n", "expected triangles, lines or points, got none"),
        ("noise.off", b"OFF\n3 1\n", "the file is cut: its header promises 4 vertices and faces, it holds 0"),
        ("noise.gltf", b"{]", "not a readable mesh"),
        ("noise.3mf", b"PK\x03\x04", "not a readable mesh"),
        ("cut.ply", CLOUD.encode()[:-8], "the file is cut"),
        ("lines.obj", b"v 0 0 0\nv 1 0 0\nl 1 3\n", "lines: expected indices 1..2, got 3 in line 3"),
        ("no-faces.off", b"OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n", "expected triangles, got 3 point(s) alone"),
        ("empty.stl", bytes(84), "expected triangles, got none; the mesh is empty"),
        ("cut.ply", PLY[:-8].encode(), "the file is cut"),
        ("cut-vertices.ply", PLY[: PLY.index("0 1 0 1")].encode(), "the file is cut"),
        ("minus.ply", PLY.replace("3 1 3 2", "3 1 -1 2").encode(), "expected indices 0..3, got -1 in face 1"),
        ("beyond.ply", PLY.replace("3 1 3 2", "3 1 4 2").encode(), "expected indices 0..3, got 4 in face 1"),
        ("huge.ply", UNSIGNED_PLY.replace("3 1 3 2", "3 1 2147483648 2").encode(), "got 2147483648 in face 1"),
        ("beyond.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "expected indices 0..2, got 3 in face 0"),
        ("beyond.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "expected indices 1..3, got 4 in line 4"),
        ("greedy.ply", PLY.replace("vertex 4", "vertex 99999999999").encode(), "the file is cut"),
        (
            "plain.gz",
            gzip.compress(b"x", mtime=0),
            "expected a mesh file, one of .ply, .stl, .obj, .off, .glb, .gltf, .3mf",
        ),
        ("not-zipped.ply.gz", PLY.encode(), "not a whole gzip file"),
        ("cut.ply.gz", gzip.compress(PLY.encode(), mtime=0)[:60], "not a whole gzip file"),
        ("flipped.ply.gz", gzip.compress(PLY.encode(), mtime=0)[:-8] + bytes(8), "not a whole gzip file"),
        ("picture.png", b"\x89PNG", "expected a mesh file, one of .ply"),
        ("no-extension", b"x", "expected a mesh file, one of .ply"),
    ],
)
def test_bad_files_are_one_line(tmp_path: Path, capfd: Any, name: str, content: bytes, says: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError) as error:
        load(path)
    assert message(error).startswith(f"{path}: ") and says in message(error)
    assert capfd.readouterr() == ("", "")


def test_missing_files_and_directories(tmp_path: Path) -> None:
    for path, says in (
        (tmp_path / "none.ply", "no such file"),
        (tmp_path / "none.ply.gz", "no such file"),
        (tmp_path / "none.xyz", "no such file"),
        (tmp_path, "got a directory"),
    ):
        with pytest.raises(InputError) as error:
            load(path)
        assert message(error).startswith(f"{path}: ") and says in message(error)
    for path in ("", "null\0byte.ply"):
        with pytest.raises(InputError):
            load(path)


def test_missing_gltf_buffer(tmp_path: Path) -> None:
    path = written(tetrahedron(), tmp_path / "t.gltf")
    for buffer in tmp_path.glob("*.bin"):
        buffer.unlink()
    with pytest.raises(InputError) as error:
        load(path)
    assert "not a readable mesh" in message(error)


def test_unreadable_file(tmp_path: Path) -> None:
    path = tmp_path / "t.ply"
    path.write_text(PLY)
    path.chmod(0)
    if os.access(path, os.R_OK):
        pytest.skip("this user may read every file")
    with pytest.raises(InputError) as error:
        load(path)
    assert "cannot be read" in message(error)


@pytest.mark.parametrize(
    ("sources", "options", "says"),
    [
        ((), {}, "expected at least one"),
        ((42,), {}, "expected a path, a trimesh, PyVista, VTK, meshio or Open3D object or a Scene, got int"),
        ((None,), {}, "got NoneType"),
        ((tetrahedron(),), {"opacity": 2}, "opacity: expected a number 0..1, got 2"),
        ((tetrahedron(),), {"color": [1, 2]}, "color: expected [3 or 4]"),
        ((tetrahedron(),), {"color": 7}, "color: expected [3 or 4]"),
        ((tetrahedron(),), {"color": [NAN, 0, 0]}, "color: expected floats 0..1, got nan"),
        (
            (trimesh.PointCloud(np.zeros((0, 3))),),
            {},
            "trimesh object: expected triangles, lines or points, got 1 point",
        ),
        ((trimesh.Trimesh(),), {}, "trimesh object: expected triangles"),
        ((trimesh.Scene(),), {}, "trimesh object: expected triangles, lines or points, got none"),
        ((trimesh.Trimesh(TETRAHEDRON, [[0, 1, 9]], process=False),), {}, "expected indices 0..3, got 9"),
    ],
)
def test_bad_sources(sources: Any, options: Any, says: str) -> None:
    with pytest.raises(InputError) as error:
        load(*sources, **options)
    assert says in message(error)


@given(st.sampled_from(FORMATS), st.binary(max_size=200))
def test_no_bytes_crash_the_loader(tmp_path_factory: Any, kind: str, content: bytes) -> None:
    path = tmp_path_factory.mktemp("noise") / f"noise.{kind}"
    path.write_bytes(content)
    try:
        load(path)
    except InputError as error:
        assert "\n" not in str(error)


@given(st.data())
def test_no_damaged_ply_crashes_the_loader(tmp_path_factory: Any, data: Any) -> None:
    text = bytearray(PLY.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        text[data.draw(st.integers(0, len(text) - 1))] = data.draw(st.sampled_from(b"0123456789 \n-.efxy\xff"))
    path = tmp_path_factory.mktemp("damaged") / "damaged.ply"
    path.write_bytes(bytes(text))
    try:
        scene = load(path)
    except InputError as error:
        assert "\n" not in str(error)
    else:
        assert scene.faces.min() >= 0 and scene.faces.max() < len(scene.vertices)
