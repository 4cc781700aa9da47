"""How figures are measured: settings, processes that take turns, and medians with their spread."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

TOOLS = Path(__file__).resolve().parent.parent
SHARED = Path(os.environ.get("CLPEEL_SHARED", TOOLS.parent.parent / "shared"))
SCENES = ("dragon", "spheres", "boxes", "grass")
MODELS = {"dragon": "dragon_vrip.ply.gz"}
"""Scenes that are read from files, in a folder `models` beside the scenes' folder."""
CACHES = ("POCL_CACHE_DIR", "PYOPENCL_CACHE_DIR")
"""Variables that name other folders with compiled kernels, besides HOME."""

Values = dict[str, Any]


class Skipped(Exception):
    """Something that a figure needs is missing. The text says what."""


class Failed(Exception):
    """A measured program failed. The text is the last line of its output."""


def setting(default: Any, text: str) -> Any:
    """Return a field of Settings with its name in a report."""
    return field(default=default, metadata={"text": text})


@dataclass(frozen=True)
class Settings:
    """What is measured, and how often. Settings that differ from these defaults are reported."""

    rounds: int = setting(5, "rounds in which processes take turns")
    frames: int = setting(5, "timed frames of a process")
    peer_frames: int = setting(3, "timed frames of a process of VTK")
    peer_rounds: int = setting(5, "rounds in which VTK takes part")
    size: int = setting(1024, "pixels a side")
    largest: int = setting(8, "largest picture, in times that side")
    layers: int = setting(4096, "most layers")
    triangles: int = setting(10_000_000, "most triangles")
    probe: int = setting(512, "MiB copied to measure bandwidth")
    scenes: tuple[str, ...] = setting(SCENES, "scenes")
    live_rounds: int = setting(3, "rounds of the live view")
    live_peer_rounds: int = setting(1, "rounds of the live view in which PyVista takes part")
    drag: int = setting(10, "seconds of a drag")
    pictures: tuple[str, ...] = setting(("800 x 600", "1600 x 1200"), "pictures of the live view")

    @property
    def reduced(self) -> list[str]:
        """The settings that differ from their defaults."""
        return [
            f"{one.metadata['text']}: {plain(getattr(self, one.name))} in place of {plain(one.default)}"
            for one in fields(self)
            if getattr(self, one.name) != one.default
        ]


QUICK = Settings(
    rounds=2,
    frames=3,
    peer_frames=1,
    peer_rounds=1,
    largest=2,
    layers=1024,
    triangles=1_000_000,
    probe=128,
    live_rounds=1,
    drag=3,
    pictures=("800 x 600",),
)


def plain(value: Any) -> str:
    """Return a setting as text."""
    return ", ".join(value) if isinstance(value, tuple) else f"{value:,}"


def spread(values: Iterable[float]) -> Values:
    """Return the median of the rounds with their least and greatest."""
    values = list(values)
    return {"median": statistics.median(values), "least": min(values), "greatest": max(values), "rounds": values}


def ratio(above: Iterable[float], below: Iterable[float]) -> Values:
    """Return the spread of the quotients of each round. What slows both sides of a round cancels."""
    return spread(a / b for a, b in zip(above, below, strict=False))


def target(what: str, value: float, sense: str, bound: float, judged: bool = True) -> Values:
    """Return a target and whether it is met.

    That is None if the measurement is not the one that the target is set for.
    """
    met = value <= bound if sense == "<=" else value >= bound
    return {"what": what, "value": value, "sense": sense, "bound": bound, "met": met if judged else None}


def run(command: list[str], environment: dict[str, str]) -> str:
    """Return what a program prints. Raises Failed with its last line if it fails."""
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise Failed((done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1].strip())
    return done.stdout


class Bench:
    """One run of the tool: its settings, the environment of its processes, and what several figures share."""

    def __init__(
        self,
        settings: Settings,
        folder: Path | None,
        device: str | None,
        wanted: Iterable[str],
        peer_python: str = sys.executable,
        soak: float = 0.0,
    ) -> None:
        """folder: has scenes.py and vtk_peer.py, or None. device: an OpenCL device. wanted: the names of figures.

        peer_python: the Python that has PyVista. soak: how many minutes it takes.
        """
        self.settings = settings
        self.peer_python, self.soak = peer_python, soak
        self.folder = folder
        self.wanted = tuple(wanted)
        self.missing: dict[str, str] = {}
        """By name, a scene or a peer that was skipped, and why."""
        self._scratch = tempfile.TemporaryDirectory(prefix="clpeel-bench-")
        self.scratch = Path(self._scratch.name)
        paths = [str(TOOLS), *([str(folder)] if folder else []), os.environ.get("PYTHONPATH", "")]
        self.environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}
        self.device = {} if device is None else {"CLPEEL_DEVICE": device}
        self.environment |= self.device

    def close(self) -> None:
        """Remove the run's temporary files."""
        self._scratch.cleanup()

    def full(self, *names: str) -> bool:
        """Return whether the picture's size and the named settings are the defaults, for which the targets are set."""
        return all(getattr(self.settings, name) == getattr(Settings, name) for name in ("size", *names))

    def measure(self, case: str, **options: Any) -> Values:
        """Return the result of a case of measure.py, which runs in its own process."""
        command = [sys.executable, "-P", "-m", "benchmark.measure", case, json.dumps(options)]
        answer: Values = json.loads(run(command, self.environment).splitlines()[-1])
        return answer

    def job(self, scene: list[Any], size: int | None = None, **options: Any) -> Values:
        """Return a job: a scene [name, numbers...] to render with options of `Renderer.render`."""
        return {"scene": scene, "size": size or self.settings.size, "options": options}

    def take_turns(self, jobs: list[Values], together: bool) -> list[list[Values]]:
        """Return what each job took in each round.

        together: whether the jobs take turns frame by frame in one process. Else each job gets its own process.
        """
        found: list[list[Values]] = [[] for _ in jobs]
        for _ in range(self.settings.rounds):
            for part in [jobs] if together else [[job] for job in jobs]:
                answer = self.measure("frames", jobs=part, count=self.settings.frames)
                for job, one in zip(part, answer.pop("jobs"), strict=True):
                    found[jobs.index(job)].append({**one, **answer})
        return found

    # --- the scenes, which several figures share ---------------------------------------------------------------------

    @cached_property
    def scenes(self) -> dict[str, list[Any]]:
        """The available scenes, by name: [maker, numbers...]. Without a folder, they are the tool's own."""
        if self.folder is None:
            return {"boxes": ["boxes"], "soup": ["soup", self.settings.triangles // 10, self.settings.size]}
        found: dict[str, list[Any]] = {}
        for name in self.settings.scenes:
            if name not in MODELS:
                found[name] = [name]
                continue
            found[name] = [str(self.scratch / f"{name}.ply")]  # read once from a compressed text file, and kept
            try:
                self.measure("keep", model=str(self.folder.parent / "models" / MODELS[name]), path=found[name][0])
            except Failed as failure:
                self.missing[name] = str(failure)
                del found[name]
        return found

    @cached_property
    def scene_rounds(self) -> dict[str, dict[str, Any]]:
        """For each scene: seconds per frame of each round, of "clpeel" and the wanted peers; stats; and "differs"."""
        return {name: self._rounds(name, scene) for name, scene in self.scenes.items()}

    def _rounds(self, name: str, scene: list[Any]) -> Values:
        ours, theirs = (str(self.scratch / f"{who}.npy") for who in ("ours", "theirs"))
        found: Values = {"clpeel": [], "dual": [], "unsorted": [], "stats": []}
        for number in range(self.settings.rounds):
            answer = self.measure("frames", jobs=[self.job(scene)], count=self.settings.frames, out=ours)["jobs"][0]
            found["clpeel"].append(answer["median_s"])
            found["stats"].append(answer["stats"])
            for mode in self._peers(number):
                left_out = f"VTK {mode}, {name}"
                if left_out in self.missing:
                    continue
                try:
                    found[mode].append(self._peer(mode, scene, theirs))
                except Failed as failure:
                    self.missing[left_out] = str(failure)
                    continue
                if mode == "dual":
                    found["differs"] = differences(ours, theirs)
        return found

    def _peers(self, number: int) -> list[str]:
        """Return the modes of VTK that take part in a round."""
        if self.peer_reason or number >= self.settings.peer_rounds:
            return []
        modes = {"dual": "peeling", "unsorted": "unsorted"}
        return [mode for mode, figure in modes.items() if figure in self.wanted]

    @cached_property
    def peer_reason(self) -> str:
        """The reason why there is no VTK, or an empty text."""
        from importlib.util import find_spec

        if self.folder is None:
            return "no folder of scenes (--scenes, or CLPEEL_SHARED)"
        if not (self.folder / "vtk_peer.py").is_file():
            return f"no vtk_peer.py in {self.folder.name}"
        return "" if find_spec("vtk") else "vtk is not installed (pip install vtk)"

    def _peer(self, mode: str, scene: list[Any], out: str) -> float:
        script = str((self.folder or Path()) / "vtk_peer.py")
        environment = {**self.environment, "FRAMES": str(self.settings.peer_frames)}
        printed = run([sys.executable, script, *scene, str(self.settings.size), mode, out], environment)
        return float(json.loads(printed.splitlines()[-1])["median_s"])

    @cached_property
    def bandwidth(self) -> Values:
        """The best of the copies of all rounds."""
        rounds = [
            self.measure("bandwidth", nbytes=self.settings.probe << 20, repeats=5) for _ in range(self.settings.rounds)
        ]
        return max(rounds, key=lambda one: float(one["bytes_per_second"]))

    def command_seconds(self, arguments: list[str], home: str) -> float:
        """Return the seconds of the whole process of the command `clpeel`, with its caches in the folder `home`."""
        script = Path(sys.executable).with_name("clpeel")
        command = [str(script)] if script.is_file() else [sys.executable, "-m", "clpeel"]
        environment = {name: value for name, value in os.environ.items() if name not in CACHES}
        environment |= {"HOME": home, "XDG_CACHE_HOME": f"{home}/cache", **self.device}
        started = time.perf_counter()
        run([*command, *arguments], environment)
        return time.perf_counter() - started


def differences(ours: str, theirs: str) -> dict[str, float]:
    """Return the shares of pixels of two pictures that differ by more than 1, 2 and 8 steps of 255."""
    import numpy as np

    off = np.abs(np.load(ours).astype(int) - np.load(theirs))[..., :3].max(axis=2)
    return {str(step): float((off > step).mean()) for step in (1, 2, 8)}
