"""Files that libraries read: each comes as it was written; missing packages and damage are one line each."""

from __future__ import annotations

import gzip
import importlib.util
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from reading import steps

import clpeel
from clpeel.command.main import main
from clpeel.reading import libraries

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1.0]])
TETRA = [[0, 1, 2, 3], [1, 2, 3, 4]]


def needs(name: str, extra: str) -> Any:
    return pytest.mark.skipif(importlib.util.find_spec(name) is None, reason=f"needs pip install 'clpeel[{extra}]'")


# --- what is there ----------------------------------------------------------------------------------------------------


@needs("pyvista", "test-ecosystem")
@pytest.mark.parametrize(
    ("extension", "zipped"),
    [(each, zipped) for zipped in (False, True) for each in ("vtp", "vtk", "vtu")] + [("vtm", False)],
)
def test_files_of_vtk(extension: str, zipped: bool, tmp_path: Path) -> None:
    import pyvista as pv

    mesh = {"vtu": pv.Sphere().cast_to_unstructured_grid(), "vtm": pv.MultiBlock([pv.Sphere()])}
    path = tmp_path / f"ball.{extension}"
    mesh.get(extension, pv.Sphere()).save(path)
    if zipped:
        path = path.with_name(path.name + ".gz")
        path.write_bytes(gzip.compress(path.with_suffix("").read_bytes()))
    scene = clpeel.load(path)
    whole = clpeel.load(pv.Sphere())
    np.testing.assert_allclose(scene.vertices[scene.faces], whole.vertices[whole.faces], atol=1e-6)
    assert scene.counts == (1680, 0, 0)


@needs("pyvista", "test-ecosystem")
@pytest.mark.parametrize("extension", ["vti", "vtr", "vts"])
def test_grids_of_vtk(extension: str, tmp_path: Path) -> None:
    import pyvista as pv

    box = pv.ImageData(dimensions=(2, 3, 4))
    grid = {"vtr": box.cast_to_rectilinear_grid(), "vts": box.cast_to_structured_grid()}.get(extension, box)
    grid.save(tmp_path / f"box.{extension}")
    scene = clpeel.load(tmp_path / f"box.{extension}")
    assert scene.bounds.tolist() == [[0, 0, 0], [1, 2, 3]] and scene.counts == (2 * 2 * (2 + 3 + 6), 0, 0)


@needs("meshio", "meshio")
@pytest.mark.parametrize("extension", ["msh", "mesh", "inp", "bdf"])
def test_files_of_finite_elements(extension: str, tmp_path: Path) -> None:
    """Two cells that share a side: 6 triangles, and the volumes 1/6 and 1/3."""
    import meshio

    meshio.Mesh(POINTS, [("tetra", TETRA)]).write(tmp_path / f"two.{extension}")
    scene = clpeel.load(tmp_path / f"two.{extension}")
    a, b, c = np.moveaxis(scene.vertices[scene.faces], 1, 0)
    assert scene.counts == (6, 0, 0)
    assert abs(np.einsum("mc,mc->m", a, np.cross(b, c)).sum() / 6) == pytest.approx(1 / 2)


@needs("cascadio", "cad")
def test_step_is_read_in_millimetres(tmp_path: Path) -> None:
    (tmp_path / "box.step").write_text(steps.box((10, 20, 30)))
    scene = clpeel.load(tmp_path / "box.step")
    np.testing.assert_allclose(scene.bounds, [[0, 0, 0], [10, 20, 30]], atol=1e-5)
    a, b, c = np.moveaxis(scene.vertices[scene.faces], 1, 0)
    assert np.einsum("mc,mc->m", a, np.cross(b, c)).sum() / 6 == pytest.approx(6000)
    assert scene.single_sided is None and scene.materials == () and scene.notes == ()


@needs("collada", "collada")
def test_collada_is_read_by_trimesh(tmp_path: Path) -> None:
    import trimesh

    (tmp_path / "box.dae").write_bytes(trimesh.exchange.dae.export_collada(trimesh.creation.box((1, 2, 3))))
    scene = clpeel.load(tmp_path / "box.dae")
    with zipfile.ZipFile(tmp_path / "box.zae", "w") as file:
        file.write(tmp_path / "box.dae", "box.dae")
    for each in (scene, clpeel.load(tmp_path / "box.zae")):
        assert each.counts == (12, 0, 0) and each.bounds.tolist() == [[-0.5, -1, -1.5], [0.5, 1, 1.5]]


# --- what is not ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("extension", "needed"), sorted(libraries._NEEDS.items()))
def test_a_missing_package_is_named_with_the_command_that_installs_it(
    extension: str, needed: tuple[str, str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any
) -> None:
    monkeypatch.setattr(libraries, "find_spec", lambda name: None)
    path = tmp_path / f"a.{extension}"
    path.write_text("x")
    _, package, extra = needed
    assert main(["render", str(path), "-o", str(tmp_path / "a.png")]) == 2
    out, err = capfd.readouterr()
    text = f"expected the package {package} to read .{extension}; run: pip install 'clpeel[{extra}]'"
    assert out == "" and err == f"clpeel: error: {path}: {text}\n"


def test_the_extras_that_errors_name_are_there_and_bring_the_packages() -> None:
    import tomllib

    extras = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"][
        "optional-dependencies"
    ]
    for _, package, extra in set(libraries._NEEDS.values()):
        assert any(each.startswith(f"{package}>=") for each in extras[extra])


def damaged_files(folder: Path) -> list[str]:
    """The names of damaged files of every type that is read here, each cut in the middle or of something else."""
    import meshio
    import pyvista as pv

    (folder / "whole").mkdir()
    for extension in ("vtp", "vtk"):
        pv.Sphere().save(folder / "whole" / f"a.{extension}")
    pv.MultiBlock([pv.Sphere()]).save(folder / "whole" / "a.vtm")
    meshio.Mesh(POINTS, [("tetra", TETRA)]).write(folder / "whole" / "a.msh")
    (folder / "whole" / "a.step").write_text(steps.box((1, 2, 3)))
    for path in (folder / "whole").glob("a.*"):
        data = path.read_bytes()
        (folder / path.name).write_bytes(data if path.suffix == ".vtm" else data[: len(data) // 2])
    words = ("vtu", "vti", "xdmf", "inp", "iges", "stp", "dae", "bdf", "med")
    for extension in words:
        (folder / f"b.{extension}").write_text("<these> are words, (not) a mesh\n")
    return [*(path.name for path in folder.glob("a.*")), *(f"b.{extension}" for extension in words)]


@needs("pyvista", "test-ecosystem")
@needs("meshio", "meshio")
@needs("cascadio", "cad")
@needs("collada", "collada")
def test_damaged_files_are_one_line_and_nothing_else(tmp_path: Path) -> None:
    """In a process of its own, as what libraries print to the terminal does not pass through Python."""
    names = damaged_files(tmp_path)
    assert len(names) == 14
    each = "main(['render', name, '-o', 'x.png']) == 2 for name in sys.argv[1:]"
    code = f"import sys; from clpeel.command.main import main; sys.exit(sum({each}))"
    run = subprocess.run([sys.executable, "-c", code, *names], cwd=tmp_path, capture_output=True, text=True)
    lines = run.stderr.splitlines()
    assert run.returncode == len(names) == len(lines) and run.stdout == "", run.stderr
    for name, line in zip(names, lines, strict=True):
        assert line.startswith(f"clpeel: error: {name}: ") and len(line) < 300


@needs("meshio", "meshio")
def test_what_meshio_prints_goes_nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: Any) -> None:
    import meshio

    def read(path: str) -> Any:
        print("words")
        meshio._common.warn("of a warning")
        return meshio.Mesh(POINTS, [("tetra", TETRA)])

    monkeypatch.setattr(meshio.gmsh, "read", read)
    (tmp_path / "a.msh").write_text("$MeshFormat")
    assert clpeel.load(tmp_path / "a.msh").counts == (6, 0, 0)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("extension", ["vtu", "msh", "step", "dae"])
def test_a_file_that_is_not_there_is_said_so(extension: str, tmp_path: Path) -> None:
    with pytest.raises(clpeel.InputError, match="no such file"):
        clpeel.load(tmp_path / f"none.{extension}")


# --- what is imported -------------------------------------------------------------------------------------------------

HEAVY = ("vtk", "vtkmodules", "pyvista", "meshio", "open3d", "cascadio", "collada", "ufbx", "pxr", "rich")


@pytest.mark.parametrize(
    "code",
    ["import clpeel; clpeel.load, clpeel.from_pyvista, clpeel.render", "import clpeel; clpeel.load(sys.argv[1])"],
)
def test_nothing_is_imported_that_is_not_needed(code: str, squares: Path) -> None:
    test = f"import sys; {code}; print({HEAVY!r} and sorted(set({HEAVY!r}) & set(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", test, str(squares)], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_things_are_recognized_by_their_classes_alone() -> None:
    """No object of these libraries is needed to know that something else is none."""
    things: list[Any] = [3, [], object(), np.zeros((3, 3)), {"vertices": []}]
    known: Callable[[Any], Any] = clpeel.load
    for thing in things:
        with pytest.raises(clpeel.InputError, match="load: expected a path, a trimesh, PyVista, VTK, meshio or Open3D"):
            known(thing)
