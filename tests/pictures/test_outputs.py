"""Pictures as files of each format. Read back by another library, they are what float64 makes of the colours."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import plainly
import pytest
import tifffile
from crossing import SIZE, scene
from PIL import Image
from twins import reference
from twins.textures import to_linear, to_srgb

import clpeel
from clpeel.pictures import formats

GRADIENT = ((0.9, 0.8, 0.1), (0.1, 0.3, 1.0))
HALF = np.float64(2.0**-11)
"""How far the nearest half float lies from a number of normal size, at most, as a share of it."""


@pytest.fixture(scope="module")
def results() -> dict[str, clpeel.Result]:
    made = {"over": {"background": GRADIENT}, "alone": {"background": None}}
    made["light"] = {"background": GRADIENT, "blending_space": "linear"}
    made["light alone"] = {"background": None, "blending_space": "linear"}
    return {name: plainly.render(scene(), size=SIZE, samples=4, **options) for name, options in made.items()}


def twin(result: clpeel.Result, name: str) -> np.ndarray:
    """The picture in float64: float64 [h, w, 4], sRGB 0..1, straight alpha."""
    background = None if "alone" in name else GRADIENT
    color = result.color.astype(np.float64)
    if "light" not in name or background is None:
        return reference.levels(color, background) / 255
    alpha = color[..., 3:]
    straight = np.divide(color[..., :3], alpha, out=np.zeros_like(color[..., :3]), where=alpha > 0)
    light = alpha * to_linear(straight) + (1 - alpha) * to_linear(reference.behind(background, len(color)))
    return np.concatenate([to_srgb(light), np.ones_like(alpha)], axis=-1)


def pixels_of(path: Path) -> np.ndarray:
    """Of a file, by OpenImageIO, as they are stored; alpha is left as the file has it."""
    spec = OpenImageIO.ImageSpec()
    spec["oiio:UnassociatedAlpha"] = 1
    file = OpenImageIO.ImageInput.open(str(path), spec)
    assert file is not None, OpenImageIO.geterror()
    found: np.ndarray = file.read_image(0, 0, 0, file.spec().nchannels, file.spec().format)
    file.close()
    return found


NAMES = ("over", "alone", "light", "light alone")


def with_alpha(pixels: np.ndarray) -> np.ndarray:
    """With the alpha that an opaque picture leaves out."""
    if pixels.shape[2] == 4:
        return pixels
    most = np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1
    return np.pad(pixels, ((0, 0), (0, 0), (0, 1)), constant_values=most)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("suffix", ["png", "webp", "tif", "tiff", "PNG"])
def test_eight_bits_are_those_of_the_image(results: Any, name: str, suffix: str, tmp_path: Path) -> None:
    result = results[name]
    result.save(tmp_path / f"x.{suffix}")
    with Image.open(tmp_path / f"x.{suffix}") as file:
        assert file.mode == ("RGBA" if "alone" in name else "RGB")
        assert (np.asarray(file.convert("RGBA")) == result.image).all()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_sixteen_bits_are_rounded_once(results: Any, name: str, suffix: str, tmp_path: Path) -> None:
    result = results[name]
    result.save(tmp_path / f"x.{suffix}", bits=16)
    read = pixels_of(tmp_path / f"x.{suffix}")
    assert read.dtype == np.uint16 and read.shape[2] == (4 if "alone" in name else 3)
    exact = twin(result, name) * 65535
    # Float64 may round the other way where the exact number is a half, so those within 1e-9 of one are let off.
    off = np.abs(with_alpha(read) - exact)
    assert off.max() <= 0.5 + 1e-9
    assert len(np.unique(read)) > len(np.unique(result.image))  # more than the 8 bits


@pytest.mark.parametrize("name", NAMES)
def test_a_tiff_of_floats_has_the_values_that_are_shown(results: Any, name: str, tmp_path: Path) -> None:
    results[name].save(tmp_path / "x.tif", bits=32)
    read = with_alpha(tifffile.imread(tmp_path / "x.tif"))
    assert read.dtype == np.float32
    assert np.abs(read - twin(results[name], name)).max() <= 2.0**-24


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("bits", [None, 32])
def test_exr_has_linear_light_and_premultiplied_alpha(
    results: Any, name: str, bits: int | None, tmp_path: Path
) -> None:
    results[name].save(tmp_path / "x.exr", bits=bits)
    file = OpenImageIO.ImageInput.open(str(tmp_path / "x.exr"))
    assert file.spec().channelnames == ("R", "G", "B", "A")
    read = file.read_image(OpenImageIO.FLOAT)
    assert str(file.spec().format) == ("half" if bits is None else "float")
    shown = twin(results[name], name)
    light = np.concatenate([to_linear(shown[..., :3]) * shown[..., 3:], shown[..., 3:]], axis=-1)
    # A half float below 2^-14 is a multiple of 2^-24.
    bound = np.maximum(light * HALF, 2.0**-25) if bits is None else light * 2.0**-24 + 1e-12
    assert (np.abs(read - light) <= bound * (1 + 1e-6)).all()


def test_jpeg_is_close_and_has_whole_colours(results: Any, tmp_path: Path) -> None:
    results["over"].save(tmp_path / "x.jpg")
    with Image.open(tmp_path / "x.jpg") as file:
        assert file.format == "JPEG" and file.layer[0][1:3] == file.layer[1][1:3]  # colours are as fine as brightness
        off = np.abs(np.asarray(file).astype(int) - results["over"].image[..., :3])
    assert off.mean() < 2 and off.max() < 60


def test_jpeg_needs_a_background(results: Any, tmp_path: Path) -> None:
    with pytest.raises(clpeel.InputError, match="^output: expected a background, as JPEG has no transparency"):
        results["alone"].save(tmp_path / "x.jpg")
    assert not list(tmp_path.iterdir())


def test_npz_has_image_colours_and_maps(tmp_path: Path) -> None:
    result = plainly.render(scene(), size=SIZE, maps=("depth",))
    result.save(tmp_path / "x.npz")
    with np.load(tmp_path / "x.npz", allow_pickle=False) as file:
        assert sorted(file) == ["color", "depth", "image", "provenance"]
        assert (file["image"] == result.image).all() and (file["color"] == result.color).all()
        assert (file["depth"] == result.depth).all()


def test_an_exr_has_the_maps_of_its_result(tmp_path: Path) -> None:
    result = plainly.render(scene(), size=SIZE, maps=("depth", "triangle", "normal"))
    result.save(tmp_path / "x.exr")
    image = OpenImageIO.ImageBuf(str(tmp_path / "x.exr"))
    names = list(image.spec().channelnames)
    assert sorted(names) == sorted(["R", "G", "B", "A", "Z", "id", "normal.X", "normal.Y", "normal.Z"])
    read = image.get_pixels(OpenImageIO.FLOAT)
    assert (read[..., names.index("Z")] == result.depth).all()
    assert (read[..., names.index("normal.Y")] == result.normal[..., 1]).all()
    formats_of = dict(zip(names, map(str, image.spec().channelformats), strict=True))
    assert formats_of["Z"] == "float" and formats_of["id"] == "uint" and formats_of["R"] == "half"


def test_what_is_drawn_over_the_image_is_in_16_bits_too(tmp_path: Path) -> None:
    plain = plainly.render(scene(), size=(160, 120), background=GRADIENT)
    result = plain.with_axis(clpeel.Camera.frame(scene()))
    result.save(tmp_path / "x.png", bits=16)
    read = pixels_of(tmp_path / "x.png")
    drawn = (np.abs(result.image.astype(int) - plain.image) > 1).any(axis=2)
    assert drawn.sum() > 500
    assert (read[drawn] == result.image[drawn][:, :3].astype(int) * 257).all()
    assert np.abs(read[~drawn] - twin(plain, "over")[~drawn][:, :3] * 65535).max() <= 0.5 + 1e-9


@pytest.mark.parametrize("technique", ["weighted-sum", "weighted-average", "thickness", "translucency", "glowscript"])
def test_more_bits_show_what_eight_bits_show(technique: str, tmp_path: Path) -> None:
    result = plainly.render(scene(), size=SIZE, technique=technique, background=GRADIENT)
    result.save(tmp_path / "x.tif", bits=32)
    read = tifffile.imread(tmp_path / "x.tif")
    assert np.abs(read * 255 - result.image[..., :3]).max() <= 1.5 + 1e-4


def test_a_file_needs_the_colours_that_it_holds(tmp_path: Path) -> None:
    result = plainly.render(scene(), size=SIZE, keep_color=False)
    for name, bits in (("x.png", 16), ("x.exr", None), ("x.npz", None), ("x.tif", 32)):
        with pytest.raises(clpeel.InputError, match=r"^color: expected a result rendered with keep_color=True"):
            result.save(tmp_path / name, bits=bits)
    result.save(tmp_path / "x.webp")
    assert [path.name for path in tmp_path.iterdir()] == ["x.webp"]


@pytest.mark.parametrize(
    ("name", "bits", "message"),
    [
        ("x.gif", None, "output: expected a name ending in .png, .jpg, .jpeg, .webp, .tif, .tiff, .exr or .npz, got"),
        ("x.jpg", 16, "output: expected bits that the format has"),
        ("x.png", 32, "got 32 of PNG"),
        ("x.exr", 8, "got 8 of OpenEXR"),
        (7, None, "output: expected a file name, got int"),
        ("", None, "output: expected a file name, got ''"),
    ],
)
def test_what_cannot_be_written_is_refused(results: Any, name: Any, bits: int | None, message: str) -> None:
    with pytest.raises(clpeel.InputError) as raised:
        results["over"].save(name, bits=bits)
    assert message in str(raised.value) and "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("name", "bits", "module", "extra"),
    [("x.exr", None, "OpenEXR", "exr"), ("x.png", 16, "png", "png16"), ("x.tif", 32, "tifffile", "tiff")],
)
def test_a_missing_package_is_named(
    results: Any, name: str, bits: int | None, module: str, extra: str, tmp_path: Path, monkeypatch: Any
) -> None:
    real = formats.find_spec
    monkeypatch.setattr(formats, "find_spec", lambda each: None if each == module else real(each))
    with pytest.raises(
        clpeel.InputError, match=rf"expected the package \S+ to write .*pip install 'clpeel\[{extra}\]'$"
    ):
        results["over"].save(tmp_path / name, bits=bits)


def test_a_picture_too_large_for_its_format() -> None:
    formats.check_holds(formats.WEBP, (16383, 1), False)
    with pytest.raises(clpeel.InputError, match="expected at most 16383 pixels a side in WebP, got 16384 x 1"):
        formats.check_holds(formats.WEBP, (16384, 1), False)
    with pytest.raises(clpeel.InputError, match="expected at most 65500 pixels a side in JPEG"):
        formats.check_holds(formats.JPEG, (1, 65501), False)


def test_strips_do_not_show(results: Any, tmp_path: Path, monkeypatch: Any) -> None:
    """Rows are converted some at a time. However many, the file is the same."""
    result = results["light"]
    result.save(tmp_path / "x.tif", bits=32)
    monkeypatch.setattr("clpeel.pictures.shown.STRIP_PIXELS", 7 * SIZE[0])
    result.save(tmp_path / "y.tif", bits=32)
    assert (tmp_path / "x.tif").read_bytes() == (tmp_path / "y.tif").read_bytes()


def test_no_suffix_is_a_png(results: Any, tmp_path: Path) -> None:
    for name in ("x", ".png", "é'\"\n", "x" * 255):
        results["over"].save(tmp_path / name)
        assert Image.open(io.BytesIO((tmp_path / name).read_bytes())).format == "PNG"


def test_light_beyond_half_floats_is_refused(tmp_path: Path) -> None:
    from clpeel.pictures.encode import encode
    from clpeel.pictures.shown import Shown

    color = np.full((1, 1, 4), 255.0, np.float32)
    color[..., 3] = 1
    bright = Shown(np.full((1, 1, 4), 255, np.uint8), color)
    with pytest.raises(clpeel.InputError, match="expected light that half floats hold, at most 65504, got more; give"):
        encode(bright, formats.chosen("x.exr"))
    (tmp_path / "x.exr").write_bytes(encode(bright, formats.chosen("x.exr", 32)))
    read = OpenImageIO.ImageInput.open(str(tmp_path / "x.exr")).read_image(OpenImageIO.FLOAT)
    assert np.allclose(read[0, 0, :3], to_linear(255.0), rtol=1e-6)


@pytest.mark.parametrize("name", ["x.webp", "x.png", "x.tif"])
def test_colours_that_nobody_sees_are_kept(name: str) -> None:
    from clpeel.pictures.encode import encode
    from clpeel.pictures.shown import Shown

    image = np.random.default_rng(0).integers(0, 256, (20, 30, 4), dtype=np.uint8)
    image[..., 3] = np.where(image[..., 3] < 128, 0, image[..., 3])
    with Image.open(io.BytesIO(encode(Shown(image, None), formats.chosen(name)))) as file:
        assert (np.asarray(file) == image).all()
