"""Documents: small glTF files made by hand, for tests."""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from clpeel.errors import InputError
from clpeel.reading.load import load
from clpeel.scene.scene import Scene

POINTS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.5], [2, 0, 1]], np.float32)
UV = np.array([[0.25, 0.5], [1, 0], [0, 1]], np.float32)
COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125, "float32": 5126}


class Document:
    """A glTF document of one mesh with one primitive, its numbers in one embedded buffer."""

    def __init__(self, points: np.ndarray = POINTS, **primitive: Any) -> None:
        self.data = b""
        self.views: list[Any] = []
        self.accessors: list[Any] = []
        self.primitive = {"attributes": {"POSITION": self.add(points)}, **primitive}
        self.more: dict[str, Any] = {}

    def view(self, data: bytes) -> int:
        """The bytes as a new bufferView."""
        self.data += bytes(-len(self.data) % 4)
        self.views.append({"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        return len(self.views) - 1

    def add(self, values: np.ndarray, **more: Any) -> int:
        """The numbers as a new accessor."""
        kind = "SCALAR" if values.ndim == 1 else "MAT4" if values.shape[1] == 16 else f"VEC{values.shape[1]}"
        component = COMPONENTS[values.dtype.name]
        accessor = {"bufferView": self.view(values.tobytes()), "componentType": component, "count": len(values)}
        self.accessors.append({**accessor, "type": kind, **more})
        return len(self.accessors) - 1

    def tree(self, uri: bool = True) -> dict[str, Any]:
        """The whole JSON."""
        buffer: dict[str, Any] = {"byteLength": len(self.data)}
        if uri:
            buffer["uri"] = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        return {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [self.primitive]}],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [buffer],
            **self.more,
        }

    def path(self, folder: Path) -> Path:
        """The path of it as a .gltf file."""
        path = folder / "t.gltf"
        path.write_text(json.dumps(self.tree()))
        return path

    def load(self, folder: Path, **options: Any) -> Scene:
        """What `load` makes of it as a .gltf file."""
        return load(self.path(folder), **options)

    def glb(self, folder: Path) -> Path:
        """The path of it as a .glb file."""
        text = json.dumps(self.tree(uri=False)).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + bytes(-len(self.data) % 4)
        body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
        path = folder / "t.glb"
        path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body)
        return path


def refusal(document: Document, folder: Path, **options: Any) -> str:
    """Return the one line that refuses the document."""
    with pytest.raises(InputError) as error:
        document.load(folder, **options)
    text = str(error.value)
    assert "\n" not in text and "the reader stopped with" not in text and len(text) < 330, text
    return text


def png(pixels: Any = None) -> bytes:
    """The pixels as a PNG; 2 x 2 red ones by default."""
    stream = io.BytesIO()
    if pixels is None:
        pixels = np.full((2, 2, 3), (255, 0, 0))
    pytest.importorskip("PIL.Image").fromarray(np.asarray(pixels, np.uint8)).save(stream, "PNG")
    return stream.getvalue()


def plain(material: dict[str, Any] | None = None, **attributes: np.ndarray) -> Document:
    """A triangle with a material, and with attributes of its vertices; integers are normalized."""
    document = Document(POINTS[:3])
    if material is not None:
        document.primitive["material"] = 0
        document.more["materials"] = [material]
    for name, values in attributes.items():
        more = {"normalized": True} if values.dtype.kind != "f" and not name.startswith("JOINTS") else {}
        document.primitive["attributes"][name] = document.add(values, **more)
    return document


def textured(picture: bytes, info: dict[str, Any] | None = None, **material: Any) -> Document:
    """A triangle whose base colour is a picture, with coordinates for it. info: more of its textureInfo."""
    color = {"baseColorTexture": {"index": 0, **(info or {})}}
    document = plain({"pbrMetallicRoughness": color, **material}, TEXCOORD_0=UV)
    document.more["images"] = [{"bufferView": document.view(picture), "mimeType": "image/png", "name": "wood"}]
    document.more["textures"] = [{"source": 0}]
    return document
