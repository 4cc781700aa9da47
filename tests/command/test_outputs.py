"""The command's outputs: formats by suffix, bits, maps, deep files, and what `clpeel report` says of them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import pytest
from PIL import Image

import clpeel
from clpeel.command import main as cli
from clpeel.command.provenance import command_words

GIVEN = ["--opacity=0.5", "--resolution=40,30", "--quiet"]


@pytest.fixture(autouse=True)
def here(squares: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder with squares.off, which is where the command runs."""
    monkeypatch.chdir(squares.parent)
    return squares.parent


def render(*arguments: str) -> int:
    return cli.main(["render", "squares.off", *GIVEN, *arguments])


@pytest.mark.parametrize("name", ["x.png", "x.jpg", "x.webp", "x.tif", "x.exr", "x.npz"])
def test_a_picture_of_each_format(name: str, capfd: Any) -> None:
    assert render("-o", name) == 0
    assert cli.main(["report", name]) == 0
    out, err = capfd.readouterr()
    lines = dict(line.split(None, 1) for line in out.splitlines())
    assert list(lines) == ["software", "command", "technique", "scene", "device"] and err == ""
    assert lines["command"] == "clpeel render squares.off --opacity=0.5 --resolution=40,30"
    assert render("-o", name, "--no-provenance") == 0
    assert cli.main(["report", name]) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1 and f"error: {name}: expected a picture that says how clpeel" in err


def test_the_same_input_gives_the_same_bytes(here: Path) -> None:
    (here / "deeper").mkdir()
    outputs = [["-o", "a.png"], ["-ob.png"], ["--output=deeper/c.png", "--stats=s.json"], ["-o", str(here / "d.png")]]
    for arguments in outputs:
        assert render(*arguments) == 0
    assert len({path.read_bytes() for path in here.rglob("*.png")}) == 1 and len(list(here.rglob("*.png"))) == 4


def test_names_are_as_given_without_folders_from_the_root() -> None:
    words = [
        "render",
        "--output=a b.png",
        "--map=depth=/home/ann/d.npy",
        "--color=red",
        "/home/ann/it's.ply",
        "b/ü.ply",
    ]
    found = command_words({"software": "clpeel 1", "python": "x", "camera": "y", "technique": "sort"}, words)
    assert found == {
        "software": "clpeel 1",
        "command": "clpeel render --color=red 'it'\"'\"'s.ply' 'b/ü.ply'",
        "technique": "sort",
    }


def test_sixteen_bits(here: Path) -> None:
    assert render("-o", "x.png", "--bit-depth", "16") == 0
    read = OpenImageIO.ImageInput.open("x.png").read_image(OpenImageIO.UINT16)
    result = clpeel.render(clpeel.load("squares.off", opacity=0.5), view(), size=(40, 30))
    background = np.array((200, 204, 210)) / 255
    exact = result.color[..., :3] + (1 - result.color[..., 3:].astype(float)) * background
    assert np.abs(read - exact * 65535).max() <= 0.5 + 1e-9


def view() -> clpeel.Camera:
    return clpeel.Camera.frame(clpeel.load("squares.off"), (0, 0, -1), aspect=40 / 30)


def test_maps_beside_the_picture(here: Path, capfd: Any) -> None:
    maps = ["depth=d.npy", "layer-count=l.png", "triangle=t.exr", "depth=d.png", "transmittance=t.tif"]
    assert render("-o", "x.png", *(f"--map={each}" for each in maps)) == 0
    depth = np.load("d.npy")
    assert depth.dtype == np.float32 and depth.shape == (30, 40) and np.isinf(depth).any()
    with Image.open("l.png") as file:
        assert set(np.unique(np.asarray(file))) == {0, 1, 2}
    assert cli.main(["report", "d.png"]) == 0
    said = capfd.readouterr().out
    assert "\nmap        depth\n" in said and "\nlevels     depth: 0 is none, 1 is " in said
    assert cli.main(["render", "squares.off", "--resolution=40,30", "-o", "x.png", "--map", "depth=d.png"]) == 0
    assert "note: 'd.png' has levels of depth: 0 is none, 1 is " in capfd.readouterr().err


def test_maps_in_the_picture(here: Path) -> None:
    assert render("-o", "x.exr", "--map", "depth", "--map=triangle") == 0
    names = OpenImageIO.ImageInput.open("x.exr").spec().channelnames
    assert sorted(names) == ["A", "B", "G", "R", "Z", "id"]
    assert render("-o", "x.npz", "--map", "layer_count") == 0
    with np.load("x.npz") as file:
        assert file["layer_count"].max() == 2


def test_layers_as_one_file(here: Path) -> None:
    given = ["layers", "squares.off", *GIVEN]
    assert cli.main([*given, "-o", "x.exr"]) == 0
    deep = OpenImageIO.ImageInput.open("x.exr").read_native_deep_image()
    assert cli.main([*given, "-o", "x.npz"]) == 0
    layers = clpeel.load_layers("x.npz")
    assert [deep.samples(pixel) for pixel in range(1200)] == np.diff(layers.start).tolist() and layers.count == 2
    assert sorted(os.listdir()) == ["squares.off", "x.exr", "x.npz"]
    (here / "y.exr").mkdir()
    assert cli.main([*given, "-o", "y.exr"]) == 0
    assert sorted(os.listdir("y.exr")) == ["layer-01.png", "layer-02.png", "layers.npz"]
    assert cli.main(["report", "y.exr/layer-02.png"]) == 0 and cli.main(["report", "y.exr/layers.npz"]) == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["render", "-o", "x.gif"], "--output: expected a name ending in .png, .jpg"),
        (["render", "-o", "x.jpg", "--no-background"], "--output: expected a background, as JPEG has no transparency"),
        (["render", "-o", "x.jpg", "--bit-depth=16"], "--output: expected bits that the format has"),
        (["render", "-o", "x.png", "--bit-depth=12"], "--bit-depth: expected 8, 16 or 32, got '12'"),
        (["render", "-o", "-", "--bit-depth=32"], "--output: expected bits that the format has"),
        (["render", "-o", "x.webp", "--resolution=16384,1"], "--output: expected at most 16383 pixels a side in WebP"),
        (["render", "-o", "no/x.exr"], "--output: the folder '"),
        (["render", "--map", "depth"], "--map: expected depth=FILE, or --output to .exr or .npz"),
        (["render", "--map", "depth=-"], "--map: expected a name ending in one of .npy, .npz, .exr"),
        (["render", "--map", "depth=x"], "--map: expected a name ending in one of .npy, .npz, .exr"),
        (["render", "--map", "depth="], "--map: expected a name ending in one of .npy, .npz, .exr"),
        (["render", "--map", "deep=x.npy"], "--map: expected a technique that makes a map"),
        (["render", "--map", "thickness=x.npy"], "--map: expected a map of this technique (depth, normal"),
        (["render", "--map", "depth=x.npy", "--map", "normal=x.npy"], "expected a file of its own, got '"),
        (["render", "--map", "depth=squares.off.npy", "-o", "squares.off.npy"], "expected a name ending in .png"),
        (
            ["render", "--technique=thickness", "--map", "transmittance=x.npy"],
            "--map: expected a map of this technique",
        ),
        (
            ["layers", "-o", "x.exr", "--keep-alpha"],
            "--keep-alpha: expected a folder of pictures, got the file 'x.exr'",
        ),
        (["layers", "-o", ".", "--map", "depth=layers.npz"], "got 'layers.npz', which is that of a layer"),
        (["layers", "-o", ".", "--map", "depth=./layer-03.png"], "got './layer-03.png', which is that of a layer"),
        (["layers", "-o", "no/x.exr"], "--output: the folder '"),
    ],
)
def test_what_cannot_be_is_refused_before_any_work(
    arguments: list[str], message: str, capfd: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clpeel, "load", None)
    command, *options = arguments
    assert cli.main([command, "squares.off", *options]) == 2
    err = capfd.readouterr().err
    assert message in err and err.count("\n") == 1 and os.listdir() == ["squares.off"]


def test_a_missing_package_is_told_before_any_work(capfd: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("clpeel.pictures.formats.find_spec", lambda _: None)
    monkeypatch.setattr(clpeel, "load", None)
    for command in ("render", "layers"):
        assert cli.main([command, "squares.off", "-o", "x.exr"]) == 2
        assert "expected the package OpenEXR to write OpenEXR; run: pip install 'clpeel[exr]'" in capfd.readouterr().err


FULL = """
import resource, signal, sys
import numpy as np
import clpeel
result = clpeel.render(clpeel.load("squares.off"), size=(40, 30), layers=True)
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (700, 700))
for name in sys.argv[1:]:
    try:
        (result.layers if name.startswith("layers") else result).save(name)
    except clpeel.InputError as error:
        print(error)
"""
"""A process whose files may have 700 bytes, as on a disk that is full."""


def test_a_full_disk_leaves_the_old_files(here: Path) -> None:
    names = ["x.exr", "x.tif", "x.webp", "x.npz", "layers.exr", "layers.npz"]
    for name in names:
        (here / name).write_bytes(b"old")
    run = subprocess.run([sys.executable, "-P", "-c", FULL, *names], capture_output=True, text=True, timeout=120)
    assert run.stdout.splitlines() == [f"output: cannot write '{name}': File too large" for name in names], run.stderr
    assert {(here / name).read_bytes() for name in names} == {b"old"}
    assert sorted(os.listdir()) == sorted(["squares.off", *names])


def test_what_a_stranger_wrote_cannot_steer_a_terminal(here: Path, capfd: Any) -> None:
    from PIL.PngImagePlugin import PngInfo

    words = PngInfo()
    words.add_text("clpeel", json.dumps({"soft\x1bware": "a\nb\x1b[2J\u202eü"}))
    Image.new("L", (1, 1)).save("x.png", pnginfo=words)
    assert cli.main(["report", "x.png"]) == 0
    assert capfd.readouterr().out == "soft\\x1bware  a\\nb\\x1b[2J\\u202eü\n"


def test_a_heat_map_of_another_format(here: Path, capfd: Any) -> None:
    assert cli.main(["complexity", "squares.off", *GIVEN, "-o", "x.webp"]) == 0
    assert cli.main(["complexity", "squares.off", *GIVEN, "-o", "x.png"]) == 0
    with Image.open("x.webp") as one, Image.open("x.png") as other:
        assert one.format == "WEBP" and (np.asarray(one.convert("RGB")) == np.asarray(other.convert("RGB"))).all()
