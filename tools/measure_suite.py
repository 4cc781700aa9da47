"""Measures the suite of `clpeel compare --suite`, and writes its tables into docs/compare.md.

    python tools/measure_suite.py --report docs/compare.md --json suite.json
    python tools/measure_suite.py --read suite.json --report docs/compare.md

The first measures everything, with nine frames of each row, which takes long. Let nothing else run meanwhile. The
dragon is in the folder that --models names, or in `models` in the one that CLPEEL_SHARED names. The second command
makes the tables of figures that were measured before, which `clpeel compare --suite --json` writes, too.
Without --report the tables go to standard output. After Ctrl-C the figures of the finished scenes go to --json and to
standard output, and the document stays as it is.
Exit codes: 0 done, 1 failed, 2 bad input, 3 no such OpenCL device, 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any, NoReturn

from benchmark.report import between_markers, machine, piped

Values = dict[str, Any]
FRAMES = 9
UNSORTED = "weighted-sum"
"""The row that adds up the same fragments without their order: what a picture takes at least."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        stop(message)


def stop(message: str, code: int = 2) -> NoReturn:
    """Print an error of one line and exit."""
    print(f"measure_suite: error: {message}", file=sys.stderr)
    raise SystemExit(code)


def parse(arguments: list[str] | None) -> argparse.Namespace:
    """Return the options."""
    parser = Parser(description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("--read", type=Path, metavar="FILE.json", help="figures that were measured before, in place of measuring")
    add("--json", type=Path, metavar="FILE.json", help="write the figures")
    add("--report", type=Path, metavar="FILE.md", help="write the tables between this document's markers")
    add("--scenes", type=lambda text: text.split(","), metavar="NAME,...", help="only these")
    add("--techniques", type=lambda text: text.split(","), metavar="NAME,...", help="only these")
    add("--models", metavar="DIR", help="folder that has the dragon")
    add("--device", metavar="DEVICE", help="number or part of a name from 'clpeel devices'")
    add("--frames", type=int, default=FRAMES, metavar="N", help=f"timed frames of each row (default: {FRAMES})")
    add("--size", type=int, default=1024, metavar="N", help="pixels a side (default: 1024)")
    return parser.parse_args(arguments)


def measured(options: argparse.Namespace) -> tuple[Values, int]:
    """Return the figures of the suite, measured now, and the exit code: 130 if Ctrl-C left some out."""
    import clpeel
    from clpeel.command.terminal import Progress

    progress, code = Progress(), 0
    try:
        suite = clpeel.compare_suite(
            options.scenes,
            (options.size, options.size),
            options.techniques,
            frames=options.frames,
            models=options.models,
            device=options.device,
            progress=progress if progress.enabled else None,
        )
    except clpeel.InterruptedSuite as interrupted:
        suite, code = interrupted.comparison, 130
    finally:
        progress.clear()
    return {**json.loads(suite.to_json()), "machine": machine()}, code


def read(path: Path) -> Values:
    """Return figures from a file. Stops if they are not those of a suite."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        names_of(found["scenes"][0])
        assert found["overall"]
    except OSError as error:
        stop(f"--read: {str(path)!r}: {error.strerror}")
    except (ValueError, KeyError, IndexError, TypeError, AssertionError):
        stop(f"--read: expected a file of 'clpeel compare --suite --json', got '{path}'")
    return dict(found)


# --- tables -----------------------------------------------------------------------------------------------------------


def names_of(scene: Values) -> dict[str, Values]:
    """Return the rows of a scene by their names, such as `weighted-sum, half`."""
    from clpeel.study.comparison import named

    return {named(row["technique"], row["precision"], row["budget"], row["options"]): row for row in scene["rows"]}


def tables(found: Values) -> str:
    """Return all tables as Markdown."""
    scenes = [(scene["name"], scene, names_of(scene)) for scene in found["scenes"]]
    parts = [about(found), "**All scenes**", "\n".join(piped(overall_table(found)))]
    parts += ["**Ranks by time / by error**", "\n".join(piped(rank_table(scenes, found)))]
    parts += ["**Against sorting**: how many times as fast as `sort`", "\n".join(piped(speed_table(scenes, found)))]
    unsorted = unsorted_table(scenes, found)
    if unsorted:
        parts += [f"**Exact, against unsorted**: time in multiples of `{UNSORTED}`", "\n".join(piped(unsorted))]
    for name, scene, rows in scenes:
        counts = f"{scene['triangles']:,} triangles, {scene['fragments']:,} fragments, at most {scene['layers_max']}"
        parts += [f"**{name}**: {scene['about']}; {counts} in a pixel", "\n".join(piped(scene_table(rows)))]
    return "\n\n".join(parts) + "\n"


def about(found: Values) -> str:
    """Return what was measured, where, as a sentence."""
    scene = found["scenes"][0]
    width, height = scene["size"]
    frames = scene["rows"][0]["frames"]
    on = found.get("machine", {})
    where = f"{on['processor']}, {on['cores']} cores, clpeel {on['clpeel']}" if on else scene["device"]
    notes = "".join(f" Note: {note}." for note in found["notes"])
    return f"{len(found['scenes'])} scenes, {width} × {height}, frames of each row: {frames}; {where}.{notes}"


def overall_table(found: Values) -> list[list[str]]:
    """Return the means over all scenes. A star is for what nothing beats in both time and error."""
    from clpeel.study.standings import MEANS, Standing

    rows = [["technique", *(heading for heading, _ in MEANS)]]
    for each in found["overall"]:
        standing = Standing(**{name: value for name, value in each.items() if name != "on_front"})
        rows.append([("* " if each["on_front"] else "") + standing.name, *(cell(standing) for _, cell in MEANS)])
    return rows


Scenes = list[tuple[str, Values, dict[str, Values]]]


def rank_table(scenes: Scenes, found: Values) -> list[list[str]]:
    """Return the ranks by time and by error of each scene."""
    rows = [["technique", *(name for name, _, _ in scenes)]]
    for each in found["overall"]:
        own = [of.get(each["name"]) for _, _, of in scenes]
        rows.append([each["name"], *("-" if row is None else f"{row['rank_time']}/{row['rank_error']}" for row in own)])
    return rows


def speed_table(scenes: Scenes, found: Values) -> list[list[str]]:
    """Return for each row how many times as fast as the reference it is, and its opacity bias."""
    rows = [["technique", *(name for name, _, _ in scenes), "opacity"]]
    for each in found["overall"]:
        cells = [ratio(of, found["reference"], each["name"]) for _, _, of in scenes]
        rows.append([each["name"], *cells, f"{each['opacity_bias']:+.4f}"])
    return rows


def unsorted_table(scenes: Scenes, found: Values) -> list[list[str]]:
    """Return for each exact row its time as a multiple of that of UNSORTED; nothing if that was not drawn."""
    exact = [name for name, row in scenes[0][2].items() if row["exact"] and row["budget"] is None]
    if UNSORTED not in scenes[0][2]:
        return []
    return [
        ["technique", *(name for name, _, _ in scenes)],
        *([name, *(ratio(of, name, UNSORTED) for _, _, of in scenes)] for name in exact),
    ]


def ratio(rows: dict[str, Values], above: str, below: str) -> str:
    """Return the quotient of two rows' times, or - if one is missing."""
    if above not in rows or below not in rows:
        return "-"
    return f"{rows[above]['seconds_median'] / rows[below]['seconds_median']:.2f}"


def scene_table(rows: dict[str, Values]) -> list[list[str]]:
    """Return the figures of one scene."""
    from clpeel.study.tables import error_text, flip_text, milliseconds

    table = [["technique", "ms", "passes", "B/px", "MiB", "max error", "RMS", "PSNR", "FLIP"]]
    for name, row in rows.items():
        psnr = "∞" if row["psnr"] is None else f"{row['psnr']:.1f}"
        cells = [milliseconds(row["seconds_median"]), f"{row['passes']}", f"{row['bytes_per_pixel']:.0f}"]
        cells += [f"{row['memory_bytes'] / 2**20:.1f}", error_text(row["max_error"]), error_text(row["rms_error"])]
        table.append([("* " if row["on_front"] else "") + name, *cells, psnr, flip_text(row["flip"])])
    return table


# --- the command ------------------------------------------------------------------------------------------------------


def renewed(path: Path, text: str) -> str:
    """Return the document with the text between its markers. Stops if it has none."""
    try:
        return between_markers(path.read_text(encoding="utf-8"), text)
    except (OSError, ValueError) as error:
        stop(f"--report: {str(path)!r}: {error.strerror if isinstance(error, OSError) else error}")


def main(arguments: list[str] | None = None) -> int:
    """Run the tool and return its exit code."""
    from clpeel.files import write_whole

    options = parse(arguments)
    if options.report:
        renewed(options.report, "")
    found, code = (read(options.read), 0) if options.read else measured(options)
    if options.json:
        write_whole(options.json, (json.dumps(found, indent=2) + "\n").encode())
    if options.report and not code:
        write_whole(options.report, renewed(options.report, tables(found)).encode())
    else:
        print(tables(found), end="")
    return code


if __name__ == "__main__":
    from clpeel.errors import ClpeelError

    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
    except ClpeelError as error:
        stop(str(error), error.exit_code)
    except OSError as error:
        stop(str(error), 1)
