"""Draws a view with f3d, run by a Python that has it: `python draw_f3d.py JOB`; JOB is JSON (views.py)."""

from __future__ import annotations

import json
import sys
from typing import Any

import f3d


def draw(job: dict[str, Any]) -> None:
    """Draw the view into its file. Transparent surfaces are peeled; grid, axes and tone mapping are off by default."""
    f3d.Log.set_verbose_level(f3d.Log.VerboseLevel.QUIET)
    engine = f3d.Engine.create(True)
    engine.options.update(
        {
            "render.background.color": job["background"],
            "render.effect.blending.mode": "ddp",
            "model.unlit": not (job["lit"] or job["own"]),
        }
    )
    if job["own"]:
        engine.options.update({"render.effect.antialiasing.mode": "ssaa"})
    if job["opacity"] is not None:
        engine.options["model.color.opacity"] = job["opacity"]
    engine.window.size = job["side"], job["side"]
    engine.scene.add(job["model"])
    if not job["own"]:
        engine.scene.remove_all_lights()
        engine.scene.add_light(f3d.LightState(f3d.LightType.HEADLIGHT, (0.0, 0.0, 1.0), direction=(0.0, 0.0, -1.0)))
    camera = engine.window.camera
    camera.position, camera.focal_point, camera.view_up = job["position"], job["focal_point"], job["view_up"]
    camera.view_angle = job["view_angle"]
    engine.window.render_to_image().save(job["out"])


if __name__ == "__main__":
    draw(json.loads(sys.argv[1]))
    print(f"f3d {f3d.__version__}")
