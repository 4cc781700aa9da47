"""Rewrites glTF so that trimesh reads it correctly, and notes what the picture will lack."""

from __future__ import annotations

import importlib.util
import json
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from clpeel.errors import InputError
from clpeel.reading.companions import Companions, named
from clpeel.reading.images import unusable
from clpeel.reading.strips import fan, strip
from clpeel.scene.arrays import AnyArray

Json = dict[str, Any]
"""A JSON object. Its contents are checked where they are read."""

_DRACO = "KHR_draco_mesh_compression"
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_GLOSS = "KHR_materials_pbrSpecularGlossiness"

_READ = ("KHR_mesh_quantization", _GLOSS, "EXT_texture_webp", "KHR_xmp", "KHR_xmp_json_ld", _DRACO, *_MESHOPT)
"""Extensions that never need a note. Their data is read, or is refused where it is found, or does not show in a
picture."""

_APPEARANCE = ("KHR_materials_", "EXT_materials_", "KHR_lights_", "EXT_lights_")
"""Prefixes of the names of extensions that change the appearance only, never the shape."""

_APPEARANCES = (
    "KHR_texture_transform KHR_texture_basisu EXT_texture_avif MSFT_texture_dds KHR_animation_pointer".split()
)

_MOST_ZEROS = 2**26
"""The most numbers that an accessor without data may have. Otherwise a small file could ask for all the memory there
is."""

_LINES, _LOOP, _LINE_STRIP, _TRIANGLES, _STRIP, _FAN = range(1, 7)
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_KINDS = {
    "normalTexture": "normal",
    "occlusionTexture": "occlusion",
    "emissiveTexture": "emissive",
    "metallicRoughnessTexture": "metallic-roughness",
}


def plain_gltf(data: bytes, extension: str, companions: Companions) -> tuple[bytes, list[str]]:
    """Return the JSON of a .glb or .gltf file in a form that trimesh reads correctly, and notes of what it lacks.

    Its buffers and images are put into companions.given. Raises InputError. Where the file breaks the format, it may
    also raise KeyError, IndexError, TypeError, AttributeError or ValueError.
    """
    text, binary = _chunks(data) if extension == "glb" else (data, None)
    try:
        tree = json.loads(text.decode("utf-8-sig", "replace"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"not a readable mesh: expected JSON, got what is not: {error}") from None
    if not isinstance(tree, dict):
        raise InputError("not a readable mesh: expected a JSON object { }, got another value")
    version = str(tree.get("asset", {}).get("version", "2.0"))
    if version.split(".")[0] != "2":
        raise InputError(f"expected glTF 2, got version {named(version)}; convert it to glTF 2")
    document = _Document(tree, binary, companions)
    document.check_extensions()
    document.read_buffers()
    for node in tree.get("nodes", []):
        node.pop("camera", None)  # trimesh drops the mesh and the transform of a node with a camera
    for mesh in tree.get("meshes", []):
        for primitive in mesh["primitives"]:
            document.straighten(primitive)
    return document.finished(), document.notes


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """Return the JSON of a .glb file and its binary chunk.

    Raises InputError if the file is cut or of another version.
    """
    if len(data) < 20:
        raise InputError(f"the file is cut: expected 20 bytes or more, got {len(data)}")
    version, length = (int.from_bytes(data[at : at + 4], "little") for at in (4, 8))
    if version != 2:
        raise InputError(f"expected glTF 2, got version {version}; convert it to glTF 2")
    found: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= min(length, len(data)):
        size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        if at + 8 + size > len(data):
            raise InputError(f"the file is cut: expected a chunk of {size:,} bytes, got {len(data) - at - 8:,}")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in found:
        raise InputError(
            "not a readable mesh: expected a chunk of JSON in the .glb file, got none; the file is damaged"
        )
    return found[b"JSON"], found.get(b"BIN\0")


class _Document:
    """A glTF file's JSON while it is being rewritten."""

    def __init__(self, tree: Json, binary: bytes | None, companions: Companions) -> None:
        self.tree, self.binary, self.companions = tree, binary, companions
        self.buffers: list[bytes] = []
        self.notes: list[str] = []
        self.made: dict[tuple[str, int], int] = {}

    # --- extensions and buffers ---------------------------------------------------------------------------------------

    def check_extensions(self) -> None:
        """Raise InputError if the file requires an extension that is not read.

        Add a note of the extensions that are ignored.
        """
        required = [str(name) for name in self.tree.get("extensionsRequired", [])]
        used = [str(name) for name in self.tree.get("extensionsUsed", [])]
        for name in required:
            if name in _MESHOPT or (name == _DRACO and not _decodes_draco()):
                raise InputError(f"{name}: {_how_to(name)}")
            if name not in _READ and name not in _APPEARANCES and not name.startswith(_APPEARANCE):
                raise InputError(f"the file requires the glTF extension {named(name)}, which is not read")
        lacking = sorted({name for name in (*required, *used) if name not in _READ})
        if lacking:
            shown = ", ".join(name if name.isidentifier() else named(name) for name in lacking[:20])
            more = f" and {len(lacking) - 20} more" if len(lacking) > 20 else ""
            self.notes.append(f"glTF extensions left out: {shown}{more}")

    def read_buffers(self) -> None:
        """Read the bytes of every buffer, and store them for trimesh under a new name.

        Raises InputError if any are missing.
        """
        views = self.tree.get("bufferViews", [])
        self.tree.setdefault("accessors", [])
        self.tree["bufferViews"] = views
        for index, buffer in enumerate(self.tree.setdefault("buffers", [])):
            if "uri" in buffer:
                try:
                    data = self.companions.get(buffer["uri"])
                except FileNotFoundError as error:
                    raise InputError(f"not a readable mesh: the buffer {error}") from None
            elif index == 0 and self.binary is not None:
                data = self.binary
            else:
                packed = [name for name in _MESHOPT if name in buffer.get("extensions", {})]
                raise InputError(
                    f"{packed[0]}: {_how_to(packed[0])}"
                    if packed
                    else f"the file is damaged: buffer {index} has no data"
                )
            self.buffers.append(data)
            buffer["uri"] = self._give("buffer", data)
        if any("bufferView" not in accessor and accessor["count"] > _MOST_ZEROS for accessor in self.tree["accessors"]):
            raise InputError(
                f"the file is damaged: it promises more than {_MOST_ZEROS:,} numbers that it does not hold"
            )
        for index, view in enumerate(views):
            end, held = view.get("byteOffset", 0) + view["byteLength"], len(self.buffers[view["buffer"]])
            if end > held:
                raise InputError(f"the file is cut: part {index} ends at byte {end:,} of a buffer of {held:,}")

    def _give(self, kind: str, data: bytes) -> str:
        """Store these bytes in the companions. Returns the name by which trimesh can ask for them."""
        name = f"clpeel:{kind}:{len(self.companions.given)}"
        self.companions.given[name] = data
        return name

    # --- primitives ---------------------------------------------------------------------------------------------------

    def straighten(self, primitive: Json) -> None:
        """Turn a primitive's strips and fans into triangles, and its packed and sparse numbers into plain ones."""
        attributes = primitive["attributes"]
        if _DRACO in primitive.get("extensions", {}):
            if _decodes_draco():
                return
            held = [*attributes.values(), *([primitive["indices"]] if "indices" in primitive else [])]
            if any("bufferView" not in self.tree["accessors"][index] for index in held):
                raise InputError(f"{_DRACO}: {_how_to(_DRACO)}")
            del primitive["extensions"][_DRACO]
        mode = primitive.get("mode", _TRIANGLES)
        if mode in (_LOOP, _LINE_STRIP):
            primitive["mode"] = _LINES  # trimesh skips lines, and says so
        if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in attributes:
            return
        for name in ("POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0"):
            if name in attributes:
                attributes[name] = self._plain(name, attributes[name])
        count = self.tree["accessors"][attributes["POSITION"]]["count"]
        sparse = "indices" in primitive and "sparse" in self.tree["accessors"][primitive["indices"]]
        if mode == _TRIANGLES and not sparse and ("indices" in primitive or count % 3 == 0):
            return
        indices = self._values(primitive["indices"]).reshape(-1) if "indices" in primitive else np.arange(count)
        indices = indices.astype(np.uint32)
        if mode == _TRIANGLES:
            faces = indices[: len(indices) // 3 * 3]
        else:
            faces = strip(indices) if mode == _STRIP else fan(indices)
        primitive["indices"] = self._add(faces.reshape(-1, 1))
        primitive["mode"] = _TRIANGLES

    def _plain(self, name: str, index: int) -> int:
        """Return an accessor of this attribute's numbers that trimesh reads correctly: float32 and not sparse.

        Colours keep their type, as trimesh reads that correctly.
        """
        accessor = self.tree["accessors"][index]
        packed = accessor["componentType"] != 5126 and name != "COLOR_0"
        if not packed and "sparse" not in accessor:
            return index
        if (name, index) not in self.made:
            values = self._values(index)
            if packed:
                top = np.iinfo(values.dtype).max if accessor.get("normalized") else 1
                values = np.maximum(values / np.float32(top), -1 if top > 1 else -np.inf).astype(np.float32)
            self.made[name, index] = self._add(values)
        return self.made[name, index]

    def _values(self, index: int) -> AnyArray:
        """Return an accessor's numbers [count, width] in the stored type, with the sparse ones in their places."""
        accessor = self.tree["accessors"][index]
        count, width, kind = accessor["count"], _WIDTHS[accessor["type"]], _TYPES[accessor["componentType"]]
        if "bufferView" in accessor:
            values = self._stored(accessor, kind, count, width)
        else:
            values = np.zeros((count, width), kind)
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            places = self._stored(sparse["indices"], _TYPES[sparse["indices"]["componentType"]], sparse["count"], 1)
            values = values.copy()
            values[places[:, 0].astype(np.intp)] = self._stored(sparse["values"], kind, sparse["count"], width)
        return values

    def _stored(self, place: Json, kind: str, count: int, width: int) -> AnyArray:
        """Return numbers [count, width] at a byteOffset of a bufferView.

        Raises ValueError or TypeError if it holds fewer.
        """
        view, row = self.tree["bufferViews"][place["bufferView"]], np.dtype(kind)
        start = view.get("byteOffset", 0)
        data = memoryview(self.buffers[view["buffer"]])[start : start + view["byteLength"]]
        strides = (view.get("byteStride", row.itemsize * width), row.itemsize)
        return np.ndarray((count, width), row, data, place.get("byteOffset", 0), strides)

    def _add(self, values: AnyArray) -> int:
        """Add an accessor for numbers [count, width], in a new buffer. Returns its index."""
        data = np.ascontiguousarray(values).tobytes()
        kind = next(number for number, name in _TYPES.items() if np.dtype(name) == values.dtype)
        shape = next(name for name, width in _WIDTHS.items() if width == values.shape[1])
        self.buffers.append(data)
        self.tree["buffers"].append({"uri": self._give("numbers", data), "byteLength": len(data)})
        self.tree["bufferViews"].append({"buffer": len(self.buffers) - 1, "byteLength": len(data)})
        view = len(self.tree["bufferViews"]) - 1
        self.tree["accessors"].append(
            {"bufferView": view, "componentType": kind, "count": len(values), "type": shape, "normalized": False}
        )
        return len(self.tree["accessors"]) - 1

    # --- what the picture lacks ---------------------------------------------------------------------------------------

    def finished(self) -> bytes:
        """Return the JSON for trimesh, which keeps only the images of base colours. Notes say what is not drawn."""
        self._note_shapes()
        self._note_materials()
        return json.dumps(self.tree).encode()

    def _note_shapes(self) -> None:
        """Add notes of skins and morph targets, which are not drawn."""
        nodes, meshes = self.tree.get("nodes", []), self.tree.get("meshes", [])
        skinned = sum("skin" in node and "mesh" in node for node in nodes)
        if skinned:
            self.notes.append(f"skins left out: {skinned} mesh(es) are drawn as stored, not posed")
        posed = [
            node
            for node in nodes
            if "mesh" in node and any(node.get("weights", meshes[node["mesh"]].get("weights", [])))
        ]
        if posed:
            self.notes.append(f"morph targets left out: {len(posed)} mesh(es) are drawn without their weights")

    def _used_materials(self) -> Iterator[tuple[str, Json]]:
        """Yield each material that a primitive uses, after its name for a note."""
        primitives = [p for mesh in self.tree.get("meshes", []) for p in mesh["primitives"]]
        for index in sorted({p["material"] for p in primitives if "material" in p}):
            material = self.tree["materials"][index]
            yield named(str(material.get("name", index))), material

    def _note_materials(self) -> None:
        """Add notes of textures that are not drawn.

        Keep only images of base colours, and only those that Pillow can open.
        """
        kinds, sets, wanted = Counter[str](), list[str](), dict[int, int | None]()
        for name, material in self._used_materials():
            colors = material.get("pbrMetallicRoughness", {})
            for key, value in [*material.items(), *colors.items()]:
                if key in _KINDS and isinstance(value, dict):
                    kinds[_KINDS[key]] += 1
            gloss = material.get("extensions", {}).get(_GLOSS, {})
            for key in ("baseColorTexture", "diffuseTexture", "specularGlossinessTexture"):
                texture = colors.get(key) or gloss.get(key)
                if texture is None:
                    continue
                shift = texture.get("extensions", {}).get("KHR_texture_transform", {})
                if shift.get("texCoord", texture.get("texCoord", 0)):
                    sets.append(name)
                wanted[texture["index"]] = None
        images = self._images(sorted(wanted))
        self.tree["images"] = images
        if kinds:
            listed = ", ".join(kind for kind in _KINDS.values() if kind in kinds)
            self.notes.append(f"textures left out, as only base colours are drawn: {listed}")
        if sets:
            listed = ", ".join(sets[:5]) + (", …" if len(sets) > 5 else "")
            self.notes.append(f"second texture coordinates left out: {listed} drawn with the first set")

    def _images(self, textures: list[int]) -> list[Json]:
        """Return a new list of the images of these textures, each checked. All other textures lose their sources."""
        stored, images, places = self.tree.get("images", []), list[Json](), dict[int, int | None]()
        for index, texture in enumerate(self.tree.get("textures", [])):
            webp = texture.pop("extensions", {}).get("EXT_texture_webp", {})
            source = webp.get("source", texture.pop("source", None))
            texture.pop("source", None)
            if index not in textures:
                continue
            if source is None:
                self.notes.append(f"texture {index} left out: it has no image of a kind that is read")
                continue
            if source not in places:
                places[source] = None
                data, name = self._image(stored[source], source)
                if data is not None:
                    problem = unusable(data)
                    if problem:
                        self.notes.append(f"texture {name} left out: {problem}")
                    else:
                        places[source] = len(images)
                        images.append({"uri": self._give("image", data)})
            if places[source] is not None:
                texture["source"] = places[source]
        return images

    def _image(self, image: Json, index: int) -> tuple[bytes | None, str]:
        """Return an image's bytes and its name for notes. The bytes are None, after a note, if they cannot be read."""
        uri = image.get("uri", "")
        name = named(str(image.get("name") or (uri if uri and not uri.startswith("data:") else f"image {index}")))
        if "bufferView" in image:
            view = self.tree["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            return self.buffers[view["buffer"]][start : start + view["byteLength"]], name
        try:
            return self.companions.get(uri), name
        except FileNotFoundError:
            self.notes.append(f"texture {name} left out: {self.companions.lost[uri]}")
            return None, name


def _how_to(name: str) -> str:
    """Return what the user can do about a compression that is not read."""
    words = "Draco" if name == _DRACO else "meshopt"
    also = " (or install DracoPy)" if name == _DRACO else ""
    return f"the file's meshes are compressed, which is not read; export it without {words} compression{also}"


def _decodes_draco() -> bool:
    """Return whether trimesh has the packages that it needs to decode Draco."""
    if importlib.util.find_spec("DracoPy") is None:
        return False
    try:
        from trimesh.exchange.gltf import extensions
    except ImportError:
        return False
    return not extensions.unregistered([_DRACO], "primitive_preprocess")
