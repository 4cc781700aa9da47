"""The parts of a 3MF package: its zip archive, and what the XML of its models says, as numbers and text."""

from __future__ import annotations

import io
import zipfile
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import IO
from urllib.parse import unquote
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.companions import named

Attributes = dict[str, str]
"""An XML element's attributes. Names with a prefix begin with their namespace and a space."""

_FREE, _MOST_PACKED = 1 << 28, 200
"""A package may unpack to so many bytes, or to so many times its own size. Meshes unpack to 10 times theirs or less."""

_VALUES = {"base": "displaycolor", "color": "color", "composite": "values", "multi": "pindices"}
"""For each element of a property group, the attribute that matters. A tex2coord has two, u and v."""

GROUPS = ("basematerials", "colorgroup", "texture2dgroup", "compositematerials", "multiproperties")

_KNOWN = ("/core/", "/material/", "/production/", "/trianglesets/")
"""What is in the names of those namespaces whose elements are read, or do not show in a picture."""

_PAINT = ("paint_color", "mmu_segmentation")
"""Attributes in which slicers keep the colours that a triangle was painted with."""


class Package:
    """The zip archive of a 3MF package. Its parts are read by name, and nothing is unpacked into files.

    Raises InputError if it holds no model.
    """

    def __init__(self, data: bytes) -> None:
        self.archive = zipfile.ZipFile(io.BytesIO(data))
        self.parts = {plain(info.filename): info for info in self.archive.infolist()}
        self.left = max(_FREE, _MOST_PACKED * len(data))
        self.models: dict[str, Model] = {}
        self.root = self._root()

    def _root(self) -> str:
        """Return the name of the model that says what to build: what the package names, else the usual one."""
        found = list[str]()

        def start(name: str, attributes: Attributes) -> None:
            if attributes.get("Type", "").endswith("/3dmodel"):
                found.append(plain(attributes.get("Target", "")))

        if "_rels/.rels" in self.parts:
            _parse(self.open("_rels/.rels"), start)
        found += [name for name in self.parts if "3d/3dmodel.model" in name]
        root = next((name for name in found if name in self.parts), None)
        if root is None:
            raise InputError(
                "not a readable mesh: expected a 3MF package with 3D/3dmodel.model in it, got another zip archive"
            )
        return root

    def open(self, name: str) -> IO[bytes]:
        """Return a part as a file. Raises KeyError if there is none, and InputError if all would be too much."""
        info = self.parts[plain(name)]
        self.left -= info.file_size
        if self.left < 0:
            raise InputError(
                f"the file is damaged: it would unpack to {info.file_size:,} bytes and more, "
                f"which is over {_MOST_PACKED} times its size"
            )
        return self.archive.open(info)

    def model(self, name: str) -> Model | None:
        """Return a model part, or None if the package has none of this name."""
        name = plain(name)
        if name not in self.models and name in self.parts:
            self.models[name] = Model(self.open(name))
        return self.models.get(name)


def plain(name: str) -> str:
    """Return a part's name as all that mean the same are written: without a slash in front, and in lower case."""
    return unquote(name).strip("/").lower()


def _parse(file: IO[bytes], start: Callable[[str, Attributes], None]) -> None:
    """Call start for each element of an XML file. Raises InputError if it has a document type, which 3MF forbids."""

    def refuse(*_: object) -> None:
        raise InputError("the file is damaged: a model of a 3MF package has no document type, this one has")

    parser = expat.ParserCreate(namespace_separator=" ")
    parser.StartElementHandler = start
    parser.StartDoctypeDeclHandler = refuse
    parser.ParseFile(file)


@dataclass
class Group:
    """A property group: its kind (one of GROUPS), its attributes, and the text of each of its properties."""

    kind: str
    attributes: Attributes
    texts: list[str] = field(default_factory=list)


@dataclass
class Placed:
    """An object in another one, or in what is to be built. path: the part that it is in, or "" for the same one.

    matrix: float64 [4, 4], in front of a column. The file has it the other way round.
    """

    path: str
    number: int
    matrix: NDArray[np.float64]


@dataclass
class Object:
    """An object: a mesh, or other objects. group, index: its property, or -1.

    points: x, y, z one after another. corners: three indices for each triangle. given: five numbers for each triangle
    that has properties of its own: its place, their group, and those of its corners, -1 where they are not given.
    """

    group: int
    index: int
    points: array[float] = field(default_factory=lambda: array("d"))
    corners: array[int] = field(default_factory=lambda: array("i"))
    given: array[int] = field(default_factory=lambda: array("i"))
    components: list[Placed] = field(default_factory=list)


class Model:
    """A model part: its objects, property groups and textures by their numbers, and what is to be built, in order.

    left_out: for each kind of what is not read, its name. The file is read when this is made. Raises ExpatError if it
    is not XML, KeyError or ValueError if it lacks what it should have, and InputError.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self.objects: dict[int, Object] = {}
        self.groups: dict[int, Group] = {}
        self.textures: dict[int, Attributes] = {}
        self.build: list[Placed] = []
        self.left_out: dict[str, str] = {}
        self._object = Object(-1, -1)
        self._group = Group("", {})
        self._vertex = self._triangle = ""
        with file:
            _parse(file, self._start)

    def _start(self, name: str, attributes: Attributes) -> None:
        """Take in an element. Most are vertices and triangles, so that these come first."""
        if name == self._vertex:
            self._object.points.extend((float(attributes["x"]), float(attributes["y"]), float(attributes["z"])))
        elif name == self._triangle:
            self._object.corners.extend((int(attributes["v1"]), int(attributes["v2"]), int(attributes["v3"])))
            if len(attributes) > 3:
                self._give(attributes)
        else:
            self._take(name, attributes)

    def _give(self, attributes: Attributes) -> None:
        """Take in the properties of the last triangle."""
        given = [int(attributes.get(name, -1)) for name in ("pid", "p1", "p2", "p3")]
        if max(given) >= 0:
            self._object.given.extend((len(self._object.corners) // 3 - 1, *given))
        for name in attributes:
            if name.endswith(_PAINT):
                self.left_out["painted"] = f"colours painted on triangles ({name.rpartition(' ')[2]})"

    def _take(self, name: str, attributes: Attributes) -> None:
        """Take in an element that is neither a vertex nor a triangle."""
        space, _, local = name.rpartition(" ")
        if not self._vertex:  # the first element, model
            self._vertex, self._triangle = (f"{space} {each}".lstrip() for each in ("vertex", "triangle"))
        if local == "object":
            self._object = Object(int(attributes.get("pid", -1)), int(attributes.get("pindex", -1)))
            self.objects[int(attributes["id"])] = self._object
        elif local == "component":
            self._object.components.append(_placed(attributes))
        elif local == "item":
            self.build.append(_placed(attributes))
        elif local in GROUPS:
            self._group = self.groups[int(attributes["id"])] = Group(local, attributes)
        elif local in _VALUES:
            self._group.texts.append(attributes.get(_VALUES[local], ""))
        elif local == "tex2coord":
            self._group.texts.append(f"{attributes['u']} {attributes['v']}")
        elif local == "texture2d":
            self.textures[int(attributes["id"])] = attributes
        elif local.endswith("displayproperties"):
            self.left_out["display"] = "display properties"
        elif space and not any(known in space for known in _KNOWN):
            self.left_out.setdefault(space, named(local))


def _placed(attributes: Attributes) -> Placed:
    """Return where a component or an item is put. Raises KeyError or ValueError."""
    matrix = np.eye(4)
    if "transform" in attributes:
        matrix[:3] = np.array(attributes["transform"].split(), np.float64).reshape(4, 3).T
    path = next((value for name, value in attributes.items() if name.rpartition(" ")[2] == "path"), "")
    return Placed(path, int(attributes["objectid"]), matrix)
