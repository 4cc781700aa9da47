"""The figures, one function each. Each turns a `Bench` into values, targets, a table and notes."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from benchmark.runs import SCENES, Bench, Failed, Skipped, Values, ratio, spread, target

MIB = 2**20
UNSORTED_BOUNDS = {"dragon": 0.5, "spheres": 0.5, "boxes": 1.0, "grass": 1.0}
BYTES_A_FRAGMENT, BYTES_A_TRIANGLE = 16, 60
CHEAP = "weighted-sum"
ERROR = 1 / 255
HOST = "host memory of a frame, in times its result's"


@dataclass(frozen=True)
class Figure:
    """A figure. title: what it shows. measure: the function that measures it."""

    title: str
    measure: Callable[[Bench], Values]


FIGURES: dict[str, Figure] = {}
"""All figures by name, in the order in which they are measured and shown."""


def figure(name: str, title: str) -> Callable[[Callable[[Bench], Values]], Callable[[Bench], Values]]:
    """Return a decorator that puts a function into FIGURES."""

    def register(measure: Callable[[Bench], Values]) -> Callable[[Bench], Values]:
        FIGURES[name] = Figure(title, measure)
        return measure

    return register


def digits(value: float) -> str:
    """Return a number with about three digits."""
    if value == 0 or abs(value) >= 100:
        return f"{value:,.0f}"
    places = 3 if abs(value) < 1 else 2 if abs(value) < 10 else 1
    return f"{value:.{places}f}" if abs(value) >= 0.01 else f"{value:.2g}"


def cell(values: Values, factor: float = 1.0) -> str:
    """Return a median with its least and greatest."""
    median, least, greatest = (digits(values[key] * factor) for key in ("median", "least", "greatest"))
    return f"{median} ({least} .. {greatest})"


def share(value: float) -> str:
    """Return a share as a percentage."""
    if 0 < value < 1e-6:
        return "less than 0.0001 %"
    return f"{100 * value:.2g} %" if value < 0.1 else f"{100 * value:.0f} %"


# --- beside VTK -------------------------------------------------------------------------------------------------------


def beside(bench: Bench, mode: str) -> dict[str, Values]:
    """Return the seconds of both renderers for each scene that both drew. Raises Skipped if there is none."""
    if bench.peer_reason:
        raise Skipped(bench.peer_reason)
    found = {
        name: {
            "triangles": rounds["stats"][0]["triangles"],
            "fragments": rounds["stats"][0]["fragments"],
            "layers": rounds["stats"][0]["layers_max"],
            "clpeel": spread(rounds["clpeel"]),
            "vtk": spread(rounds[mode]),
            "times": ratio(rounds[mode], rounds["clpeel"]),
            "share": ratio(rounds["clpeel"], rounds[mode]),
            "differs": rounds.get("differs", {}),
        }
        for name, rounds in bench.scene_rounds.items()
        if rounds[mode]
    }
    if not found:
        raise Skipped(next((why for name, why in bench.missing.items() if name.startswith(f"VTK {mode}")), "no scene"))
    return found


def beside_table(found: dict[str, Values], peer: str, quotient: str, key: str) -> list[list[str]]:
    """Return a table with a row for each scene."""
    rows = [["scene", "triangles", "fragments", "most layers", "clpeel, s", f"VTK {peer}, s", quotient]]
    for name, one in found.items():
        counts = [f"{one[count]:,}" for count in ("triangles", "fragments", "layers")]
        rows.append([name, *counts, cell(one["clpeel"]), cell(one["vtk"]), cell(one[key])])
    return rows


@figure("peeling", "Exact picture: how many times as fast as VTK's dual depth peeling")
def peeling(bench: Bench) -> Values:
    found = beside(bench, "dual")
    times = [one["times"]["median"] for one in found.values()]
    judged = bench.full() and set(found) == set(SCENES)
    off = [f"{name} {', '.join(map(share, one['differs'].values()))}" for name, one in found.items()]
    differs = "pixels that differ from VTK's, which rounds to 8 bits at each layer, by more than 1, 2 and 8 of 255: "
    return {
        "values": found,
        "targets": [
            target("times VTK's speed, geometric mean", statistics.geometric_mean(times), ">=", 50, judged),
            target("times VTK's speed, least of the scenes", min(times), ">=", 30, judged),
        ],
        "table": beside_table(found, "dual depth peeling", "times as fast", "times"),
        "notes": [differs + "; ".join(off)],
    }


@figure("unsorted", "Exact picture: share of the time of one unsorted, wrong pass of VTK")
def unsorted(bench: Bench) -> Values:
    found = beside(bench, "unsorted")
    return {
        "values": found,
        "targets": [
            target(f"share of VTK's unsorted pass, {name}", found[name]["share"]["median"], "<=", bound, bench.full())
            for name, bound in UNSORTED_BOUNDS.items()
            if name in found
        ],
        "table": beside_table(found, "unsorted", "share of its time", "share"),
        "notes": [],
    }


# --- of the exact picture itself --------------------------------------------------------------------------------------


@figure("exactness", "Price of exactness: time of `sort` in times of inexact techniques of one pass")
def exactness(bench: Bench) -> Values:
    from clpeel.techniques import TECHNIQUES

    cheap = [
        name
        for name, technique in TECHNIQUES.items()
        if not (technique.exact or technique.maps) and technique.least_passes == 1
    ]
    if not cheap:
        raise Skipped(f"no inexact technique of one pass is registered, such as {CHEAP}; only {', '.join(TECHNIQUES)}")
    names = ["sort", *cheap]
    table, values = [["scene", *(f"{name}, s" for name in names), *(f"sort / {name}" for name in cheap)]], {}
    for scene, made in bench.scenes.items():
        found = bench.take_turns([bench.job(made, technique=name) for name in names], together=True)
        timed = {name: [one["median_s"] for one in rounds] for name, rounds in zip(names, found, strict=True)}
        price = {name: ratio(timed["sort"], timed[name]) for name in cheap}
        values[scene] = {"seconds": {name: spread(rounds) for name, rounds in timed.items()}, "price": price}
        cells = [cell(values[scene]["seconds"][name]) for name in names]
        table.append([scene, *cells, *(cell(price[name]) for name in cheap)])
    targets = []
    if CHEAP in cheap:
        worst = max(one["price"][CHEAP]["median"] for one in values.values())
        targets.append(target(f"times {CHEAP}'s time, most of the scenes", worst, "<=", 1.25, bench.full("scenes")))
    return {"values": values, "targets": targets, "table": table, "notes": []}


PEELED_SCENES: dict[str, list[Any]] = {
    "grass": ["grass"],
    "grass, other seed": ["grass", {"seed": 7}],
    "boxes, 10 a side": ["boxes"],
    "boxes, 11 a side": ["boxes", {"n": 11}],
}
"""The sizes of Figure 4 of Liu, Wei and Xu: 384 triangles in 20 layers, and about 15,000 triangles."""


@figure("techniques", "Techniques that peel: frames, and how many times as fast as depth-peeling")
def techniques(bench: Bench) -> Values:
    names = ["depth-peeling", "dual-depth-peeling", "multi-layer-peeling", "glowscript", "sort"]
    if bench.folder is None:
        raise Skipped("the scenes are those of a folder with scenes.py (--scenes)")
    table = [["scene", "triangles", "layers", *(f"{name}, ms" for name in names), *names[1:]]]
    values, targets = {}, []
    for scene, made in PEELED_SCENES.items():
        found = bench.take_turns([bench.job(made, technique=name) for name in names], together=True)
        timed = {name: [one["median_s"] for one in rounds] for name, rounds in zip(names, found, strict=True)}
        times = {name: ratio(timed[names[0]], timed[name]) for name in names[1:]}
        stats = found[-1][-1]["stats"]
        values[scene] = {"seconds": {name: spread(rounds) for name, rounds in timed.items()}, "times": times}
        numbers = [f"{stats['triangles']:,}", f"{stats['layers_max']}"]
        cells = [cell(values[scene]["seconds"][name], 1e3) for name in names]
        table.append([scene, *numbers, *cells, *(cell(times[name]) for name in names[1:])])
        fast = times["multi-layer-peeling"]["median"]
        targets.append(target(f"multi-layer-peeling, M = 8, {scene}", fast, ">=", 4, bench.full()))
        dual = 1 / times["dual-depth-peeling"]["median"]
        targets.append(target(f"dual-depth-peeling's share of the time, {scene}", dual, "<=", 0.52, bench.full()))
    return {"values": values, "targets": targets, "table": table, "notes": []}


PASS_KERNELS = ("clear_targets", "peel_fragments", "settle", "blend_layers")
"""The kernels of a pass, where techniques are executed by passes (stages/passes.py)."""

PAPER_SCENES = ("grass, other seed", "boxes, 11 a side")


@figure("execution", "The papers' machine: by passes beside by tiles, and several layers a pass beside one")
def execution(bench: Bench) -> Values:
    names = ["depth-peeling", "multi-layer-peeling", "dual-depth-peeling"]
    if bench.folder is None:
        raise Skipped("the scenes are those of a folder with scenes.py (--scenes)")
    heads = [
        *(f"{name}, ms by passes (of it the passes alone)" for name in names),
        *(f"{name}, by tiles = 1" for name in names),
    ]
    table = [["scene", "fragments", "layers", *heads, "M = 8, times as fast", "dual, share of the time"]]
    values, targets = {}, []
    for scene, made in {**bench.scenes, **{name: PEELED_SCENES[name] for name in PAPER_SCENES}}.items():
        jobs = [
            bench.job(made, technique=name, execution=execution) for name in names for execution in ("passes", "tiles")
        ]
        found = bench.take_turns(jobs, together=True)
        frames = [[one["median_s"] for one in rounds] for rounds in found]
        passes = [
            [sum(one["stats"]["kernel_seconds"].get(kernel, 0.0) for kernel in PASS_KERNELS) for one in rounds]
            for rounds in found[::2]
        ]
        slower = [ratio(ours, tiles) for ours, tiles in zip(frames[::2], frames[1::2], strict=True)]
        fast, dual = ratio(passes[0], passes[1]), ratio(passes[2], passes[0])
        stats = found[0][-1]["stats"]
        values[scene] = {
            "seconds": {name: spread(one) for name, one in zip(names, frames[::2], strict=True)},
            "passes": {name: spread(one) for name, one in zip(names, passes, strict=True)},
            "tiles": dict(zip(names, slower, strict=True)),
            "times": {"multi-layer-peeling": fast, "dual-depth-peeling": dual},
        }
        alone = (
            f"{cell(spread(a), 1e3)}, {digits(spread(b)['median'] * 1e3)}"
            for a, b in zip(frames[::2], passes, strict=True)
        )
        numbers = [f"{stats['fragments']:,}", f"{stats['layers_max']}"]
        table.append([scene, *numbers, *alone, *map(cell, slower), cell(fast), cell(dual)])
        targets.append(target(f"passes of M = 8 beside single ones, {scene}", fast["median"], ">=", 4, bench.full()))
        targets.append(target(f"passes of dual beside single ones, {scene}", dual["median"], "<=", 0.6, bench.full()))
    return {"values": values, "targets": targets, "table": table, "notes": []}


@figure("auto", "auto, its look included, beside each technique that keeps to an error of 1/255 in any channel")
def auto(bench: Bench) -> Values:
    from clpeel.techniques import TECHNIQUES

    choices = [
        (name, dict(variant.given()))
        for name, technique in TECHNIQUES.items()
        if technique.exact
        for variant in technique.variants()
    ]
    heads = [
        f"M = {variant.get('layers_per_pass', 8)}" if name == "multi-layer-peeling" else name
        for name, variant in choices
    ]
    table = [["scene", "auto chose", "auto, ms", *(f"{head}, ms" for head in heads), "times the best"]]
    values, targets = {}, []
    for scene, made in bench.scenes.items():
        jobs = [bench.job(made, technique="auto", max_error=ERROR)]
        jobs += [bench.job(made, technique=name, max_error=ERROR, **variant) for name, variant in choices]
        own, *others = bench.take_turns(jobs, together=True)
        timed = [[one["median_s"] for one in rounds] for rounds in others]
        best = min(timed, key=statistics.median)
        chosen = own[-1]["stats"]["auto"]["explanation"][0].removeprefix("auto chose ").partition(", in float32")[0]
        found = [one["median_s"] for one in own]
        others_by_name = {head: spread(one) for head, one in zip(heads, timed, strict=True)}
        values[scene] = {"seconds": {"auto": spread(found), **others_by_name}, "times": ratio(found, best)}
        cells = [cell(spread(one), 1e3) for one in (found, *timed)]
        table.append([scene, chosen, *cells, cell(values[scene]["times"])])
        times = values[scene]["times"]["median"]
        targets.append(target(f"times the best single choice, {scene}", times, "<=", 1.15, bench.full()))
    return {
        "values": values,
        "targets": targets,
        "table": table,
        "notes": ["M: layers that multi-layer-peeling peels in a pass"],
    }


@figure("errors", "A guaranteed error: frames, and how many times as fast as with none")
def errors(bench: Bench) -> Values:
    from clpeel.techniques import TECHNIQUES

    names = [name for name, technique in TECHNIQUES.items() if technique.exact]
    bounds: dict[str, dict[str, Any]] = {"none": {}}
    bounds |= {f"1/{steps}": {"max_error": 1 / steps} for steps in (255, 64, 16)}
    table = [["scene", "technique", *(f"{text}, ms" for text in bounds), *list(bounds)[1:], "passes"]]
    values: Values = {}
    scenes = {name: made for name, made in bench.scenes.items() if name in ("boxes", "grass")}
    for scene, made in scenes.items():
        jobs = [bench.job(made, technique=name, **options) for name in names for options in bounds.values()]
        found = iter(bench.take_turns(jobs, together=True))
        for name in names:
            rounds = {text: next(found) for text in bounds}
            timed = {text: [one["median_s"] for one in each] for text, each in rounds.items()}
            passes = [each[-1]["stats"]["passes"] for each in rounds.values()]
            times = {text: ratio(timed["none"], timed[text]) for text in list(bounds)[1:]}
            values[f"{scene}, {name}"] = {"times": times, "seconds": {text: spread(one) for text, one in timed.items()}}
            table.append(
                [
                    scene,
                    name,
                    *(cell(spread(timed[text]), 1e3) for text in bounds),
                    *(cell(one) for one in times.values()),
                    ", ".join(map(str, passes)),
                ]
            )
    return {"values": values, "targets": [], "table": table, "notes": []}


FEATURES: dict[str, dict[str, Any]] = {
    "`keep_color`: colours as floats, too": {"keep_color": True},
    "`background=None`: straight alpha": {"background": None},
    "`max_error=0`: a map of the error": {"max_error": 0.0},
    '`precision="half"`': {"precision": "half"},
    '`precision="unorm8"`': {"precision": "unorm8"},
    '`depth_format="float32"`': {"depth_format": "float32"},
    '`depth_format="unorm24"`': {"depth_format": "unorm24"},
    '`depth_format="rgba8"`': {"depth_format": "rgba8"},
    "`samples=4`": {"samples": 4},
    "`layers=True`": {"layers": True},
    '`lighting="headlight"`': {"lighting": "headlight"},
    '`lighting="kit"`': {"lighting": "kit"},
    '`lighting="kit"`, `highlights="full"`': {"lighting": "kit", "highlights": "full"},
    "`edges=True`": {"edges": True},
    "`feature_edges=30`": {"feature_edges": 30.0},
    "`silhouettes=True`": {"silhouettes": True},
}
"""Options of `sort`. Every technique that peels has them as well."""


@figure("features", "What each feature costs: frames with it switched on, in times those without")
def features(bench: Bench) -> Values:
    """Measure each scene as it is, with a colour for each vertex, and with every tenth or every triangle opaque."""
    values: Values = {}
    table = [["feature", *bench.scenes]]
    rows: dict[str, list[str]] = {}
    for scene, made in bench.scenes.items():
        plain = {"keep_color": False}
        trials = {text: (made, {**plain, **options}) for text, options in FEATURES.items()}
        trials["a colour for each vertex"] = (["vertex colors", *made], plain)
        trials["every tenth triangle opaque"] = (["some opaque", 10, *made], plain)
        trials["all opaque"] = (["some opaque", 1, *made], plain)
        jobs = [bench.job(made, **plain), *(bench.job(which, **options) for which, options in trials.values())]
        first, *others = bench.take_turns(jobs, together=True)
        base = [one["median_s"] for one in first]
        rows.setdefault("plain, ms", []).append(cell(spread(base), 1e3))
        for text, rounds in zip(trials, others, strict=True):
            times = ratio([one["median_s"] for one in rounds], base)
            values.setdefault(text, {})[scene] = times
            rows.setdefault(text, []).append(cell(times))
    table += [[text, *cells] for text, cells in rows.items()]
    notes = ["plain: `sort` of flat colours over white, without `color`; all are of scenes that are on the device"]
    return {"values": values, "targets": [], "table": table, "notes": notes}


AROUND = {"boxes": False, "spheres": True}
"""The scenes that get a texture, and whether it goes around the scene, or onto each side (makers.textured)."""

FILTERS: dict[str, tuple[str, dict[str, Any]]] = {
    "`nearest`": ("nearest", {}),
    "`linear`": ("linear", {}),
    "`linear-mipmap-nearest`": ("linear-mipmap-nearest", {}),
    "`linear-mipmap-linear`": ("linear-mipmap-linear", {}),
    "`linear-mipmap-linear`, `anisotropy=4`": ("linear-mipmap-linear", {"anisotropy": 4}),
}
"""How a texture is minified, and options of `sort`."""

LIGHTS: dict[str, dict[str, Any]] = {
    "unlit": {},
    "headlight": {"lighting": "headlight"},
    "kit": {"lighting": "kit"},
}


@figure("textures", "What a texture costs: frames with one, in times those with a colour for each face")
def textures(bench: Bench) -> Values:
    """Measure scenes as they are, with vertex colours and with textures; unlit and lit. All have the same fragments."""
    from benchmark.makers import TEXELS

    values: Values = {}
    scenes = {name: made for name, made in bench.scenes.items() if name in AROUND}
    if not scenes:
        raise Skipped(f"none of {', '.join(AROUND)} is there")
    heads = [f"{name}, {light}" for name in scenes for light in LIGHTS]
    rows: dict[str, list[str]] = {}
    for scene, made in scenes.items():
        for light, options in LIGHTS.items():
            plain = {"keep_color": False, **options}
            jobs = [bench.job(made, **plain), bench.job(["vertex colors", *made], **plain)]
            jobs += [
                bench.job(["textured", AROUND[scene], minify, *made], **plain, **more)
                for minify, more in FILTERS.values()
            ]
            found = bench.take_turns(jobs, together=True)
            flat, *others = ([one["median_s"] for one in rounds] for rounds in found)
            rows.setdefault("a colour for each face, ms", []).append(cell(spread(flat), 1e3))
            for text, seconds in zip(("a colour for each vertex", *FILTERS), others, strict=True):
                times = ratio(seconds, flat)
                values.setdefault(text, {}).setdefault(scene, {})[light] = times
                rows.setdefault(f"{text}, times that", []).append(cell(times))
    table = [["frame", *heads], *([text, *cells] for text, cells in rows.items())]
    notes = [
        "the time of `sort` over white, without `color`; "
        f"the texture is opaque, {TEXELS} x {TEXELS}, and times the face's colour"
    ]
    return {"values": values, "targets": [], "table": table, "notes": notes}


@figure("samples", "What smooth edges cost: frames with several samples a pixel, in times those with one")
def samples(bench: Bench) -> Values:
    """Measure each scene as it is, unlit and lit."""
    values: Values = {}
    table = [["scene", "one sample, ms", *(f"{count} samples, times that" for count in (4, 8, 16))]]
    for scene, made in bench.scenes.items():
        for light, options in LIGHTS.items():
            plain = {"keep_color": False, **options}
            jobs = [bench.job(made, **plain), *(bench.job(made, samples=count, **plain) for count in (4, 8, 16))]
            found = bench.take_turns(jobs, together=True)
            one, *others = ([each["median_s"] for each in rounds] for rounds in found)
            times = [ratio(seconds, one) for seconds in others]
            values.setdefault(scene, {})[light] = dict(zip(("4", "8", "16"), times, strict=True))
            table.append([f"{scene}, {light}", cell(spread(one), 1e3), *map(cell, times)])
    return {"values": values, "targets": [], "table": table, "notes": ["`sort` over white, without `color`"]}


@figure("limit", "Distance from the limit that memory sets")
def limit(bench: Bench) -> Values:
    copied = bench.bandwidth
    table = [["scene", "limit, ms", "measured, ms", "times the limit"]]
    values: Values = {"bandwidth": copied, "scenes": {}}
    for name, rounds in bench.scene_rounds.items():
        stats = rounds["stats"][0]
        nbytes = BYTES_A_FRAGMENT * stats["fragments"] + BYTES_A_TRIANGLE * stats["triangles"]
        least = nbytes / copied["bytes_per_second"]
        seconds = spread(rounds["clpeel"])
        times = spread(value / least for value in rounds["clpeel"])
        values["scenes"][name] = {"limit_s": least, "seconds": seconds, "times": times}
        table.append([name, digits(least * 1e3), cell(seconds, 1e3), cell(times)])
    worst = max(one["times"]["median"] for one in values["scenes"].values())
    return {
        "values": values,
        "targets": [target("times the limit, most of the scenes", worst, "<=", 6, bench.full("scenes"))],
        "table": table,
        "notes": [
            f"limit: {BYTES_A_FRAGMENT} bytes a fragment and {BYTES_A_TRIANGLE} a triangle, at the "
            f"{copied['bytes_per_second'] / 1e9:.1f} GB/s (bytes read + bytes written) with which the device copies "
            f"{copied['nbytes'] // MIB} MiB, best of all tries ({copied['way']})"
        ],
    }


@figure("layers", "Time per fragment against layers in every pixel")
def layers(bench: Bench) -> Values:
    size, deepest = bench.settings.size, bench.settings.layers
    counts = [4**power for power in range(1, 20) if 4**power <= deepest]
    sides = [max(1, 2 * size // math.isqrt(count)) for count in counts]
    jobs = [bench.job(["stack", count], side) for count, side in zip(counts, sides, strict=True)]
    found = dict(zip(counts, bench.take_turns(jobs, together=True), strict=True))
    per = {count: nanoseconds(rounds, "fragments") for count, rounds in found.items()}
    table = [["layers", "picture", "fragments", "ns per fragment"]]
    for (count, rounds), side in zip(found.items(), sides, strict=True):
        table.append(
            [f"{count:,}", f"{side} x {side}", f"{rounds[0]['stats']['fragments']:,}", cell(spread(per[count]))]
        )
    times = ratio(per[deepest], per[16])
    return {
        "values": {
            "ns": {str(count): spread(value) for count, value in per.items()},
            "times": times,
            "reference": "16",
        },
        "targets": [
            target(
                f"times the time per fragment, {deepest:,} layers beside 16",
                times["median"],
                "<=",
                3,
                bench.full("layers"),
            )
        ],
        "table": table,
        "notes": [],
    }


@figure("pixels", 'Time per fragment against the picture\'s size, and memory, with `memory="512M"`')
def pixels(bench: Bench) -> Values:
    size = bench.settings.size
    last = size * bench.settings.largest
    sides = [size * times // 4 for times in (1, 2, 4, 8, 16, 32) if 4 <= size * times <= 4 * last]
    jobs = [bench.job(["boxes"], side, memory="512M", keep_color=False) for side in sides]
    found = dict(zip(sides, bench.take_turns(jobs, together=False), strict=True))
    per = {side: nanoseconds(rounds, "fragments") for side, rounds in found.items()}
    beyond = {
        side: max(one["peak_bytes"] for one in rounds) / MIB - side * side * 4 / MIB for side, rounds in found.items()
    }
    before = {side: max(one["before_bytes"] for one in rounds) / MIB for side, rounds in found.items()}
    table = [["pixels", "fragments", "frame, s", "ns per fragment", "peak - picture, MiB", "before a frame, MiB"]]
    for side, rounds in found.items():
        seconds = spread(one["median_s"] for one in rounds)
        count = f"{rounds[0]['stats']['fragments']:,}"
        memory = [f"{beyond[side]:.0f}", f"{before[side]:.0f}"]
        table.append([f"{side} x {side}", count, cell(seconds), cell(spread(per[side])), *memory])
    times = ratio(per[last], per[size])
    judged = bench.full("largest")
    return {
        "values": {
            "ns": {str(side): spread(value) for side, value in per.items()},
            "times": times,
            "reference": str(size),
            "beyond_picture_mib": {str(side): value for side, value in beyond.items()},
        },
        "targets": [
            target(f"times the time per fragment, {last} beside {size} pixels", times["median"], "<=", 1.3, judged),
            target(f"MiB of the process beside the picture, {last} pixels", beyond[last], "<=", 512, judged),
        ],
        "table": table,
        "notes": [
            "each size and round in a process of its own: its most resident memory less the picture's 4 bytes a pixel, "
            "and what Python, its libraries and the scene take of it before anything is drawn"
        ],
    }


@figure("triangles", "Time per triangle against triangles of less than a pixel")
def triangles(bench: Bench) -> Values:
    most = bench.settings.triangles
    counts = [most // part for part in (1000, 100, 10, 1) if most >= part]
    jobs = [bench.job(["soup", count, bench.settings.size]) for count in counts]
    found = dict(zip(counts, bench.take_turns(jobs, together=False), strict=True))
    per = {count: nanoseconds(rounds, "triangles") for count, rounds in found.items()}
    table = [["triangles", "fragments", "frame, s", "ns per triangle"]]
    for count, rounds in found.items():
        seconds = spread(one["median_s"] for one in rounds)
        row = [f"{count:,}", f"{rounds[0]['stats']['fragments']:,}", cell(seconds), cell(spread(per[count]))]
        table.append(row)
    times = ratio(per[most], per[most // 10])
    what = f"times the time per triangle, {most:,} beside {most // 10:,}"
    return {
        "values": {
            "ns": {str(count): spread(value) for count, value in per.items()},
            "times": times,
            "reference": str(most // 10),
        },
        "targets": [target(what, times["median"], "<=", 1.3, bench.full("triangles"))],
        "table": table,
        "notes": [],
    }


def nanoseconds(rounds: list[Values], per: str) -> list[float]:
    """Return for each round the median frame's time divided by the number of fragments or triangles, in ns."""
    return [one["median_s"] * 1e9 / max(one["stats"][per], 1) for one in rounds]


# --- of the whole command and of frames -------------------------------------------------------------------------------


@figure("start-up", "The whole command on a mesh of 12 triangles")
def start_up(bench: Bench) -> Values:
    from benchmark.makers import CUBE, CUBE_FACES, write_ply

    cube, png = str(bench.scratch / "cube.ply"), str(bench.scratch / "cube.png")
    write_ply(cube, CUBE, CUBE_FACES)
    render = ["render", cube, "-o", png, "--resolution", f"{bench.settings.size},{bench.settings.size}"]
    timed: dict[str, list[float]] = {"cold": [], "warm": [], "help": []}
    for number in range(bench.settings.rounds):
        home = str(bench.scratch / f"home{number}")
        timed["cold"].append(bench.command_seconds(render, home))
        timed["warm"].append(bench.command_seconds(render, home))
        timed["help"].append(bench.command_seconds(["--help"], home))
    found = {name: spread(values) for name, values in timed.items()}
    words = {"cold": "render, no kernels compiled yet", "warm": "render", "help": "--help"}
    return {
        "values": found,
        "targets": [
            target("seconds of a render", found["warm"]["median"], "<=", 0.8, bench.full()),
            target("seconds of the first render", found["cold"]["median"], "<=", 4, bench.full()),
        ],
        "table": [["clpeel", "seconds"], *([text, cell(found[name])] for name, text in words.items())],
        "notes": [],
    }


@figure("camera", "A moving camera: what each frame asks for, once the scene is on the device")
def camera(bench: Bench) -> Values:
    size, count = bench.settings.size, 2 * bench.settings.frames
    scenes = {"boxes": ["boxes"], "soup": ["soup", bench.settings.triangles // 10, size]}
    kinds = {
        "allocations": "buffers allocated",
        "wrapped": "host arrays wrapped",
        "programs": "programs built",
        "bytes to the device": "bytes to the device",
    }
    times = ("first frame", "a frame of the first turn, at most", "a frame of the second turn, at most")
    rows = ["first frame, s", "later frames, s", "scene, bytes", *(f"{kinds[k]}: {t}" for k in kinds for t in times)]
    table, values = [["", *rows, HOST]], {}
    for name, scene in scenes.items():
        found = bench.measure("camera", scene=scene, size=size, count=count)
        first, *later = found["turns"][0]
        again = found["turns"][1]
        values[name] = {
            "first": first,
            "later_s": spread(frame["seconds"] for frame in [*later, *again]),
            "later": {kind: max(frame[kind] for frame in later) for kind in kinds},
            "again": {kind: max(frame[kind] for frame in again) for kind in kinds},
            "host_times_result": found["host_peak_bytes"] / found["result_bytes"],
            "scene_bytes": found["scene_bytes"],
        }
        one = values[name]
        counts = [f"{one[when][kind]:,}" for kind in kinds for when in ("first", "later", "again")]
        cells = [digits(first["seconds"]), cell(one["later_s"]), f"{one['scene_bytes']:,}", *counts]
        table.append([name, *cells, digits(one["host_times_result"])])
    worst = {kind: max(one["again"][kind] for one in values.values()) for kind in kinds}
    host = max(one["host_times_result"] for one in values.values())
    large = values["soup"]
    sent = large["again"]["bytes to the device"] / large["scene_bytes"]
    return {
        "values": values,
        "targets": [
            target("buffers allocated by a frame of the second turn", worst["allocations"], "<=", 0),
            target("programs built by a frame of the second turn", worst["programs"], "<=", 0),
            target("share of the large scene sent to the device by a frame", sent, "<=", 0.01, bench.full()),
            target(HOST, host, "<=", 1.25, bench.full()),
        ],
        "table": [list(row) for row in zip(*table, strict=True)],
        "notes": [
            f"the camera turns by a degree a frame, {count} frames, and then through the same again: in the first turn "
            "a buffer grows where a view needs more than those before"
        ],
    }


@figure("stages", "Where the time goes")
def stages(bench: Bench) -> Values:
    values: Values = {}
    for name, rounds in bench.scene_rounds.items():
        values[name] = {
            "fragments": rounds["stats"][0]["fragments"],
            "triangles": rounds["stats"][0]["triangles"],
            **{
                part: {
                    key: spread(one[part].get(key, 0.0) for one in rounds["stats"]) for key in rounds["stats"][0][part]
                }
                for part in ("seconds", "kernel_seconds")
            },
        }
    table = [["", *(f"{name}, {unit}" for name in values for unit in ("ns / fragment", "ns / triangle"))]]
    for part, kind in (("seconds", ""), ("kernel_seconds", "kernel ")):
        for key in dict.fromkeys(key for one in values.values() for key in one[part]):
            row = [f"{kind}{key}"]
            for one in values.values():
                seconds = one[part].get(key, {"median": 0.0})["median"]
                row += [digits(seconds * 1e9 / max(one[per], 1)) for per in ("fragments", "triangles")]
            table.append(row)
    if not values:
        raise Failed("no scene")
    return {
        "values": values,
        "targets": [],
        "table": table,
        "notes": [
            "by the device's own clock; host is what no kernel took: Python's work and waiting between kernels. Stages "
            "first, then the kernels they are made of"
        ],
    }
