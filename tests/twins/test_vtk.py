"""The picture against VTK's dual depth peeling: apart only at edges, and by VTK's rounding to 8 bits at each layer."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import plainly
import pytest

from twins import reference, soups
from twins.soups import Eye, Soup

pytest.importorskip("vtk", reason="the vtk wheel is not installed")

BENCH = Eye((0, 0, 4), (0, 0, 0), clipping_range=(2.0, 6.0))
SIZE = 256


@pytest.mark.parametrize(("name", "alpha"), [("boxes", 77), ("grass", 128), ("spheres", 102)])
def test_against_dual_depth_peeling(name: str, alpha: int, tmp_path: Path, bench: Callable[..., Soup]) -> None:
    soup = bench(name)
    folder, out = soups.SHARED / "bench", tmp_path / "vtk.npy"
    command = [sys.executable, str(folder / "vtk_peer.py"), name, str(SIZE), "dual", str(out)]
    done = subprocess.run(command, env={**os.environ, "FRAMES": "1"}, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"VTK cannot render here (libegl1?): {(done.stderr.strip().splitlines() or ['no message'])[-1]}")
    theirs = np.load(out)[..., :3].astype(int)
    result = plainly.render(soup.scene(), BENCH.camera(), (SIZE, SIZE))
    off = np.abs(result.image[..., :3].astype(int) - theirs).max(axis=2)
    # Both snap to 1/256 pixel: edges are 1/512 from where they belong on either side. Spheres have edges of a pixel and
    # less everywhere, and there a face and its neighbour share a colour; silhouettes are what remains.
    interior = reference.edge_distance(soup, BENCH, (SIZE, SIZE)) > 2 * reference.SNAP
    # VTK stores every blend in 8 bits, half a step off. Peeling N layers from both ends: each of the N / 2 front ones
    # adds its half step, the transmittance's error is passed on times 1 - a at each (0.5 / a in all, times what lies
    # behind), and so is that of the back (0.5 / a). Half a step more for each picture's own rounding.
    twin = reference.render(soup, BENCH, (SIZE, SIZE))
    bound = 0.5 * np.ceil(twin.layers / 2) + 1 / (alpha / 255) + 1
    # VTK's depths are those of the snapped triangles: where two cross, its order changes up to a snap beside the line.
    crossing = reference.near_tie(twin, shift=reference.SNAP)
    assert (off <= bound)[interior & ~crossing].all()
    assert (interior & ~crossing).mean() > 0.5
    assert (off > bound).mean() < 0.001
