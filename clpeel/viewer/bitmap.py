"""The screen of a window or a notebook: frames with their overlay, as bitmaps of one of rendercanvas's canvases."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from clpeel.errors import InputError
from clpeel.files import write_new
from clpeel.pictures.png import encode_png
from clpeel.rendering.options import Size
from clpeel.viewer.overlay import draw_overlay, panel_plate, setting_at, status_plate
from clpeel.viewer.painter import Frame
from clpeel.viewer.panel import KEYS_FROM_NONE, stepped
from clpeel.viewer.status import settings
from clpeel.viewer.view import View
from clpeel.viewer.viewer import Viewer

EVENTS = ("pointer_down", "pointer_move", "pointer_up", "double_click", "wheel", "key_down")
"""The events that steer."""

HINT = "H shows the keys, P the panel"
"""A notice that is shown until the user does something."""

CHECKS = 8
"""The size of the squares behind what is transparent, in pixels."""

COARSE = 8
"""How many times the pixels of an image the screen has if the image is doubled with interpolation."""

BLANK = (40, 42, 46, 255)
"""The colour of the screen before the first frame."""


class BitmapScreen:
    """Shows frames on a canvas, and takes its events.

    canvas, loop: of rendercanvas. Only their public methods are used. All methods are called in the loop's thread,
    except `present` and `save`.
    """

    def __init__(self, viewer: Viewer, canvas: Any, loop: Any) -> None:
        """Raises what rendercanvas raises if it cannot show bitmaps there."""
        self._viewer, self._canvas, self._loop = viewer, canvas, loop
        self._shown = {"help": False, "panel": False}
        self._slot = threading.RLock()
        self._latest: tuple[Frame, dict[str, Any]] | None = None
        self._closed = False
        self._saving = False
        self._hint = HINT
        self._pressed = False  # whether a button went down in the panel, and is not up again
        self._context = canvas.get_bitmap_context()
        canvas.add_event_handler(self._resized, "resize")
        canvas.add_event_handler(self._close, "close")
        canvas.request_draw(self._draw)
        viewer.open(self)

    # --- in any thread ------------------------------------------------------------------------------------------------

    def present(self, frame: Frame, status: dict[str, Any]) -> None:
        """Show a frame soon. The painter pauses until the canvas takes it."""
        with self._slot:
            if self._closed:
                return
            self._latest = frame, status
            self._viewer.set_ready(False)
            self._loop.call_soon_threadsafe(self._draw_soon)

    def save(self, view: View) -> str:
        """Save the full picture of the view under a new name in the current folder, and tell its name then."""
        if self._saving:
            return "the picture before is still being saved"
        self._saving = True

        def keep(frame: Frame | None) -> None:
            if frame is None:
                self._saving = False
            else:
                threading.Thread(target=self._write, args=(frame.image,), name="clpeel saver").start()

        self._viewer.draw(view, keep)
        return "the full picture is being saved"

    def _write(self, image: NDArray[np.uint8]) -> None:
        try:
            told = f"saved {write_new('clpeel', '.png', encode_png(image))}"
        except InputError as error:
            told = str(error)
        finally:
            self._saving = False
        self._viewer.tell(told)

    # --- in the loop's thread -----------------------------------------------------------------------------------------

    def toggle(self, what: str) -> None:
        """Show or hide the "panel" or the "help"."""
        self._shown[what] = not self._shown[what]
        self._canvas.request_draw()

    def _draw_soon(self) -> None:
        """Let the canvas draw the latest frame."""
        self._canvas.request_draw()

    def handle(self, event: Mapping[str, Any]) -> None:
        """Do what an event asks for. Those in the panel do not reach the scene."""
        if self._hint and event["event_type"] != "pointer_move":
            self._hint = ""
            self._canvas.request_draw()
        if not self._in_panel(event):
            self._viewer.handle(event)

    def _in_panel(self, event: Mapping[str, Any]) -> bool:
        """Do what an event asks of the panel. Returns whether the event is for the panel alone."""
        kind = event["event_type"]
        if self._pressed and kind in ("pointer_move", "pointer_up"):
            self._pressed = bool(event["buttons"])
            return True
        if not self._shown["panel"] or self._latest is None or kind not in ("pointer_down", "double_click", "wheel"):
            return False
        status, ratio = self._latest[1], self._canvas.get_pixel_ratio()
        plate = panel_plate(status, self._canvas.get_physical_size(), ratio)
        place = event["x"] * ratio, event["y"] * ratio
        if not plate.has(*place):
            return False
        if kind == "pointer_down":
            self._pressed = True
            clicked = setting_at(plate, status, *place)
            if clicked is not None:
                self._step(*clicked)
        return True

    def _step(self, name: str, by: int) -> None:
        """Give a setting its next or its previous value."""
        value = settings(self._viewer.view)[name]
        if value is None and name in KEYS_FROM_NONE:
            key = KEYS_FROM_NONE[name][by > 0]
            self._viewer.handle({"event_type": "key_down", "key": key, "modifiers": ()})
        else:
            self._viewer.set(name, stepped(name, value, by))

    def _resized(self, event: Mapping[str, Any]) -> None:
        size = self._canvas.get_physical_size()
        if min(size) > 0:
            self._viewer.resize((event["width"], event["height"]), size)

    def _close(self, event: Mapping[str, Any]) -> None:
        with self._slot:
            self._closed, self._latest = True, None
        # In a thread of its own, as the painter may take a while to end.
        threading.Thread(target=self._viewer.close, name="clpeel closer").start()

    def _draw(self) -> None:
        """Give the canvas what it shows from now on."""
        with self._slot:
            latest = self._latest
            self._viewer.set_ready(True)
        if latest is not None:
            frame, status = latest
            latest = frame, {**status, "notice": status["notice"] or self._hint}
        size = self._canvas.get_physical_size()
        self._context.set_bitmap(composed(latest, size, self._canvas.get_pixel_ratio(), **self._shown))


def composed(
    latest: tuple[Frame, dict[str, Any]] | None, size: Size, ratio: float, help: bool = False, panel: bool = False
) -> NDArray[np.uint8]:
    """Return a frame of any size with its overlay, as uint8 [height, width, 4], which is opaque.

    latest: the frame and its status, or None if there is no frame yet. size: (width, height) in real pixels. ratio:
    real pixels of a logical one. help, panel: whether they are shown.
    """
    if latest is None:
        image = np.full((size[1], size[0], 4), BLANK, np.uint8)
        status_plate(["the first picture is being drawn"], size, ratio).draw(image)
        return image
    frame, status = latest
    image = scaled(frame.image, size)
    if frame.view.background is None:
        image = np.array(Image.alpha_composite(_checks(size), Image.fromarray(image)))
    draw_overlay(image, status, ratio, help=help, panel=panel)
    return image


def scaled(image: NDArray[np.uint8], size: Size) -> NDArray[np.uint8]:
    """Return a copy of uint8 [height, width, 4] of another size, each pixel of which is the nearest one.

    Any interpolation takes much longer, unless the image is much smaller. It is then doubled first. size: (width,
    height).
    """
    height, width = image.shape[:2]
    if (width, height) == size:
        return image.copy()
    pixels = np.ascontiguousarray(image).view(np.uint32)[..., 0]
    if width * height * COARSE < size[0] * size[1]:
        pixels = _doubled(pixels)
    rows, columns = (
        (2 * np.arange(new) + 1) * old // (2 * new) for new, old in zip(size[::-1], pixels.shape, strict=True)
    )
    return pixels.take(columns, 1).take(rows, 0)[..., None].view(np.uint8)


def _doubled(pixels: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return uint32 [2 height, 2 width] of four bytes each, with the means of neighbours between them."""
    wide = np.repeat(pixels, 2, axis=1)
    wide[:, 1:-1:2] = _mean(pixels[:, :-1], pixels[:, 1:])
    found = np.repeat(wide, 2, axis=0)
    found[1:-1:2] = _mean(wide[:-1], wide[1:])
    return found


def _mean(one: NDArray[np.uint32], other: NDArray[np.uint32]) -> NDArray[np.uint32]:
    """Return the means of bytes, rounded down, four at a time."""
    return (one & other) + (((one ^ other) & np.uint32(0xFEFEFEFE)) >> np.uint32(1))


@lru_cache(maxsize=1)
def _checks(size: Size) -> Image.Image:
    """Return squares in two greys, RGBA."""
    y, x = np.ogrid[: size[1], : size[0]]
    light = ((x // CHECKS + y // CHECKS) % 2).astype(np.uint8)
    grey = 112 + 32 * light
    return Image.fromarray(np.stack([grey, grey, grey, np.full_like(grey, 255)], axis=-1))
