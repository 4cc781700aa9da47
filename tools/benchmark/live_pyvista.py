"""PyVista as the peer of the live view, run by a Python that has it: `python live_pyvista.py WHAT ARRAYS WIDTH HEIGHT`.

WHAT is `serve`: a page that shows what this process renders, by trame, as `clpeel view` does. Or it is `frames`: prints
the seconds of pictures from a moved camera, off screen, as JSON. ARRAYS: an NPZ file with vertices, faces and rgba.
"""

from __future__ import annotations

import json
import os
import statistics
import sys
import time
from typing import Any

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")

import numpy as np
import pyvista as pv

PEELS = 1000
"""The most peels. They end earlier, when nothing is left to be peeled."""

MARK = 128
"""Bytes put behind a picture: JSON, padded. recorder.js takes them off."""

FRAMES, ENOUGH_SECONDS = 5, 3.0
"""Frames that are timed, and the seconds after which no new one begins."""


def plotter_of(arrays: str, size: tuple[int, int]) -> Any:
    """Return a plotter of the scene that peels depths exactly, seen by the camera of all benchmarks."""
    data = np.load(arrays)
    mesh = pv.PolyData.from_regular_faces(data["vertices"], data["faces"])
    mesh.cell_data["rgba"] = data["rgba"]
    plotter = pv.Plotter(off_screen=True, window_size=size, lighting="none")
    plotter.disable_anti_aliasing()  # with samples, llvmpipe shows an empty picture, and clpeel takes one sample, too
    plotter.set_background("white")
    actor = plotter.add_mesh(mesh, scalars="rgba", rgba=True, lighting=False, show_scalar_bar=False)
    actor.ForceTranslucentOn()
    plotter.enable_depth_peeling(number_of_peels=PEELS, occlusion_ratio=0.0)
    plotter.camera_position = [(0, 0, 4), (0, 0, 0), (0, 1, 0)]
    plotter.camera.view_angle = 30
    plotter.reset_camera_clipping_range()
    return plotter


def frames(plotter: Any) -> None:
    """Print the median seconds of rendering, and of rendering and reading, from a camera that moves a little."""
    rendered: list[float] = []
    read: list[float] = []
    plotter.show(auto_close=False, interactive=False)
    began = time.perf_counter()
    while not read or (len(read) < FRAMES and time.perf_counter() - began < ENOUGH_SECONDS):
        plotter.camera.Azimuth(1.0)
        started = time.perf_counter()
        plotter.render()
        plotter.render_window.WaitForCompletion()
        rendered.append(time.perf_counter() - started)
        image = plotter.image
        read.append(time.perf_counter() - started)
    height, width = image.shape[:2]
    found = {"render_s": statistics.median(rendered), "read_s": statistics.median(read)}
    print(json.dumps({**found, "frames": len(read), "width": width, "height": height}))


def serve(plotter: Any) -> None:
    """Serve the plotter's page until the process is ended. Each picture says after which mouse message it was drawn."""
    from trame.app import get_server
    from trame.ui.vuetify3 import VAppLayout
    from trame_pyvista.ui import plotter_ui
    from trame_vtk.modules.vtk.protocols.mouse_handler import vtkWebMouseHandler
    from trame_vtk.modules.vtk.protocols.publish_image_delivery import vtkWebPublishImageDelivery

    handled, drawn, before, began, seconds = 0, 0, 0, 0.0, 0.0
    handle, still_render = vtkWebMouseHandler.mouse_interaction, vtkWebPublishImageDelivery.still_render

    def counted(self: Any, event: Any) -> Any:
        nonlocal handled
        handled += 1
        return handle(self, event)

    def start(*_: Any) -> None:
        nonlocal drawn, before, began
        before, drawn, began = drawn, handled, time.perf_counter()

    def end(*_: Any) -> None:
        nonlocal seconds
        seconds = time.perf_counter() - began

    def marked(self: Any, options: Any) -> Any:
        """Encoding goes on in a thread of VTK. A stale reply has the picture that was drawn before the latest one."""
        reply = still_render(self, options)
        if reply["image"]:
            width, height = reply["size"]
            says = {"answers": before if reply["stale"] else drawn, "milliseconds": round(seconds * 1e3, 1)}
            says |= {"scale": 1.0, "width": width, "height": height, "settled": not reply["stale"]}
            reply["image"] += json.dumps(says).ljust(MARK).encode()
        return reply

    counted._wslinkuris, marked.__name__ = handle._wslinkuris, "still_render"  # type: ignore[attr-defined]
    vtkWebMouseHandler.mouse_interaction, vtkWebPublishImageDelivery.still_render = counted, marked
    plotter.render_window.AddObserver("StartEvent", start)
    plotter.render_window.AddObserver("EndEvent", end)
    server = get_server(client_type="vue3")
    with VAppLayout(server):
        plotter_ui(plotter, mode="server", add_menu=False)
    server.controller.on_server_ready.add(lambda **_: print(f"open http://localhost:{server.port}/", flush=True))
    server.start(port=0, open_browser=False, show_connection_info=False, timeout=0)


if __name__ == "__main__":
    what, arrays, *sides = sys.argv[1:]
    {"serve": serve, "frames": frames}[what](plotter_of(arrays, (int(sides[0]), int(sides[1]))))
