"""The renderer: its options, its stats, its bounded memory, and a scene kept on the device."""

from __future__ import annotations

import json

import numpy as np
import plainly
import pytest

import clpeel
from clpeel.checks import parse_memory
from clpeel.techniques import TECHNIQUES


@pytest.fixture(scope="module")
def scene() -> clpeel.Scene:
    rng = np.random.default_rng(0)
    return clpeel.Scene.from_arrays(
        rng.uniform(-1, 1, (300, 3)),
        np.arange(300).reshape(-1, 3),
        face_colors=np.r_[rng.integers(0, 255, (99, 4), dtype=np.uint8), [[0, 0, 0, 255]]].astype(np.uint8),
    )


CAMERA = clpeel.Camera((0, 0, 4), (0, 0, 0))


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_stats_tell_what_was_done(scene, technique):
    stats = plainly.render(scene, CAMERA, (64, 48), technique=technique).stats
    assert stats["technique"] == technique and stats["size"] == [64, 48]
    assert stats["triangles"] == 100 and stats["discarded"] == 0 and stats["clipped"] == 0
    assert stats["fragments"] >= stats["samples_passed"][0] > 1000
    assert 1 <= stats["passes"] <= stats["passes_issued"] == len(stats["samples_passed"])
    assert len(stats["seconds_per_pass"]) == stats["passes_issued"] and min(stats["seconds_per_pass"]) >= 0
    assert 0 < sum(stats["seconds_per_pass"]) <= stats["seconds"][technique] * (1 + 1e-9)
    assert 1 < stats["layers_max"] <= 100
    if technique == "glowscript":
        assert stats["layers_max"] == 4 and stats["truncated_pixels"] > 0 < stats["truncation_bound"] < 1
    else:
        assert stats["truncated_pixels"] == stats["truncation_bound"] == 0
    # What is kept of a sample: as TECHNIQUES says, and where some surfaces are opaque, z-far and a colour.
    kept = TECHNIQUES[technique].buffer_bytes(stats["layers_max"], TECHNIQUES[technique].options())
    opaque_first = 0 if TECHNIQUES[technique].maps else 8 + 16  # maps are of all surfaces
    assert scene.surfaces == "mixed" and stats["buffer_bytes_per_pixel"] == kept + opaque_first
    assert stats["clamped_pixels"] == 0 or technique == "weighted-sum"
    assert {"projection", "binning", technique, "total"} < stats["seconds"].keys()
    assert all(seconds >= 0 for seconds in stats["seconds"].values())
    assert stats["bytes_per_pixel"] == pytest.approx(sum(stats["bytes"].values()) / (64 * 48))
    json.dumps(dict(stats))


def test_fragments_are_the_layers_of_all_pixels(scene):
    # An alpha of 1/8 everywhere: a pixel of n layers has the transmittance (7/8)**n, so the picture counts them, up to
    # 100 layers: (7/8)**100 is 26 times 2**-24, alpha's last bit.
    eighth = clpeel.Scene.from_arrays(scene.vertices, scene.faces, color=(1.0, 1.0, 1.0, 0.125))
    result = plainly.render(eighth, CAMERA, (64, 48))
    layers = np.round(np.log1p(-result.color[..., 3].astype(np.float64)) / np.log(7 / 8))
    assert layers.max() > 20
    assert result.stats["fragments"] == layers.sum() and result.stats["layers_max"] == layers.max()


@pytest.mark.parametrize("lanes", [1, 64])
def test_memory_changes_the_batches_and_not_the_picture(scene, lanes):
    vertices, faces = np.tile(scene.vertices, (60, 1)), np.arange(18_000).reshape(-1, 3)
    dense = clpeel.Scene.from_arrays(vertices, faces, color=(9, 9, 9, 9))
    large = plainly.render(dense, CAMERA, (150, 130), lanes=lanes)
    small = plainly.render(dense, CAMERA, (150, 130), lanes=lanes, memory="1M")
    assert large.stats["batches"] == 1 and small.stats["batches"] > 1
    assert (large.color == small.color).all() and (large.image == small.image).all()
    assert large.stats["fragments"] == small.stats["fragments"] > 2**20
    assert small.stats["bytes"]["fragments"] <= 2**20


def test_a_renderer_keeps_scene_programs_and_buffers(scene):
    renderer = plainly.Renderer(scene)
    first = renderer.render(CAMERA, (64, 64))
    held = dict(renderer.gpu.buffers)
    programs = dict(renderer.gpu.programs)
    second = renderer.render(CAMERA.azimuth(40), (64, 64))
    back = renderer.render(CAMERA, (64, 64))
    assert (first.color != second.color).any() and (first.color == back.color).all()
    assert renderer.gpu.programs == programs
    grown = {name for name in held if renderer.gpu.buffers[name] is not held[name]}
    # What depends on the view.
    assert grown <= {"listed", "triangles", "bounds", "pairs", "pair_start", "pair_blocks", "fragments"}
    again = dict(renderer.gpu.buffers)
    renderer.render(CAMERA, (64, 64))
    assert all(renderer.gpu.buffers[name] is again[name] for name in again)


def test_lit_and_flat_from_one_renderer(scene):
    renderer = plainly.Renderer(scene)
    flat = renderer.render(CAMERA, (64, 64))
    lit = renderer.render(CAMERA, (64, 64), lighting="headlight")
    assert (flat.color[..., 3] == lit.color[..., 3]).all()
    assert (lit.color[..., :3] <= flat.color[..., :3] + 1e-6).all() and (lit.color != flat.color).any()
    assert (renderer.render(CAMERA, (64, 64)).color == flat.color).all()


def test_headlight_on_a_flat_face_is_the_cosine():
    # A quad turned by 60 degrees, seen from straight ahead and far away: ambient 0.2 + 0.8 cos 60.
    s, c = np.sin(np.pi / 3), np.cos(np.pi / 3)
    vertices = [[-c, -1, s], [c, -1, -s], [c, 1, -s], [-c, 1, s]]
    for faces in ([[0, 1, 2], [0, 2, 3]], [[2, 1, 0], [3, 2, 0]]):  # two-sided
        quad = clpeel.Scene.from_arrays(vertices, faces, color=(1.0, 0.5, 0.25, 1.0))
        middle = plainly.render(quad, clpeel.Camera((0, 0, 50), (0, 0, 0), view_angle=1), (8, 8), lighting="headlight")
        assert np.allclose(middle.color[4, 4], [0.6, 0.3, 0.15, 1], atol=1e-6)


def test_a_sphere_is_smooth_under_the_headlight():
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    scene = clpeel.Scene.from_arrays(ball.vertices, ball.faces, color=(1.0, 1.0, 1.0, 1.0))
    camera = clpeel.Camera((0, 0, 40), (0, 0, 0), view_angle=4, orthographic=True)
    color = plainly.render(scene, camera, (128, 128), lighting="headlight").color
    half = np.tan(np.radians(2)) * 40
    x = ((np.arange(128) + 0.5) / 64 - 1) * half
    r2 = x[None, :] ** 2 + x[:, None] ** 2
    inside = r2 < 0.8
    expected = 0.2 + 0.8 * np.sqrt(1 - r2[inside])
    # Edges of 9 degrees lie up to 1 - cos 4.5 = 0.003 inside the sphere; where the cosine is sqrt(0.2) that is worth
    # 0.006 of it, and interpolating the normals as much again. A facet's own normal would be off by sin 4.5 = 0.08.
    assert np.abs(color[..., 0][inside] - expected).max() < 0.012


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"size": (0, 5)}, "size: expected 1..65536 pixels a side, got 0 x 5"),
        ({"size": (5, 70000)}, "size: expected 1..65536"),
        ({"size": (65536, 65536)}, "size: expected a picture that fits the memory"),
        ({"size": (5,)}, r"size: expected \(width, height\)"),
        ({"size": (5.5, 5)}, "size: expected 1..65536"),
        ({"size": ("a", 5)}, r"size: expected \(width, height\)"),
        ({"technique": "magic"}, "technique: expected one of sort"),
        ({"background": (0, 0)}, "background: expected 3 numbers"),
        ({"background": (0, 0, 2)}, "background: expected 3 numbers 0..1"),
        ({"background": (0, 0, np.nan)}, "background: expected 3 numbers 0..1"),
        ({"lighting": "sun"}, "lighting: expected one of none, headlight"),
        ({"samples": 3}, "samples: expected one of 1, 4, 8, 16"),
        ({"samples": 256, "size": (5000, 5)}, "samples: expected at most 4096"),
        ({"memory": "lots"}, "memory: expected bytes"),
        ({"memory": 12}, "memory: expected at least 1M"),
        ({"lanes": 7}, "lanes: expected one of"),
    ],
)
def test_options_that_cannot_be_are_refused(scene, options, message):
    with pytest.raises(clpeel.InputError, match=message) as error:
        plainly.render(scene, **{"camera": CAMERA, **options})
    assert "\n" not in str(error.value)


def test_a_scene_is_asked_for():
    with pytest.raises(clpeel.InputError, match="expected a clpeel.Scene, got str"):
        plainly.render("dragon.ply")


@pytest.mark.parametrize(
    ("text", "nbytes"),
    [("512M", 512 << 20), ("2G", 2 << 30), ("1.5g", 3 << 29), (1 << 20, 1 << 20), ("4M", 4 << 20), ("1MiB", 1 << 20)],
)
def test_memory_in_words(text, nbytes):
    assert parse_memory(text) == nbytes


def test_progress_goes_from_nothing_to_all(scene):
    seen: list[float] = []
    plainly.render(scene, CAMERA, (200, 200), memory="1M", progress=lambda done, text: seen.append(done))
    assert seen == sorted(seen) and seen[0] == 0 and seen[-1] == 1 and len(seen) > 3


def test_the_package_is_lazy_and_whole():
    assert set(clpeel.__all__) <= set(dir(clpeel))
    for name in clpeel.__all__:
        assert getattr(clpeel, name) is not None
    with pytest.raises(AttributeError, match="nothing"):
        _ = clpeel.nothing
