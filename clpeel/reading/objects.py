"""Objects: recognizes meshes of other libraries, without importing these, and turns them into Scenes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from clpeel.errors import InputError
from clpeel.scene.scene import Scene

KNOWN = "a trimesh, PyVista, VTK, meshio or Open3D object"
"""What may be given, in words."""


def of_object(thing: Any) -> Scene | None:
    """Return the scene of a mesh of another library, or None if it is none that is known.

    Its classes are known by their names and those of their modules. So nothing is imported that is not there already.
    Raises InputError if there is nothing to draw, and for a PyVista plotter, which has a camera and lights as well.
    """
    found = _reader(thing)
    return None if found is None else found(thing)


def library_of(thing: Any) -> str:
    """Return the name of the library that an object is from, as errors name it."""
    return {"vtkmodules": "VTK", "pyvista": "PyVista", "open3d": "Open3D"}.get(_root(type(thing)), _root(type(thing)))


def _reader(thing: Any) -> Callable[[Any], Scene] | None:
    """Return the function that turns an object into a Scene, or None. The function's module is imported here."""
    names = _names(thing)
    if names & {("vtkmodules", "vtkDataSet"), ("vtkmodules", "vtkCompositeDataSet")}:
        from clpeel.reading.from_vtk import from_vtk

        return from_vtk
    if ("pyvista", "BasePlotter") in names:
        raise InputError("it is a plotter, which has a camera, too: use clpeel.from_pyvista(plotter)")
    if ("meshio", "Mesh") in names:
        from clpeel.reading.from_meshio import from_meshio

        return from_meshio
    if any(root == "open3d" and name in ("TriangleMesh", "LineSet", "PointCloud") for root, name in names):
        from clpeel.reading.from_open3d import from_open3d

        return from_open3d
    # Asking trimesh for its paths would import packages that it may lack.
    if names & {("trimesh", name) for name in ("Trimesh", "Scene", "PointCloud", "Path")}:
        from clpeel.reading.from_trimesh import from_trimesh

        return from_trimesh
    return None


def _names(thing: Any) -> set[tuple[str, str]]:
    """Return the names of an object's classes, each with that of the package it is from."""
    return {(_root(base), base.__name__) for base in type(thing).__mro__}


def _root(kind: type) -> str:
    return kind.__module__.partition(".")[0]
