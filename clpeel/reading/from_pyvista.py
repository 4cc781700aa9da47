"""Converts a PyVista plotter to what `clpeel.render` takes: the scene, the camera, and the options of its picture."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from clpeel.errors import InputError
from clpeel.reading.objects import library_of
from clpeel.reading.transforms import product
from clpeel.reading.vtk_actors import Drawn, drawn_by, unlit
from clpeel.reading.vtk_arrays import messages
from clpeel.reading.vtk_lights import is_headlight, lamps
from clpeel.scene.camera import Camera, Degrees
from clpeel.scene.lights import Lamp
from clpeel.scene.scene import Scene, joined

_WORDS = {
    "ScalarBarActor": "scalar bar (result.with_bar(*scene.color_maps) draws one)",
    "CornerAnnotation": "text",
    "TextActor": "text",
    "Text": "text",
    "CubeAxesActor": "axes around the scene",
    "LegendBoxActor": "legend",
    "Volume": "volume",
    "ActorProp2D": "flat drawing",
}


def from_pyvista(plotter: Any) -> tuple[Scene, Camera, dict[str, Any]]:
    """Return the scene, the camera and the options of what a PyVista plotter shows, for `clpeel.render`:

        scene, camera, options = clpeel.from_pyvista(plotter)
        clpeel.render(scene, camera, **options).save("plot.png")

    The scene has the meshes of all visible actors, where their transforms put them, with the colours that their own
    lookup tables give their scalars, their opacity, styles, culling and textures. The options are the background, the
    size of the window, edges, widths of lines and points, light, and several samples if the plotter smooths edges. It
    looks as PyVista draws it, but for light: see vtk_lights.lamps. Of several subplots, the active one is taken.

    If no camera was set, the plotter's is set as `plotter.show()` would set it; nothing else of the plotter changes.
    `scene.notes` names what is left out, such as scalar bars.

    Raises InputError if this is no plotter, or shows nothing.
    """
    if not hasattr(plotter, "renderer") or not hasattr(plotter, "renderers"):
        kind = f"{type(plotter).__name__} of {library_of(plotter)}"
        raise InputError(f"from_pyvista: expected a pyvista.Plotter, got {kind}; meshes are for clpeel.load")
    renderer = plotter.renderer
    notes = list[str]()
    with messages() as told:
        drawn = list(_drawn(renderer, notes))
        if not drawn:
            raise InputError(
                "from_pyvista: expected a plotter that shows meshes, got none; once it was shown and closed it has "
                "none, so convert it before show(), or call show(auto_close=False)"
            )
        notes.extend(_left_out(plotter, renderer))
        camera = camera_of(renderer)
    notes.extend(f"VTK reports: {text}" for text in told)
    options = _options(plotter, renderer, drawn, notes)
    lighting, lights = _lighting(renderer, drawn, camera)
    mixed = lighting != "none"
    scene = joined([each.scene if each.lit or not mixed else unlit(each.scene) for each in drawn])
    notes = list(dict.fromkeys([*scene.notes, *notes]))
    return replace(scene, lights=lights, notes=tuple(notes)), camera, {**options, "lighting": lighting}


def _drawn(renderer: Any, notes: list[str]) -> Iterator[Drawn]:
    """Yield what each visible actor of a renderer draws, in their order, also within assemblies."""
    others = Counter[str]()
    model = _matrix(renderer.GetActiveCamera().GetModelTransformMatrix())
    for prop in renderer.GetViewProps():
        if not prop.GetVisibility():
            continue
        prop.InitPathTraversal()
        while (path := prop.GetNextPath()) is not None:
            node = path.GetLastNode()
            part = node.GetViewProp()
            if not part.GetVisibility():
                continue
            plain = part.IsA("vtkActor") and not part.IsA("vtkCubeAxesActor") and not part.IsA("vtkAxesActor")
            if not plain:
                name = part.GetClassName().removeprefix("vtk").removeprefix("OpenGL")
                others[_WORDS.get(name, name)] += 1
                continue
            found = drawn_by(part, product(model, _matrix(node.GetMatrix() or part.GetMatrix())), notes)
            if found is not None:
                yield found
    notes.extend(f"{name} left out" + (f", {count} of them" if count > 1 else "") for name, count in others.items())


def _matrix(matrix: Any) -> NDArray[np.float64]:
    """Return a vtkMatrix4x4 as float64 [4, 4]."""
    return np.array([[matrix.GetElement(row, column) for column in range(4)] for row in range(4)])


def _left_out(plotter: Any, renderer: Any) -> Iterator[str]:
    """Yield notes of what the plotter shows besides its actors."""
    others = len(list(plotter.renderers)) - 1
    if others:
        yield f"{others} other subplot(s) left out: plotter.subplot(row, column) chooses one"
    if getattr(renderer, "axes_enabled", False):
        yield "orientation axes left out: result.with_axis(camera) draws some"
    passes = renderer.GetPass()
    if passes is not None and not passes.IsA("vtkSSAAPass"):
        yield "effects of render passes left out, such as shadows and ambient occlusion"
    if renderer.GetTexturedBackground():
        yield "picture in the background left out"
    if renderer.GetUseImageBasedLighting():
        yield "light from a picture around the scene left out"


# --- the view ---------------------------------------------------------------------------------------------------------


def camera_of(renderer: Any) -> Camera:
    """Return the camera of a PyVista renderer, which is set as at its first picture if nobody has set it."""
    if not getattr(renderer.camera, "is_set", True):
        renderer.camera_position = renderer.get_default_cam_pos()
        renderer.ResetCamera()
    return of_vtk_camera(renderer.GetActiveCamera(), renderer.GetTiledAspectRatio())


def of_vtk_camera(camera: Any, aspect: float) -> Camera:
    """Return a vtkCamera as a Camera. aspect: width / height of its picture, for an angle that is a horizontal one."""
    position, focal_point, up = camera.GetPosition(), camera.GetFocalPoint(), camera.GetViewUp()
    flat = bool(camera.GetParallelProjection())
    half = math.tan(math.radians(camera.GetViewAngle()) / 2)
    if flat:
        half = camera.GetParallelScale() / camera.GetDistance()
    elif camera.GetUseHorizontalViewAngle():
        half /= aspect
    angle = Degrees(math.degrees(2 * math.atan(half)))
    return Camera(position, focal_point, up, angle, orthographic=flat)


def _options(plotter: Any, renderer: Any, drawn: list[Drawn], notes: list[str]) -> dict[str, Any]:
    """Return the options of the picture but that of light.

    Widths and edges are alike for all meshes of a picture. Notes say which ones differ.
    """
    left, bottom, right, top = renderer.GetViewport()
    width, height = plotter.window_size
    bright, dark = renderer.GetBackground(), renderer.GetBackground2()
    options: dict[str, Any] = {
        "size": (max(round((right - left) * width), 1), max(round((top - bottom) * height), 1)),
        "background": (tuple(dark), tuple(bright)) if renderer.GetGradientBackground() else tuple(bright),
        "samples": 4 if _is_smooth(plotter, renderer) else 1,
    }
    for name in ("line_width", "point_size"):
        own = [width for each in drawn if (width := getattr(each, name)) is not None]
        if own:
            options[name] = own[0]
        if len(set(own)) > 1:
            notes.append(f"{name}: {own[0]:g} for all meshes, as a picture has one; others have {_others(own)}")
    dotted = [each.spheres for each in drawn if each.point_size is not None]
    if dotted:
        options["point_type"] = "sphere" if dotted[0] else "square"
    surfaces = [each for each in drawn if len(each.scene.faces)]
    edged = [each.edges for each in surfaces if each.edges is not None]
    if edged and len(edged) == len(surfaces):
        color, opacity = edged[0]
        options |= {"edges": True, "edge_color": color, "edge_opacity": opacity}
        if len(set(edged)) > 1:
            notes.append("edges of all meshes have the colour and the opacity of the first one's, as a picture has one")
    elif edged:
        notes.append(f"edges of {len(edged)} mesh(es) left out: a picture has those of all meshes or none (edges=True)")
    return options


def _others(values: list[float]) -> str:
    return ", ".join(f"{value:g}" for value in dict.fromkeys(values[1:]) if value != values[0])


def _is_smooth(plotter: Any, renderer: Any) -> bool:
    """Return whether the plotter smooths edges in any way."""
    window, passes = plotter.render_window, renderer.GetPass()
    several = window is not None and window.GetMultiSamples() > 1
    return several or bool(renderer.GetUseFXAA()) or (passes is not None and bool(passes.IsA("vtkSSAAPass")))


def _lighting(renderer: Any, drawn: list[Drawn], camera: Camera) -> tuple[str, tuple[Lamp, ...]]:
    """Return the option `lighting`, and the lights of the scene, if it needs any."""
    if not any(each.lit for each in drawn):
        return "none", ()
    lights = list(renderer.GetLights())
    simple = all(each.lit and not any(own.finish for own in each.scene.materials) for each in drawn)
    automatic = not lights and renderer.GetAutomaticLightCreation()  # VTK then adds a headlight
    if automatic or (simple and is_headlight(lights)):
        return "headlight", ()
    corners = np.concatenate([each.scene.bounds for each in drawn])
    center = (corners.min(axis=0) + corners.max(axis=0)) / 2
    return "scene", lamps(lights, camera, center, any(each.shiny for each in drawn))
