"""The live view in a browser: how soon a picture answers the mouse, beside PyVista's; and whether its memory grows."""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
import threading
from bisect import bisect_left
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import accumulate
from pathlib import Path
from typing import Any

from benchmark.figures import cell, digits, figure, share
from benchmark.live_browser import Browser
from benchmark.runs import Bench, Failed, Skipped, Values, run, spread, target

LIVE_SCENES = ("dragon", "boxes", "spheres")
WARM_UP = 2.0
"""Seconds of a drag before those that count. A coarser mesh, if one is needed, is made in them."""

AIM_MS, AIM_FRAMES, AIM_GROWTH = 60.0, 30.0, 0.02
SOAK_WARM_UP = 60
"""Seconds of a soak before those that count."""

SOAK_MINUTES = 10.0
"""How long a soak is that is judged."""

START = 60.0
"""Seconds within which a server must say its address."""

PEER = Path(__file__).with_name("live_pyvista.py")
PEER_NAMES = {"trame": "PyVista, trame", "frames": "PyVista, off screen"}
ASK = (
    "import json, pyvista, trame, trame_pyvista, trame_vtk, trame_vuetify; from importlib.metadata import version; "
    "print(json.dumps({name: version(name) for name in ('pyvista', 'vtk', 'trame')}))"
)
INSTALL = "pip install 'pyvista[jupyter]' trame trame-vtk trame-vuetify, and name that Python with --peer-python"
PICTURES = {"clpeel": "#view", "trame": "canvas"}
"""The element of each page that shows the picture."""


# --- arithmetic -------------------------------------------------------------------------------------------------------


def answers(recorded: Values) -> list[float | None]:
    """Return when the picture that answers each event was decoded, in ms. None: never, while it was waited for.

    An event goes to the server with the first message that is sent after it. It is answered by the first picture that
    was drawn after that message was taken. recorded: what recorder.js wrote down, each list in the order of time.
    """
    sent = [each["at"] for each in recorded["messages"]]
    frames = sorted(recorded["frames"], key=lambda frame: float(frame["decoded"]))
    newest = list(accumulate((frame["answers"] for frame in frames), max))
    found: list[float | None] = []
    for event in recorded["events"]:
        place = bisect_left(sent, event["at"])
        first = bisect_left(newest, recorded["messages"][place]["clock"]) if place < len(sent) else len(frames)
        found.append(frames[first]["decoded"] if first < len(frames) else None)
    return found


def new_frames(recorded: Values, begin: float, end: float) -> list[Values]:
    """Return the pictures decoded in begin..end, in ms, that answer a newer message than every one before them."""
    found, newest = [], -math.inf
    for frame in sorted(recorded["frames"], key=lambda frame: float(frame["decoded"])):
        if frame["answers"] > newest:
            newest = frame["answers"]
            if begin <= frame["decoded"] <= end:
                found.append(frame)
    return found


def within(values: list[float], part: float) -> float:
    """Return the least of the values that so large a part of them do not exceed."""
    return sorted(values)[max(math.ceil(part * len(values)) - 1, 0)]


def summary(recorded: Values, warm_up: float = WARM_UP) -> Values:
    """Return the figures of a drag, without its first seconds. Raises Failed if nothing came.

    An event that is not answered counts as if its picture had come when the waiting ended, which is less than it took.
    """
    if not recorded["events"]:
        raise Failed("the page got no event")
    begin = recorded["events"][0]["at"] + warm_up * 1e3
    pairs = zip(recorded["events"], answers(recorded), strict=True)
    counted = [(event, answer) for event, answer in pairs if event["at"] >= begin]
    if not counted:
        raise Failed("the page got no event after the first seconds")
    took = [(recorded["until"] if answer is None else answer) - event["at"] for event, answer in counted]
    end = max(recorded["until"] if answer is None else answer for _, answer in counted)
    frames = new_frames(recorded, begin, end)
    if not frames:
        raise Failed("the page showed no picture that answers an event")
    at_rest = [frame["milliseconds"] for frame in recorded["frames"] if frame["settled"] and frame["scale"] == 1]
    return {
        "events": len(counted),
        "unanswered": sum(answer is None for _, answer in counted),
        "median_ms": statistics.median(took),
        "within_ms": within(took, 0.95),
        "held_ms": statistics.median(event["at"] - event["since"] for event, _ in counted),
        "frames_per_second": len(frames) / (end - begin) * 1e3,
        "bytes": statistics.mean(frame["bytes"] for frame in frames),
        "frame_ms": statistics.median(frame["milliseconds"] for frame in frames),
        "scale": statistics.median(frame["scale"] for frame in frames),
        "coarse": sum(frame["coarse"] for frame in frames) / len(frames),
        "full_ms": at_rest[-1] if at_rest else None,
    }


def growth(resident: list[int], warm_up: int = SOAK_WARM_UP) -> float:
    """Return by which share the most memory exceeds the least. resident: bytes, one for each second."""
    counted = resident[warm_up:] or resident[-1:]
    return max(counted) / min(counted) - 1


# --- processes --------------------------------------------------------------------------------------------------------


@contextmanager
def server(command: list[str], environment: dict[str, str]) -> Iterator[tuple[str, int]]:
    """Start a server, and yield its address and its process's number. End it afterwards."""
    with (
        tempfile.TemporaryFile("w+", errors="replace") as errors,
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        late = threading.Timer(START, process.kill)
        late.start()
        try:
            line = next((line for line in process.stdout or () if line.startswith("open ")), "")
            late.cancel()
            if not line:
                process.wait()
                errors.seek(0)
                raise Failed((errors.read().strip().splitlines() or [f"no address within {START:g} s"])[-1])
            yield line.split()[1], process.pid
        finally:
            late.cancel()
            process.terminate()
            try:
                process.wait(5)
            except subprocess.TimeoutExpired:
                process.kill()


def resident_bytes(process: int) -> int:
    """Return the resident bytes of a process. Raises Skipped if this system does not say."""
    try:
        return int(Path(f"/proc/{process}/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE")
    except OSError:
        try:
            import psutil
        except ImportError:
            raise Skipped("this system has no /proc, and psutil is not installed") from None
        return int(psutil.Process(process).memory_info().rss)


def clpeel_command(scene: list[Any], size: tuple[int, int]) -> list[str]:
    """Return the command that starts clpeel's live view of a scene."""
    return [sys.executable, "-P", "-u", "-m", "benchmark.live_clpeel", json.dumps(scene), *map(str, size)]


def scenes_of(bench: Bench) -> dict[str, list[Any]]:
    """Return the scenes to look at. Raises Skipped if there is none, or if clpeel's live view lacks a package."""
    from clpeel.viewer.open import EXTRA, missing

    if missing("browser"):
        raise Skipped(f"{', '.join(missing('browser'))} is not installed ({EXTRA})")
    found = {name: bench.scenes[name] for name in LIVE_SCENES if name in bench.scenes}
    if not found:
        raise Skipped(f"none of {', '.join(LIVE_SCENES)} is there")
    return found


class Drags:
    """Drags each scene with each program in turn. Nothing else runs meanwhile."""

    def __init__(self, bench: Bench, browser: Browser) -> None:
        self.bench, self.browser = bench, browser
        self.versions: dict[str, str] = {}
        """Of the peer's packages; none if it is not there."""
        try:
            self.versions = json.loads(run([bench.peer_python, "-P", "-c", ASK], bench.environment).splitlines()[-1])
        except (Failed, OSError) as failure:
            bench.missing["PyVista"] = f"{failure} ({INSTALL})"

    def clpeel(self, scene: list[Any], size: tuple[int, int]) -> Values:
        """Drag clpeel's picture of a scene."""
        with server(clpeel_command(scene, size), self.bench.environment) as (address, _):
            return self._drag("clpeel", address, size)

    def trame(self, scene: list[Any], size: tuple[int, int]) -> Values:
        """Drag the picture that PyVista draws and trame takes to the page."""
        with server(self._peer("serve", scene, size), self.bench.environment) as (address, _):
            return self._drag("trame", address, size)

    def frames(self, scene: list[Any], size: tuple[int, int]) -> Values:
        """Time PyVista's pictures without a page."""
        found = json.loads(run(self._peer("frames", scene, size), self.bench.environment).splitlines()[-1])
        drawn = found["width"], found["height"]
        if drawn != size:
            raise Failed(f"expected a picture of {size}, got {drawn}")
        return {"frame_ms": found["render_s"] * 1e3, "full_ms": found["read_s"] * 1e3}

    def _drag(self, who: str, address: str, size: tuple[int, int]) -> Values:
        return summary(self.browser.visit(address, PICTURES[who], size, WARM_UP + self.bench.settings.drag))

    def _peer(self, what: str, scene: list[Any], size: tuple[int, int]) -> list[str]:
        """Return the peer's command. It reads the same arrays that clpeel draws."""
        arrays = self.bench.scratch / f"{Path(scene[0]).stem}.npz"
        if not arrays.is_file():
            self.bench.measure("arrays", scene=scene, path=str(arrays))
        return [self.bench.peer_python, "-P", "-u", str(PEER), what, str(arrays), *map(str, size)]

    def rounds(self, name: str, scene: list[Any], pixels: str) -> dict[str, list[Values]]:
        """Return what each program's drags gave, a round each. A peer that fails is left out from then on."""
        found: dict[str, list[Values]] = {who: [] for who in ("clpeel", *(PEER_NAMES if self.versions else ()))}
        for number in range(self.bench.settings.live_rounds):
            for who in list(found) if number < self.bench.settings.live_peer_rounds else ["clpeel"]:
                try:
                    found[who].append(getattr(self, who)(scene, size_of(pixels)))
                except Failed as failure:
                    if who == "clpeel":
                        raise
                    self.bench.missing[f"{PEER_NAMES[who]}, {name}, {pixels}"] = str(failure)
                    del found[who]
        return found


# --- the figures ------------------------------------------------------------------------------------------------------

COLUMNS = {
    "median_ms": ("event to picture, ms", 1.0),
    "within_ms": ("95 % within, ms", 1.0),
    "frames_per_second": ("frames a second", 1.0),
    "bytes": ("KiB a frame", 1 / 1024),
    "frame_ms": ("a frame, ms", 1.0),
    "scale": ("scale", 1.0),
    "full_ms": ("full picture, ms", 1.0),
}
"""The columns of the table, by what `summary` calls them: their heads, and what values are multiplied by."""


def size_of(pixels: str) -> tuple[int, int]:
    """Return the size that a text such as "800 x 600" says."""
    width, height = map(int, pixels.split(" x "))
    return width, height


def row(name: str, pixels: str, who: str, found: dict[str, Values]) -> list[str]:
    """Return a row of the table. found: what `spreads` returns."""
    cells = [one_cell(found[key], factor) if key in found else "" for key, (_, factor) in COLUMNS.items()]
    return [name, pixels, {"clpeel": "clpeel", **PEER_NAMES}[who], *cells]


def one_cell(values: Values, factor: float) -> str:
    """Return a median with its least and greatest, or a single value alone."""
    return cell(values, factor) if len(values["rounds"]) > 1 else digits(values["median"] * factor)


def spreads(rounds: list[Values]) -> dict[str, Values]:
    """Return the spread of each number over the rounds, of those that every round has."""
    return {key: spread(one[key] for one in rounds) for key in rounds[0] if all(one[key] is not None for one in rounds)}


@figure("live", "The live view: from the mouse to the picture in a browser, beside PyVista's")
def live(bench: Bench) -> Values:
    scenes = scenes_of(bench)
    values: Values = {}
    table = [["scene", "pixels", "drawn by", *(head for head, _ in COLUMNS.values())]]
    with Browser() as browser:
        drags = Drags(bench, browser)
        for name, scene in scenes.items():
            for pixels in bench.settings.pictures:
                rounds = drags.rounds(name, scene, pixels)
                values[f"{name}, {pixels}"] = found = {who: spreads(each) for who, each in rounds.items()}
                table += [row(name, pixels, who, one) for who, one in found.items()]
        versions = {"Chromium": browser.version, **drags.versions}
    values_of_pages = [one[who] for one in values.values() for who in ("clpeel", "trame") if who in one]
    held = statistics.median(one["held_ms"]["median"] for one in values_of_pages)
    notes = [
        f"events are counted from when the page gets them; Chromium held them back for {digits(held)} ms before that",
        f"with {', '.join(f'{name} {version}' for name, version in versions.items())}",
    ]
    coarse = [
        f"{name} {share(one['clpeel']['coarse']['median'])}"
        for name, one in values.items()
        if one["clpeel"]["coarse"]["median"]
    ]
    if coarse:
        notes.append(f"frames of clpeel that show a coarser mesh: {'; '.join(coarse)}")
    waited = sum(sum(one["unanswered"]["rounds"]) for one in values_of_pages)
    if waited:
        notes.append(
            f"{waited:,.0f} events were not answered while it was waited for them, and took longer than it says"
        )
    return {"values": values, "targets": live_targets(bench, values), "table": table, "notes": notes}


def live_targets(bench: Bench, values: Values) -> list[Values]:
    """Return the targets: each scene answers in time, and the boxes' pictures come often enough."""
    judged = bench.full("drag")
    found = [
        target(
            f"95 % of events answered within, ms, {name}", one["clpeel"]["within_ms"]["median"], "<=", AIM_MS, judged
        )
        for name, one in values.items()
    ]
    found += [
        target(f"frames a second, {name}", one["clpeel"]["frames_per_second"]["median"], ">=", AIM_FRAMES, judged)
        for name, one in values.items()
        if name.startswith("boxes")
    ]
    return found


@figure("soak", "The live view's memory while it is dragged for long")
def soak(bench: Bench) -> Values:
    name, scene = next(iter(scenes_of(bench).items()))
    pixels, seconds = bench.settings.pictures[0], max(round(bench.soak * 60), 1)
    size = size_of(pixels)
    resident: list[int] = []
    with Browser() as browser, server(clpeel_command(scene, size), bench.environment) as (address, process):
        browser.visit(
            address,
            PICTURES["clpeel"],
            size,
            SOAK_WARM_UP + seconds,
            lambda: resident.append(resident_bytes(process)),
        )
    grown = growth(resident)
    counted = resident[SOAK_WARM_UP:]
    table = [["scene", "pixels", "minutes", "least, MiB", "most, MiB", "first, MiB", "last, MiB", "most beside least"]]
    numbers = [digits(each / 2**20) for each in (min(counted), max(counted), counted[0], counted[-1])]
    table.append([name, pixels, digits(bench.soak), *numbers, f"+{share(grown)}"])
    return {
        "values": {"resident": resident, "growth": grown},
        "targets": [target("growth of the resident memory", grown, "<=", AIM_GROWTH, bench.soak >= SOAK_MINUTES)],
        "table": table,
        "notes": ["resident memory of the server, once a second, after a first minute of dragging"],
    }
