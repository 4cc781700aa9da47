"""`clpeel.show`: shows anything at once, as a picture or live in a notebook, and in a window elsewhere."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from clpeel.checks import GivenBackground
from clpeel.errors import InputError
from clpeel.rendering.keywords import Keywords
from clpeel.rendering.options import Lighting, Size, default_lighting
from clpeel.rendering.request import checked_options
from clpeel.scene.camera import GivenCamera
from clpeel.scene.scalars import Mapped
from clpeel.viewer.open import EXTRA, Backend, check_packages, has_display, in_notebook, missing

if TYPE_CHECKING:
    from typing import Unpack

    from numpy.typing import ArrayLike

    from clpeel.rendering.result import Result
    from clpeel.scene.scene import Scene

SIZE: Size = (800, 600)
"""The size of a picture in a notebook, unless another is asked for."""

SAVE = "clpeel.render(scene).save('picture.png') makes a picture"


class LoadOptions(Mapped, total=False):
    """The options of `clpeel.load`."""

    opacity: float | str | ArrayLike | None
    color: ArrayLike | str | None
    drop_duplicates: bool
    animation_index: int | None
    animation_time: float | None
    scalars: str | ArrayLike | None


class RenderOptions(Keywords, total=False):
    """The options of `clpeel.render`."""

    camera: GivenCamera | None
    size: Size
    technique: str
    background: GivenBackground
    lighting: Lighting | None
    device: int | str | None
    lanes: int | None


class ShowOptions(LoadOptions, RenderOptions, total=False):
    """The options of both, which are told apart by their names."""


def show(
    *things: Any,
    live: bool | None = None,
    bar: bool | None = None,
    title: str = "clpeel",
    **options: Unpack[ShowOptions],
) -> Any:
    """Show anything at once.

        clpeel.show("part.stl", opacity=0.4)
        clpeel.show(mesh, scalars="height", cmap="viridis", camera="iso")

    things: all that `clpeel.load` takes, one or several, also as a list: names of files, meshes of other libraries,
    Scenes; or a PyVista plotter, a Result, or Layers. options: those of `clpeel.load` and of `clpeel.render`.

    In a notebook, the picture is displayed at once, wherever in a cell this is called, and its Result is returned. With
    live=True it is the widget of `clpeel.view`, which needs the extra `view`. Elsewhere, the scene is shown in the
    window of `clpeel.view`, and None is returned when that is closed. bar: whether the picture has scale bars; by
    default if the scene is coloured by numbers. title: of the window.

    Raises InputError if there is nowhere to show it, or for an option that neither of the two has.
    """
    given = [each for thing in things for each in (thing if isinstance(thing, list | tuple) else [thing])]
    if not given:
        raise InputError("show: expected something to show, got nothing")
    of_load, of_render = told_apart(options)
    notebook = in_notebook()
    if is_made(given):
        return _show_made(given, {**options, **({} if live is None else {"live": live})}, notebook)
    live = not notebook if live is None else live
    check_place(live, notebook)
    if bar and live:
        raise InputError("bar: expected live=False with it, as a live view shows no scale bars")
    own = {name: value for name, value in of_render.items() if name not in ("camera", "technique", "device", "lanes")}
    checked_options(of_render.get("technique", "sort"), own)  # before anything is read
    scene, of_plotter = _scene_of(given, of_load)
    of_render = {**of_plotter, **of_render}
    if live:
        return _live(scene, of_render, title, notebook)
    return displayed(_still(scene, of_render, bar))


# --- options ----------------------------------------------------------------------------------------------------------


def told_apart(options: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the options of `load` and those of `render`. Raises InputError if one is of neither."""
    found: tuple[dict[str, Any], dict[str, Any]] = ({}, {})
    owners = (LoadOptions.__annotations__, RenderOptions.__annotations__)
    for name, value in options.items():
        own = [part for part, owner in zip(found, owners, strict=True) if name in owner]
        if not own:
            known = [*owners[0], *owners[1], "live", "bar", "title"]
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"did you mean {close[0]}?" if close else "it has those of clpeel.load and of clpeel.render"
            raise InputError(f"{name}: show has no such option; {hint}")
        own[0][name] = value
    return found


# --- where to show it -------------------------------------------------------------------------------------------------


def check_place(live: bool, notebook: bool) -> None:
    """Raise InputError if there is nowhere to show a scene."""
    if notebook:
        if live:
            check_packages("notebook")
        return
    if not live:
        raise InputError(f"live: expected True outside of notebooks, as only a window shows something there; {SAVE}")
    if not has_display():
        raise InputError(f"show: expected a notebook, or a display for a window, got neither; {SAVE}")
    lacking = missing("window")
    if lacking:
        raise InputError(f"show: expected {' and '.join(lacking)} for a window, got none: {EXTRA}; or {SAVE}")


# --- what to show -----------------------------------------------------------------------------------------------------


def is_made(things: Sequence[Any]) -> bool:
    """Return whether there is a single thing that is a Result, or Layers."""
    from clpeel.pictures.layers import Layers
    from clpeel.rendering.result import Result

    return len(things) == 1 and isinstance(things[0], Result | Layers)


def _show_made(things: Sequence[Any], options: Mapping[str, Any], notebook: bool) -> Any:
    """Display a Result, or what Layers show together, and return it."""
    (made,) = things
    name = type(made).__name__
    wrong = [each for each in options if name == "Result" or each != "background"]
    if wrong:
        raise InputError(f"{wrong[0]}: expected no such option for {name}, which is drawn already")
    if not notebook:
        raise InputError(
            "show: expected a notebook for a picture, got none; result.save('picture.png') writes it"
            if name == "Result"
            else "show: expected a notebook for layers, got none; clpeel.view(scene) shows a scene in a window"
        )
    if name == "Result":
        return displayed(made)
    from IPython.display import Image, display

    from clpeel.pictures.png import encode_png

    display(Image(data=encode_png(made.composite(options.get("background", "white")))))
    return made


def _scene_of(things: Sequence[Any], of_load: dict[str, Any]) -> tuple[Scene, dict[str, Any]]:
    """Return the scene, and what a plotter says of its picture."""
    from clpeel.reading.from_pyvista import from_pyvista
    from clpeel.reading.load import load

    if len(things) > 1 or not hasattr(things[0], "renderers"):
        return load(*things, **of_load), {}
    scene, camera, options = from_pyvista(things[0])
    return load(scene, **of_load) if of_load else scene, {**options, "camera": camera}


def _still(scene: Scene, options: dict[str, Any], bar: bool | None) -> Result:
    """Return the picture of a scene, with its scale bars."""
    from clpeel.rendering.renderer import render

    result = render(scene, **{"size": SIZE, **options})
    wanted = bool(scene.color_maps) and options.get("keep_color", True) if bar is None else bar
    return result.with_bar(*scene.color_maps) if wanted else result


def _live(scene: Scene, options: dict[str, Any], title: str, notebook: bool) -> Any:
    """Show a scene live. Returns the widget in a notebook, and elsewhere None once the window is closed."""
    from clpeel.viewer.open import view

    lighting = options.get("lighting") or default_lighting(bool(scene.lights))
    backend: Backend = "notebook" if notebook else "window"
    shown = view(scene, **{**options, "lighting": lighting}, title=title, backend=backend)
    return displayed(shown) if notebook else shown


def displayed(thing: Any) -> Any:
    """Display a thing in a notebook, and return it.

    If it is also the last line of the cell, the notebook would display it once more. It does not do so in this cell.
    """
    from IPython import get_ipython
    from IPython.display import display

    display(thing)
    # IPython asks an object for this before it asks its class. A Result is frozen, and a widget is not.
    object.__setattr__(thing, "_ipython_display_", partial(_display_again, thing, get_ipython().execution_count))
    return thing


def _display_again(thing: Any, cell: int) -> None:
    """Display a thing that was displayed in a cell, unless this is the same one."""
    from IPython import get_ipython
    from IPython.display import display

    if get_ipython().execution_count != cell:
        object.__delattr__(thing, "_ipython_display_")
        display(thing)
