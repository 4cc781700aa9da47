"""The browser's screen: rendercanvas's canvas over HTTP, with a page of ours, served by uvicorn on this machine alone.

What goes between page and server is rendercanvas's protocol (renderview's events, frames and their feedback), with two
additions: a frame's message has the `status`, and the panel sends `set`. Times of events are by the page's clock. The
status's `seen` is the time of the latest event whose effect the frame shows.
"""

from __future__ import annotations

import asyncio
import io
import json
import secrets
import socket
import sys
import threading
import time
import webbrowser
from collections.abc import Callable
from importlib.resources import files
from typing import Any

import numpy as np
import simplejpeg
import uvicorn
from numpy.typing import NDArray
from PIL import Image
from rendercanvas import http

from clpeel.errors import InputError
from clpeel.viewer.guard import MOST_BYTES, Guard
from clpeel.viewer.painter import Frame
from clpeel.viewer.status import description
from clpeel.viewer.view import View
from clpeel.viewer.viewer import Viewer

QUALITY = 85
"""JPEG quality of frames while something moves. What rests is lossless."""

IN_FLIGHT = 2
"""Frames that a page may not have confirmed yet: one on its way, and one that is drawn meanwhile. More would wait."""

SWITCH = 5e-4
"""Seconds after which threads take turns in Python, so that events do not wait for the painter's own work."""

TYPES = {"html": "text/html; charset=utf-8", "css": "text/css; charset=utf-8", "js": "text/javascript; charset=utf-8"}


class BrowserCanvas(http.HttpRenderCanvas):  # type: ignore[misc]
    """rendercanvas's canvas for browsers, whose frames are drawn and encoded elsewhere than in the event loop."""

    _max_buffered_frames = IN_FLIGHT

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._hidden: set[int] = set()
        self._fresh: tuple[dict[str, Any], bytes] | None = None  # the newest message and picture, not yet taken
        self._slot = threading.Lock()
        self._events_loop: asyncio.AbstractEventLoop | None = None
        self._encoder = _Encoder(self._deliver)
        super().__init__(update_mode="manual", max_fps=1, title=None)
        viewer.open(self)
        viewer.set_ready(False)

    def start(self) -> None:
        """Begin to send frames, from the event loop that runs now."""
        self._events_loop = asyncio.get_running_loop()

    # --- in the painter's and the encoder's threads -------------------------------------------------------------------

    def present(self, frame: Frame, status: dict[str, Any]) -> None:
        """Encode a frame and send it: at once as JPEG, and as PNG when it is full and nothing newer has come."""
        self._encoder.take(frame, status)

    def save(self, view: View) -> str:
        """Do nothing: the page saves its lossless picture itself."""
        return ""

    def toggle(self, what: str) -> None:
        """Do nothing: each page shows and hides its own panel and help."""

    def _deliver(self, data: bytes, mimetype: str, status: dict[str, Any]) -> None:
        message = {
            "type": "framebufferdata",
            "nbuffers": 1,
            "mimetype": mimetype,
            "timestamp": time.time(),
            "index": 0,
            "status": {**status, "lossless": mimetype == "image/png"},
        }
        with self._slot:
            waiting, self._fresh = self._fresh is not None, (message, data)
        if not waiting and self._events_loop is not None and not self._events_loop.is_closed():
            self._events_loop.call_soon_threadsafe(self._take_fresh)

    # --- in the event loop --------------------------------------------------------------------------------------------

    def _take_fresh(self) -> None:
        with self._slot:
            fresh, self._fresh = self._fresh, None
        if fresh is not None:
            message, data = fresh
            self._last_frame = message, [data]
            self._ref_index += 1
            self._maybe_draw()

    def _maybe_draw(self) -> None:
        """Send the latest frame to each page that can take it, and let the painter go on if the first one can."""
        self._pending_maybe_draw = False
        self._send_last_frame_to_ready_clients()
        watching = [id for id in self._frame_info_per_client if id not in self._hidden]
        leader = self._active_client if self._active_client in watching else next(iter(watching), None)
        info = self._frame_info_per_client.get(leader)
        self._viewer.set_ready(info is not None and info["sent"] - info["confirmed"] < IN_FLIGHT)

    def _on_event(self, event: dict[str, Any], id: int) -> None:
        """Take an event of a page. Those of the first page steer; the guard has checked all of them."""
        kind = event["type"]
        if kind.startswith("_"):
            super()._on_event(event, id)
            self._hidden &= set(self._frame_info_per_client)
        elif kind in ("show", "hide"):
            (self._hidden.add if kind == "hide" else self._hidden.discard)(id)
            self._maybe_draw()
        elif id != self._active_client:
            return
        elif kind == "resize":
            self._viewer.resize((event["width"], event["height"]), (event["pwidth"], event["pheight"]))
        elif kind == "set":
            self._viewer.set(event["name"], event["value"], event["timestamp"])
        else:
            self._viewer.handle({**event, "event_type": kind})


class _Encoder:
    """Turns frames into files, in the painter's thread while something moves, and in a thread of its own for PNG."""

    def __init__(self, deliver: Callable[[bytes, str, dict[str, Any]], None]) -> None:
        self._deliver = deliver
        self._latest: Frame | None = None
        self._status: dict[str, Any] = {}
        self._file: tuple[bytes, str] | None = None  # of the latest frame
        self._work = threading.Condition()
        threading.Thread(target=self._run, name="clpeel encoder", daemon=True).start()

    def take(self, frame: Frame, status: dict[str, Any]) -> None:
        """Encode and deliver a frame, or deliver the latest one once more with another status."""
        with self._work:
            again = self._latest is not None and frame.image is self._latest.image
            file = self._file if again else None
        if file is None:
            file = jpeg(frame.image), "image/jpeg"
        with self._work:
            self._latest, self._status = frame, status
            self._file = file
            self._deliver(*file, status)
            if frame.full and file[1] != "image/png":
                self._work.notify()

    def _run(self) -> None:
        while True:
            with self._work:
                while (
                    self._latest is None or not self._latest.full or self._file is None or self._file[1] != "image/jpeg"
                ):
                    self._work.wait()
                frame = self._latest
            data = png(frame.image)
            with self._work:
                if self._latest is not None and self._latest.image is frame.image and self._latest.full:
                    self._file = data, "image/png"
                    self._deliver(data, "image/png", self._status)


def jpeg(image: NDArray[np.uint8]) -> bytes:
    """Return uint8 [height, width, 4] as the bytes of a JPEG. What is transparent is put over grey."""
    if not (image[..., 3] == 255).all():
        alpha = image[..., 3:].astype(np.uint16)
        image = np.concatenate(
            [((image[..., :3] * alpha + 128 * (255 - alpha)) // 255).astype(np.uint8), image[..., 3:]], -1
        )
    data: bytes = simplejpeg.encode_jpeg(
        np.ascontiguousarray(image), quality=QUALITY, colorspace="RGBA", colorsubsampling="420", fastdct=True
    )
    return data


def png(image: NDArray[np.uint8]) -> bytes:
    """Return uint8 [height, width, 4] as the bytes of a PNG, made fast rather than small."""
    opaque = bool((image[..., 3] == 255).all())
    data = io.BytesIO()
    Image.fromarray(image[..., :3] if opaque else image).save(data, "PNG", compress_level=1)
    return data.getvalue()


# --- the server -------------------------------------------------------------------------------------------------------


def resources(title: str) -> dict[str, tuple[str, str]]:
    """Return everything that is served, by name: its type and its text. There is nothing else."""
    found = {}
    page = files("clpeel.viewer") / "page"
    for each in page.iterdir():
        kind = each.name.rpartition(".")[2]
        if kind in TYPES:
            found[each.name] = TYPES[kind], each.read_text("utf-8")
    found["renderview.js"] = http.resources["renderview.js"]
    found["viewer.json"] = "application/json", json.dumps({"title": title, **description()})
    return found


class Server:
    """Serves a viewer's page. address: what to open. It has the token that lets in."""

    def __init__(self, viewer: Viewer, title: str, host: str = "127.0.0.1", port: int = 0) -> None:
        """Raises InputError if the host is no address of this machine, or if the port is taken."""
        try:
            family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
            self._socket = socket.create_server((host, port), family=family)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise InputError(f"--host {host}, --port {port}: expected a free port of this machine: {reason}") from None
        token = secrets.token_urlsafe(24)
        self.port: int = self._socket.getsockname()[1]
        name = {"0.0.0.0": "127.0.0.1", "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)
        self.address = f"http://{name}:{self.port}/{token}/"
        own = resources(title)
        self._canvas = BrowserCanvas(viewer)
        http.asgi._resources = own
        http.loop._BaseLoop__hook_data = None, {}  # else it takes Ctrl-C for itself, and the server does not end
        config = uvicorn.Config(
            self._app(Guard(http.asgi, token, host)),
            log_level="warning",
            access_log=False,
            server_header=False,
            ws_max_size=MOST_BYTES,
            ws_per_message_deflate=False,
            ws="websockets-sansio",
            timeout_graceful_shutdown=1,
            limit_concurrency=100,
        )
        self._server = uvicorn.Server(config)

    def _app(self, app: Guard) -> Any:
        async def started(scope: Any, receive: Any, send: Any) -> None:
            if scope["type"] == "lifespan":
                self._canvas.start()
                self._on_start()
            await app(scope, receive, send)

        return started

    def run(self, on_start: Callable[[], None] = lambda: None) -> None:
        """Serve until Ctrl-C, or until `stop`. on_start: called once signals are taken care of and pages can come."""
        self._on_start = on_start
        self._server.run(sockets=[self._socket])

    def stop(self) -> None:
        """End `run`, from any thread."""
        self._server.should_exit = True


def serve(viewer: Viewer, title: str, host: str, port: int, open_page: bool, say: Callable[[str], None]) -> None:
    """Serve the viewer's page until Ctrl-C. open_page: also open it in the user's browser."""
    server = Server(viewer, title, host, port)
    sys.setswitchinterval(SWITCH)

    def started() -> None:
        say(f"open {server.address} (Ctrl-C ends)")
        if open_page:
            threading.Thread(target=webbrowser.open, args=(server.address,), daemon=True).start()

    try:
        server.run(started)
    except KeyboardInterrupt:
        pass
    finally:
        viewer.close()
