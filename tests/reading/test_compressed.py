"""Compressed meshes: what Draco and meshopt packed comes back as it was, and damaged data are refused in one line."""

from __future__ import annotations

import builtins
import json
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import DracoPy
import meshopt
import numpy as np
import pytest
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading import compressed

POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
DOUBLE = POINTS.astype(np.float64)
"""DracoPy takes no other type for texture coordinates and normals, and stores float32."""


def packed(**attributes: Any) -> bytes:
    """A Draco mesh of two triangles, with its vertices in order."""
    return bytes(DracoPy.encode(POINTS, FACES, preserve_order=True, quantization_bits=20, **attributes))


def uncompressed(rows: NDArray[Any], filter: str) -> NDArray[Any]:
    """Rows, once meshopt has packed them and compressed.py has unpacked them and undone the filter."""
    data = meshopt.encode_gltf_buffer(rows, "ATTRIBUTES")
    stride = rows.itemsize * rows.shape[1]
    return np.frombuffer(compressed.meshopt(data, len(rows), stride, "ATTRIBUTES", filter), rows.dtype)


# --- Draco ----------------------------------------------------------------------------------------------------------


def test_draco_attributes_come_by_their_ids_in_their_types() -> None:
    given = {
        3: np.array([[0, 1, 2, 3], [65535, 5, 6, 7], [8, 9, 10, 11], [4, 3, 2, 1]], np.uint16),
        4: np.linspace(0, 1, 16, dtype=np.float32).reshape(4, 4),
        6: np.arange(4, dtype=np.uint32).reshape(4, 1) * 2**29,
    }
    colors = np.arange(16, dtype=np.uint8).reshape(4, 4) * 17
    data = packed(generic_attributes=given, colors=colors, tex_coord=DOUBLE[:, :2] / 2, normals=DOUBLE - 0.25)
    faces, found = compressed.draco(data)
    assert faces.tolist() == FACES.tolist()
    for name, values in given.items():
        assert found[name].dtype == values.dtype and (found[name] == values).all()
    mesh = DracoPy.decode(data)
    ids = {kind: mesh.get_attribute_by_type(kind)["unique_id"] for kind in DracoPy.AttributeType if kind in range(4)}
    kinds = DracoPy.AttributeType
    assert (found[ids[kinds.COLOR]] == colors).all() and found[ids[kinds.COLOR]].dtype == np.uint8
    np.testing.assert_allclose(found[ids[kinds.POSITION]], POINTS, atol=2**-20)
    np.testing.assert_array_equal(found[ids[kinds.TEX_COORD]], DOUBLE[:, :2] / 2)
    np.testing.assert_array_equal(found[ids[kinds.NORMAL]], DOUBLE - 0.25)


@pytest.mark.parametrize("fractions", [0, 1])
@pytest.mark.parametrize(("stored", "signed"), [("u1", "i1"), ("u2", "i2")])
def test_signed_draco_integers_stay_integers(stored: str, signed: str, fractions: int) -> None:
    """They are encoded without a sign. The attribute's head gets it: kind, type, width, whether fractions, id."""
    values = np.array([[1, -2], [100, -100], [-127, 127], [0, 5]], signed)
    data = bytearray(packed(generic_attributes={5: values.view(stored)}))
    number = {"u1": 2, "u2": 4}[stored]
    at = data.index(bytes((4, number, 2, 0, 5)))
    data[at + 1], data[at + 3] = number - 1, fractions
    _, found = compressed.draco(bytes(data))
    assert found[5].dtype == signed and (found[5] == values).all()


def test_a_real_draco_file_has_what_its_gltf_promises(model: Callable[[str], Path]) -> None:
    path = model("draco-engine/2CylinderEngine.gltf")
    tree = json.loads(path.read_text())
    buffer = path.with_suffix(".bin").read_bytes()
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            extension = primitive["extensions"]["KHR_draco_mesh_compression"]
            view = tree["bufferViews"][extension["bufferView"]]
            start = view.get("byteOffset", 0)
            faces, found = compressed.draco(buffer[start : start + view["byteLength"]])
            assert faces.size == tree["accessors"][primitive["indices"]]["count"]
            for name, number in extension["attributes"].items():
                accessor = tree["accessors"][primitive["attributes"][name]]
                assert found[number].shape == (accessor["count"], 3) and found[number].dtype == np.float32
                size = np.subtract(accessor["max"], accessor["min"]).max()
                if name == "POSITION":
                    np.testing.assert_allclose(found[number].max(axis=0), accessor["max"], atol=size / 2**10)
                    np.testing.assert_allclose(found[number].min(axis=0), accessor["min"], atol=size / 2**10)


# --- meshopt --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("version", [0, 1])
def test_meshopt_gives_the_bytes_that_were_packed(version: int) -> None:
    rows = np.random.default_rng(1).integers(0, 256, (1000, 12), np.uint8)
    data = meshopt.encode_gltf_buffer(rows, "ATTRIBUTES", version)
    assert compressed.meshopt(data, 1000, 12, "ATTRIBUTES", "NONE") == rows.tobytes()


@pytest.mark.parametrize("kind", [np.uint16, np.uint32])
def test_meshopt_gives_the_indices_that_were_packed(kind: type) -> None:
    strip = np.arange(300)
    faces = np.stack([strip, strip + 1, strip + 2], axis=1).astype(kind)
    size = np.dtype(kind).itemsize
    data = compressed.meshopt(meshopt.encode_gltf_buffer(faces, "TRIANGLES"), 900, size, "TRIANGLES", "NONE")
    found = np.frombuffer(data, kind).reshape(-1, 3)
    turned = [np.roll(face, -int(face.argmin())).tolist() for face in found]  # it may begin at another corner
    assert turned == faces.tolist()
    data = compressed.meshopt(meshopt.encode_gltf_buffer(faces, "INDICES"), 900, size, "INDICES", "NONE")
    assert data == faces.tobytes()


def test_the_octahedral_filter_is_that_of_the_specification() -> None:
    """x and y over the third number, folded where z is below 0; the fourth is kept."""
    rows = np.array(
        [[0, 0, 127, 5], [127, 0, 127, 6], [0, -127, 127, 7], [127, 127, 127, 8], [64, 63, 127, 9]], np.int8
    )
    half = round(127 / 2**0.5)
    expected = [[0, 0, 127, 5], [127, 0, 0, 6], [0, -127, 0, 7], [0, 0, -127, 8], [half, half - 1, 0, 9]]
    found = uncompressed(rows, "OCTAHEDRAL").reshape(-1, 4)
    assert np.abs(found - np.array(expected)).max() <= 1 and (found[:, 3] == rows[:, 3]).all()
    wide = rows.astype(np.int16)
    wide[:, :3] *= 258
    found = uncompressed(wide, "OCTAHEDRAL").reshape(-1, 4)
    assert np.abs(found[:4, :3] / 32767 - np.array(expected)[:4, :3] / 127).max() <= 1 / 32767


def test_the_quaternion_filter_is_that_of_the_specification() -> None:
    """Three numbers over the fourth, which also says in two bits where the greatest one is; that one is made."""
    one = 32764  # a multiple of four
    rows = np.array([[0, 0, 0, one + place] for place in range(4)] + [[one, 0, 0, one + 3]], np.int16)
    found = uncompressed(rows, "QUATERNION").reshape(-1, 4) / 32767
    np.testing.assert_allclose(found[:4], np.eye(4), atol=1e-4)
    np.testing.assert_allclose(found[4], [0.5**0.5, 0, 0, 0.5**0.5], atol=1e-3)


def test_the_exponential_filter_is_that_of_the_specification() -> None:
    """24 bits with a sign, times two to the power of the upper 8."""
    mantissas, exponents = np.array([[1], [-3], [5], [0]]), np.array([[0], [4], [-8], [9]])
    words = ((exponents << 24) | (mantissas & 0xFFFFFF)).astype(np.int64).astype(np.uint32)
    assert uncompressed(words, "EXPONENTIAL").view(np.float32).tolist() == [1.0, -48.0, 5 / 256, 0.0]


# --- what is damaged or missing ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["DracoPy", "meshopt"])
def test_without_its_package_one_line_says_what_to_install(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    known = builtins.__import__

    def without(module: str, *rest: Any, **named: Any) -> Any:
        if module == name:
            raise ImportError(module)
        return known(module, *rest, **named)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(InputError) as error:
        compressed.draco(b"") if name == "DracoPy" else compressed.meshopt(b"", 1, 4, "ATTRIBUTES", "NONE")
    assert name in str(error.value) and "pip install 'clpeel[formats]'" in str(error.value)
    assert "\n" not in str(error.value)


def damaged(data: bytes) -> list[bytes]:
    """Copies of the data that are cut or have other bits, the same ones each time."""
    chance = random.Random(7)
    copies = [data[: chance.randrange(len(data))] for _ in range(100)]
    for _ in range(200):
        copy = bytearray(data)
        for _ in range(chance.choice((1, 1, 3, 10))):
            copy[chance.randrange(len(copy))] ^= 1 << chance.randrange(8)
        copies.append(bytes(copy))
    return copies


def refused_in_one_line(read: Callable[[bytes], Any], data: bytes) -> int:
    """How many damaged copies are refused. The others are read; nothing else may happen."""
    count = 0
    for copy in damaged(data):
        try:
            read(copy)
        except InputError as error:
            assert str(error).startswith("the file is damaged: ") and "\n" not in str(error)
            count += 1
    return count


def test_damaged_draco_data_are_refused() -> None:
    assert refused_in_one_line(compressed.draco, packed(colors=np.full((4, 4), 7, np.uint8))) >= 100


@pytest.mark.parametrize("mode", ["ATTRIBUTES", "TRIANGLES", "INDICES"])
def test_damaged_meshopt_data_are_refused(mode: Any) -> None:
    values = np.random.default_rng(2).integers(0, 200, (300, 1), np.uint32)
    data = meshopt.encode_gltf_buffer(values if mode == "ATTRIBUTES" else values.reshape(-1), mode)
    assert refused_in_one_line(lambda copy: compressed.meshopt(copy, 300, 4, mode, "NONE"), data) >= 100


@pytest.mark.parametrize(
    "wrong",
    [
        (301, 4, "TRIANGLES"),
        (300, 3, "TRIANGLES"),
        (300, 3, "ATTRIBUTES"),
        (300, 4, "FACES"),
        (3 * 2**40, 4, "TRIANGLES"),
    ],
)
def test_meshopt_promises_that_cannot_be_are_refused(wrong: tuple[int, int, str]) -> None:
    data = meshopt.encode_gltf_buffer(np.zeros(300, np.uint32), "TRIANGLES")
    with pytest.raises(InputError, match="the file is damaged"):
        compressed.meshopt(data, *wrong, "NONE")


def test_the_most_that_meshopt_packs_is_read() -> None:
    rows = np.zeros((1_000_000, 4), np.uint8)
    data = meshopt.encode_gltf_buffer(rows, "ATTRIBUTES", 1)
    assert compressed.meshopt(data, len(rows), 4, "ATTRIBUTES", "NONE") == rows.tobytes()
