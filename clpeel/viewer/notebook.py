"""The notebook's screen: rendercanvas's canvas for anywidget, beside widgets for the settings."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from clpeel.errors import ClpeelError
from clpeel.pictures.png import encode_png
from clpeel.rendering.options import Size
from clpeel.scene.camera import Camera
from clpeel.viewer.bitmap import EVENTS, BitmapScreen
from clpeel.viewer.controls import BACKGROUNDS, OPACITY_STEP
from clpeel.viewer.open import in_notebook, missing
from clpeel.viewer.panel import MAX_ERRORS, is_live, text_of, what_never_changes
from clpeel.viewer.status import LABELS, settings
from clpeel.viewer.view import View
from clpeel.viewer.viewer import Viewer

if TYPE_CHECKING:
    from clpeel.scene.scene import Scene

MOST_FPS = 60
"""How often in a second frames are sent, if the notebook keeps up."""

SIZE = (580, 435)
"""The size of the widget that shows a scene, and of the picture that stands for it where there are no widgets."""

WIDTH = 280
"""The width of the widget of a setting, in logical pixels."""

ON_OR_OFF = ("occlusion_query", "orthographic", "turning")
"""Settings that are on or off."""

COUNTS = {"passes": 0, "layers_per_pass": 1}
"""Settings that are whole numbers, with the least one. 0 stands for no limit."""


def widget(viewer: Viewer, size: Size) -> Any:
    """Return the widget that shows the viewer. Closing it ends the viewer. size: (width, height) in logical pixels."""
    import ipywidgets
    from rendercanvas.anywidget import RenderCanvas, loop

    class Canvas(RenderCanvas):  # type: ignore[misc]
        """rendercanvas's canvas, whose `close` calls itself without end in version 2.7.2."""

        _closing = False

        def close(self) -> None:
            if not self._closing:
                self._closing = True
                super().close()

    canvas = Canvas(size=size, update_mode="ondemand", max_fps=MOST_FPS)
    panel = Panel(viewer)
    said = ipywidgets.HTML()
    screen = NotebookScreen(viewer, canvas, loop, panel)
    canvas.add_event_handler(screen.handle, *EVENTS)
    viewer.say = viewer.warn = lambda text: loop.call_soon_threadsafe(said.set_trait, "value", as_html(text))

    class LiveView(ipywidgets.VBox):  # type: ignore[misc]
        """The canvas, the panel and what was said last. `close` closes all of them, and ends the viewer."""

        def close(self) -> None:
            canvas.close()
            for each in (*panel.widgets.values(), panel.box, said, row):
                each.close()
            super().close()

    row = ipywidgets.HBox([canvas, panel.box], layout=ipywidgets.Layout(flex_flow="row wrap"))
    return LiveView([row, said])


def as_html(text: str) -> str:
    """Return a line of text as HTML that can be copied, and that is broken where it is too long."""
    return f'<code style="white-space: pre-wrap; overflow-wrap: anywhere">{html.escape(text)}</code>'


class NotebookScreen(BitmapScreen):
    """A screen whose panel are widgets."""

    def __init__(self, viewer: Viewer, canvas: Any, loop: Any, panel: Panel) -> None:
        super().__init__(viewer, canvas, loop)
        self._panel = panel

    def toggle(self, what: str) -> None:
        """Show or hide the "panel" or the "help"."""
        if what == "panel":
            self._panel.toggle()
        else:
            super().toggle(what)

    def _draw(self) -> None:
        self._panel.follow()
        super()._draw()


class Panel:
    """Widgets for the settings. What the user changes there goes to the viewer, and what else changes comes back.

    widgets: by the name of the setting. box: has all of them. All methods are called in the loop's thread.
    """

    def __init__(self, viewer: Viewer) -> None:
        import ipywidgets

        self._viewer = viewer
        self._following = False  # whether the widgets are set to the view's settings now
        self._view: View | None = None  # whose settings they have
        chosen = [name for name in LABELS if name not in ON_OR_OFF and name not in COUNTS]
        self._named = {name: {text_of(name, each): each for each in values_of(name)} for name in chosen}
        self.widgets: dict[str, Any] = {name: made(name, self._named.get(name, ())) for name in LABELS}
        for name, each in self.widgets.items():
            each.observe(lambda change, name=name: self._changed(name, change["new"]), "value")
        # One column beside the canvas, or where there is no room, several below it.
        columns = f"repeat(auto-fill, {WIDTH}px)"
        layout = ipywidgets.Layout(flex=f"1 1 {WIDTH}px", grid_template_columns=columns, align_content="flex-start")
        self.box = ipywidgets.GridBox(list(self.widgets.values()), layout=layout)
        self.follow()

    def toggle(self) -> None:
        """Show or hide the panel."""
        self.box.layout.display = None if self.box.layout.display == "none" else "none"

    def follow(self) -> None:
        """Set the widgets to what the view is now."""
        view = self._viewer.view
        if view is self._view:
            return
        self._view, self._following = view, True
        try:
            values = settings(view)
            for name, each in self.widgets.items():
                each.disabled = not is_live(name, values)
                self._show(name, values[name])
        finally:
            self._following = False

    def _show(self, name: str, value: Any) -> None:
        """Set a widget to a value. If it is none of those to choose from, it is added."""
        each = self.widgets[name]
        if name in self._named:
            text = text_of(name, value)
            if text not in each.options:
                self._named[name][text] = value
                each.options = tuple(sorted(self._named[name], key=lambda text: order(self._named[name][text])))
            each.value = text
        else:
            each.value = (value or 0) if name in COUNTS else value

    def _changed(self, name: str, shown: Any) -> None:
        if self._following:
            return
        if name in self._named:
            shown = self._named[name][shown]
        self._viewer.set(name, (shown or None) if name in COUNTS else shown)
        self._view = None  # as the viewer may have refused the value
        self.follow()


def made(name: str, texts: Iterable[str] = ()) -> Any:
    """Return a new widget for a setting. texts: what there is to choose from."""
    import ipywidgets

    common = {
        "description": LABELS[name] + (" (0: all)" if name == "passes" else ""),
        "layout": ipywidgets.Layout(width=f"{WIDTH}px", margin="0"),
        "style": {"description_width": f"{WIDTH * 2 // 5}px"},
    }
    if name in ON_OR_OFF:
        return ipywidgets.Checkbox(**common)
    if name in COUNTS:
        return ipywidgets.BoundedIntText(min=COUNTS[name], max=2**31 - 1, **common)
    kind = ipywidgets.SelectionSlider if name == "opacity" else ipywidgets.Dropdown
    return kind(options=tuple(texts), **common)


def values_of(name: str) -> list[Any]:
    """Return the values to choose from for a setting."""
    if name == "opacity":
        return [None, *(round(step * OPACITY_STEP, 2) for step in range(round(1 / OPACITY_STEP) + 1))]
    if name == "background":
        return [*BACKGROUNDS, None]
    return list(MAX_ERRORS if name == "max_error" else what_never_changes()["choices"][name])


def order(value: Any) -> float:
    """Return where a value belongs among those to choose from, if they are numbers. Others stay in their order."""
    return float(value) if isinstance(value, int | float) else -1.0


# --- what a notebook shows of a scene ---------------------------------------------------------------------------------


def bundle(scene: Scene) -> dict[str, Any] | None:
    """Return what a notebook shows of a scene: the live widget, a picture for where no widgets are, and a text.

    It is by MIME type. None outside of notebooks.
    """
    if not in_notebook():
        return None
    found = {"text/plain": repr(scene)}
    camera = Camera.frame(scene, aspect=SIZE[0] / SIZE[1])
    try:
        viewer = Viewer(scene, View(camera, SIZE))
        still = viewer.renderer.render(camera, SIZE)
    except ClpeelError as error:
        found["text/plain"] += f"\nno picture: {error}"
        return found
    found["image/png"] = base64.b64encode(encode_png(still.image)).decode()
    if missing("notebook"):
        viewer.close()
    else:
        found = widget(viewer, SIZE)._repr_mimebundle_() | found
    return found
