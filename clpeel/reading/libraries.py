"""Files through libraries: those that a package which is not always installed reads, by extension, and its reader."""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.apart import read_apart
from clpeel.reading.companions import Companions
from clpeel.scene.arrays import DEFAULT_COLOR
from clpeel.scene.scene import Scene

_VTK = {
    "vtk": ("vtkIOLegacy", "vtkGenericDataObjectReader"),
    **{
        f"{parallel}{extension}": ("vtkIOXML", f"vtkXML{'P' * len(parallel)}{kind}Reader")
        for parallel in ("", "p")
        for extension, kind in {
            "vtp": "PolyData",
            "vtu": "UnstructuredGrid",
            "vti": "ImageData",
            "vtr": "RectilinearGrid",
            "vts": "StructuredGrid",
        }.items()
    },
    "vtm": ("vtkIOXML", "vtkXMLMultiBlockDataReader"),
    "vtmb": ("vtkIOXML", "vtkXMLMultiBlockDataReader"),
}
"""VTK's own files: the module of vtkmodules and the class that reads them."""

_MESHIO = {
    "msh": ("gmsh", "ansys"),
    "xdmf": ("xdmf",),
    "xmf": ("xdmf",),
    "inp": ("abaqus",),
    "avs": ("avsucd",),
    "bdf": ("nastran",),
    "fem": ("nastran",),
    "nas": ("nastran",),
    "cgns": ("cgns",),
    "e": ("exodus",),
    "ex2": ("exodus",),
    "exo": ("exodus",),
    "ele": ("tetgen",),
    "node": ("tetgen",),
    "f3grid": ("flac3d",),
    "h5m": ("h5m",),
    "hmf": ("hmf",),
    "mdpa": ("mdpa",),
    "med": ("med",),
    "mesh": ("medit",),
    "meshb": ("medit",),
    "post": ("permas",),
    "dato": ("permas",),
    "su2": ("su2",),
    "tec": ("tecplot",),
    "ugrid": ("ugrid",),
    "vol": ("netgen",),
    "wkt": ("wkt",),
}
"""Files of finite elements: the modules of meshio that may read them, in order."""

_CAD = {"step": "step", "stp": "step", "iges": "iges", "igs": "iges"}
"""Files of computer-aided design, and how cascadio calls them."""

_USD = ("usd", "usda", "usdc", "usdz")

_ASSIMP = (
    "3ds",
    "ac",
    "ase",
    "b3d",
    "cob",
    "csm",
    "hmp",
    "irrmesh",
    "irr",
    "lwo",
    "lws",
    "md2",
    "md3",
    "md5mesh",
    "mdc",
    "ms3d",
    "ndo",
    "nff",
    "ogex",
    "q3d",
    "q3o",
    "q3s",
    "smd",
    "ter",
    "vta",
    "x",
    "x3d",
    "xgl",
    "zgl",
)
"""Files of meshes that Assimp reads, and no other reader here."""

_APART = {
    "fbx": ("from_fbx", "from_fbx"),
    **dict.fromkeys(_USD, ("from_usd", "from_usd")),
    **dict.fromkeys(_ASSIMP, ("from_assimp", "from_assimp")),
}
"""Files whose readers run in a process of their own: the module of this package, and its function."""

_NEEDS = {
    **dict.fromkeys(_VTK, ("vtkmodules", "vtk", "vtk")),
    **dict.fromkeys(_MESHIO, ("meshio", "meshio", "meshio")),
    **dict.fromkeys(_CAD, ("cascadio", "cascadio", "cad")),
    **dict.fromkeys(("dae", "zae"), ("collada", "pycollada", "collada")),
    "fbx": ("ufbx", "ufbx", "fbx"),
    **dict.fromkeys(_USD, ("pxr", "usd-core", "usd")),
    **dict.fromkeys(_ASSIMP, ("assimp_py", "assimp_py", "assimp")),
}
"""For each extension: the module that it needs, the package that this is in, and the extra of clpeel that brings it."""

LIBRARY_EXTENSIONS = tuple(_NEEDS)

_DAMAGE = re.compile(r"error|cannot|could not|unable|fail|unexpected|premature|corrupt|unrecogni[sz]ed", re.IGNORECASE)
"""Messages of VTK's readers that say that data is missing, whether they are called errors or warnings there."""


def require(extension: str) -> None:
    """Raise InputError, with the command that installs it, if a file of this type needs a package that is missing."""
    if extension in _NEEDS:
        module, package, extra = _NEEDS[extension]
        if find_spec(module) is None:
            raise InputError(f"expected the package {package} to read .{extension}; run: pip install 'clpeel[{extra}]'")


def read_by_library(path: str, extension: str, data: bytes) -> Scene | None:
    """Return the scene of a file that a library of its own reads, or None if trimesh is the one to read it.

    data: the file's bytes. If the file is compressed, they are not those at the path. Raises InputError if the package
    is missing or the file is damaged, and whatever else the library raises.
    """
    require(extension)
    if extension in _CAD:
        return _from_cad(data, _CAD[extension])
    if extension not in (*_APART, *_VTK, *_MESHIO):
        return None
    with _as_file(path, data) as name:
        if extension in _APART:
            module, function = _APART[extension]
            return read_apart(f"clpeel.reading.{module}", function, os.path.abspath(name), Companions(path))
        return _by_vtk(name, extension) if extension in _VTK else _by_meshio(name, extension)


@contextlib.contextmanager
def _as_file(path: str, data: bytes) -> Iterator[str]:
    """Yield the name of a file that holds the data: the one that is there, or a copy without .gz while it is needed."""
    if not path.lower().endswith(".gz"):
        yield path
        return
    with tempfile.TemporaryDirectory() as folder:
        name = os.path.join(folder, os.path.basename(path)[:-3])
        with open(name, "wb") as file:
            file.write(data)
        yield name


def _by_vtk(path: str, extension: str) -> Scene:
    """Return the scene of one of VTK's files. What VTK reports of it is an error of one line."""
    from clpeel.reading.from_vtk import from_vtk
    from clpeel.reading.vtk_arrays import messages

    module, name = _VTK[extension]
    with messages() as told:
        reader = getattr(import_module(f"vtkmodules.{module}"), name)()
        reader.SetFileName(path)
        reader.Update()
        found = reader.GetOutputDataObject(0)
    damage = next((text for text in told if _DAMAGE.search(text)), None)
    if damage is not None:
        raise InputError(f"not a readable mesh: the file is damaged (VTK reports: {damage})")
    if found is None or not (found.IsA("vtkDataSet") or found.IsA("vtkCompositeDataSet")):
        kind = "none" if found is None else found.GetClassName()
        raise InputError(f"expected a mesh, got {kind}, which has no surface")
    scene = from_vtk(found)
    return replace(scene, notes=(*scene.notes, *(f"VTK reports: {text}" for text in told)))


_turn = threading.Lock()


def _by_meshio(path: str, extension: str) -> Scene:
    """Return the scene of a file that meshio reads. What it prints goes nowhere else."""
    from clpeel.reading.from_meshio import from_meshio

    meshio = import_module("meshio")
    wrong: Exception | None = None
    for name in _MESHIO[extension]:
        try:
            with _turn, contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
                mesh = getattr(meshio, name).read(path)
        except ModuleNotFoundError as error:
            raise InputError(
                f"expected the package {error.name} to read .{extension}; run: pip install {error.name}"
            ) from None
        except (Exception, SystemExit) as error:
            wrong = wrong or (error if isinstance(error, Exception) else ValueError(f"{name} gave up"))
            continue
        return from_meshio(mesh)
    assert wrong is not None
    raise wrong


_CONVERT = (
    "import sys, cascadio; "
    "fine = dict(tol_linear=0.001, tol_relative=True, tol_angular=0.2); "
    "data = cascadio.load(sys.stdin.buffer.read(), file_type=sys.argv[1], **fine); "
    "open(sys.argv[2], 'wb').write(data)"
)
"""Run by another process, as Open CASCADE prints to standard output, and a damaged file may end it."""

_MILLIMETRES = {"step": 1000.0, "iges": 1.0}
"""What cascadio's numbers are multiplied with: those of STEP files are metres, whatever the file has."""


def _from_cad(data: bytes, kind: str) -> Scene:
    """Return the scene of a STEP or IGES file, in millimetres. Curved faces become triangles of about 11 degrees."""
    from clpeel.reading.gltf import read_gltf

    with tempfile.TemporaryDirectory() as folder:
        target = os.path.join(folder, "out.glb")
        command = [sys.executable, "-P", "-c", _CONVERT, kind, target]  # -P: no module of the current folder
        run = subprocess.run(command, input=data, capture_output=True, check=False)
        converted = b""
        if run.returncode == 0:
            with open(target, "rb") as file:
                converted = file.read()
    if not converted:
        lines = [line for line in run.stderr.decode(errors="replace").splitlines() if line.strip()]
        told = lines[-1].strip()[:160] if lines else f"the reader ended with {run.returncode}"
        raise InputError(f"not a readable mesh: the file is damaged (Open CASCADE: {told})")
    scene = read_gltf(converted, "glb", Companions("out.glb"))
    # The finish and the sides are those of glTF where it says nothing, which the file does not say.
    scene = replace(scene, vertices=scene.vertices * _MILLIMETRES[kind], single_sided=None)
    if all(material.plain for material in scene.materials) and scene.color is not None:
        return replace(scene, materials=(), face_materials=None, color=np.array(DEFAULT_COLOR, np.uint8))
    return replace(scene, materials=tuple(replace(material, finish=None) for material in scene.materials))
