"""The status: what the overlay and the panel show of a frame, as plain numbers and texts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from clpeel.checks import Background, checked_background, shades_of
from clpeel.options import options_of
from clpeel.rendering.request import all_options
from clpeel.rendering.result import left_out
from clpeel.techniques import AUTO, TECHNIQUES, option_names, options_class
from clpeel.viewer.controls import KEYS, OPTION_NAMES, SHOWN
from clpeel.viewer.painter import Frame
from clpeel.viewer.view import LIGHTINGS, SAMPLES, View

Status = Mapping[str, Any]

LABELS = {
    "technique": "technique",
    "shows": "show",
    "opacity": "opacity",
    "passes": "passes",
    "occlusion_query": "occlusion query",
    "layers_per_pass": "layers a pass",
    "precision": "precision",
    "depth_format": "depth format",
    "max_error": "max error",
    "coincident": "coincident",
    "opaque": "opaque surfaces",
    "execution": "execution",
    "samples": "samples",
    "lighting": "light",
    "background": "background",
    "orthographic": "parallel",
    "turning": "turning",
}


def settings(view: View) -> dict[str, Any]:
    """Return the value of every setting. An option that is not set has its default; without one it is None."""
    # Those of glowscript come first and the technique's own last, as defaults differ.
    owners = (*reversed(all_options()), options_class(view.technique))
    defaults = {each.name: each.default for owner in owners for each in options_of(owner)} | {"samples": SAMPLES}
    own = {name: view.options.get(name, defaults[name]) for name in OPTION_NAMES}
    return {
        "technique": view.technique,
        "shows": view.shows,
        "opacity": view.opacity,
        "background": _listed(checked_background(view.background)),
        "lighting": view.lighting,
        "orthographic": view.camera.orthographic,
        "turning": view.turning,
        **own,
    }


def _listed(background: Background | None) -> list[Any] | None:
    """Return three numbers, or two lists of three for a gradient, as JSON gives them back."""
    if background is None:
        return None
    shades = [list(each) for each in shades_of(background)]
    return shades if len(shades) > 1 else shades[0]


def description() -> dict[str, Any]:
    """Return what never changes: the keys, and each setting's label, choices, and techniques that have it."""
    options = {each.name: each for owner in all_options() for each in options_of(owner)}
    choices: dict[str, tuple[object, ...]] = {name: options[name].choices for name in OPTION_NAMES}
    choices |= {"technique": (*TECHNIQUES, AUTO), "shows": SHOWN, "lighting": LIGHTINGS}
    return {
        "keys": [list(each) for each in KEYS],
        "labels": LABELS,
        "choices": {name: list(values) for name, values in choices.items() if values},
        "options": {name: list(option_names(name)) for name in (*TECHNIQUES, AUTO)},
        "common": [name for name in OPTION_NAMES if not any(name in option_names(each) for each in TECHNIQUES)],
    }


def status_of(frame: Frame, view: View) -> dict[str, Any]:
    """Return the figures of a frame, and the settings of the view as it is now."""
    stats = frame.stats
    height, width = frame.image.shape[:2]
    return {
        "technique": stats.technique,
        "auto": frame.view.technique == AUTO,
        "shows": frame.view.shows,
        "passes": stats.passes,
        "layers": stats.layers_max,
        "fragments": stats.fragments,
        "triangles": stats.triangles,
        "milliseconds": round(frame.seconds * 1e3, 1),
        "width": width,
        "height": height,
        "scale": frame.scale,
        "samples": stats.samples,
        "full": frame.full,
        "coarse": frame.coarse,
        "answers": frame.view.answers,
        "max_error": None if frame.errors is None else frame.errors[0],
        "rms_error": None if frame.errors is None else frame.errors[1],
        "notes": [*frame.notes, *left_out(stats, bounded=frame.view.options.get("max_error") is not None)],
        "settings": settings(view),
    }


def lines_of(status: Status) -> list[str]:
    """Return the status as a few lines of text, for screens that have no page."""
    values = status["settings"]
    technique = status["technique"] + (" (chosen by auto)" if status["auto"] else "")
    showing = "" if status["shows"] == "picture" else f", heat map of {status['shows']}"
    passes = f"{status['passes']:,} geometry pass{'es' if status['passes'] != 1 else ''}"
    if "occlusion_query" in option_names(values["technique"]):
        passes += f", occlusion query {'on' if values['occlusion_query'] else 'off'}"
    size = f"{status['width']:,} x {status['height']:,}"
    if not status["full"]:
        size += " while moving" + (", coarser mesh" if status["coarse"] else "")
    elif status["samples"] > 1:
        size += f", {status['samples']} samples"
    found = [
        technique + showing,
        passes,
        f"{status['layers']:,} layers, {status['fragments']:,} fragments",
        f"{status['milliseconds']:.1f} ms, {size}",
    ]
    if values["opacity"] is not None:
        found[0] += f", opacity {values['opacity']:.2f}"
    if status["max_error"] is not None:
        found.append(f"error: max {status['max_error']:.2e}, RMS {status['rms_error']:.2e} of 1")
    return [*found, *(f"note: {note}" for note in status["notes"])]
