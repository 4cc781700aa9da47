"""3MF packages that tests write by hand, and a careful reading of one by the standard library's XML."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
SPACES = (
    f'xmlns="{CORE}" xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02" '
    'xmlns:p="http://schemas.microsoft.com/3dmanufacturing/production/2015/06" '
    'xmlns:b="http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02"'
)
RELATIONS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="{}" Id="r"/></Relationships>'
)


def model(resources: str, build: str = "") -> str:
    """The XML of a model part."""
    return f"<?xml version='1.0'?><model {SPACES}><resources>{resources}</resources><build>{build}</build></model>"


def packed(parts: dict[str, str | bytes]) -> bytes:
    """A zip archive of these parts."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return file.getvalue()


def package(resources: str, build: str = '<item objectid="1"/>', **others: str | bytes) -> bytes:
    """A 3MF package of one model. others: further parts, in 3D/; a name has two underscores for a dot."""
    parts: dict[str, str | bytes] = {"_rels/.rels": RELATIONS.format("/3D/3dmodel.model")}
    parts["3D/3dmodel.model"] = model(resources, build)
    parts |= {f"3D/{name.replace('__', '.')}": content for name, content in others.items()}
    return packed(parts)


def mesh(points: Any, triangles: str) -> str:
    """A mesh of points, and of triangles that are written as they are, or as three digits each."""
    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in points)
    if "<" not in triangles:
        triangles = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*word) for word in triangles.split())
    return f"<mesh><vertices>{vertices}</vertices><triangles>{triangles}</triangles></mesh>"


CORNERS = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))
TETRAHEDRON = mesh(CORNERS, "021 013 032 123")
"""Its triangles face outward: its volume is 1/6."""


def square(first: str = "", second: str = "") -> str:
    """A mesh of two triangles, with these attributes."""
    points = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
    return mesh(points, f'<triangle v1="0" v2="1" v3="2" {first}/><triangle v1="0" v2="2" v3="3" {second}/>')


def read_by_hand(path: Path) -> NDArray[np.float64]:
    """The corners of all triangles of a package without paths in its items, float64 [m, 3, 3], in order."""
    with zipfile.ZipFile(path) as archive:
        trees = {f"/{n}": ElementTree.fromstring(archive.read(n)) for n in archive.namelist() if n.endswith(".model")}
    found = list[NDArray[np.float64]]()

    def transform(element: ElementTree.Element) -> NDArray[np.float64]:
        rows = np.eye(4)
        if "transform" in element.attrib:
            rows[:, :3] = np.array(element.attrib["transform"].split(), float).reshape(4, 3)
        return rows

    def build(part: str, number: str, rows: NDArray[np.float64]) -> None:
        (thing,) = (each for each in trees[part].iter(f"{{{CORE}}}object") if each.get("id") == number)
        points = [[float(v.attrib[axis]) for axis in "xyz"] for v in thing.iter(f"{{{CORE}}}vertex")]
        faces = [[int(t.attrib[name]) for name in ("v1", "v2", "v3")] for t in thing.iter(f"{{{CORE}}}triangle")]
        if faces:
            found.append((np.array(points) @ rows[:3, :3] + rows[3, :3])[faces])
        for component in thing.iter(f"{{{CORE}}}component"):
            paths = [value for name, value in component.attrib.items() if name.endswith("}path")]
            build(paths[0] if paths else part, component.attrib["objectid"], transform(component) @ rows)

    for item in trees["/3D/3dmodel.model"].iter(f"{{{CORE}}}item"):
        build("/3D/3dmodel.model", item.attrib["objectid"], transform(item))
    return np.concatenate(found)
