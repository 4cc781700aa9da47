"""The guard: lets nobody in who does not belong, and no message through that is not one of ours. An ASGI middleware.

- The address has a random token. Without it there is no page and no socket.
- `Host` must be an address, `localhost`, or the name that the server was told. So a name that someone points at this
  machine (DNS rebinding) leads nowhere.
- A socket's `Origin` must be the page itself. So another page's script cannot open one.
- Messages are bounded in size and rate, and each field is checked. A wrong one closes the socket that it came from.
"""

from __future__ import annotations

import hmac
import ipaddress
import json
import re
import time
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from typing import Any
from urllib.parse import urlsplit

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

MOST_BYTES = 4096
"""The most bytes of a message from a page."""

MOST_CLIENTS = 16
"""The most pages that look on at a time."""

RATE, BURST = 500.0, 1000.0
"""Messages a second that a page may send, and how many more at once. A hand that moves makes about 100."""

MOST_SIDE, MOST_PIXELS = 16384, 1 << 25
"""The most pixels on a side of a page's picture, and in all of it."""

WRONG_MESSAGE, TRY_LATER = 1008, 1013
"""Codes that a socket is closed with (RFC 6455 and its registry)."""

HEADERS = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}
"""Headers of every answer: nothing is loaded from elsewhere, nothing is framed, and the address is told to nobody."""


class WrongMessage(ValueError):
    """A message that no page of ours sends."""


class Guard:
    """Wraps an ASGI app. token: is part of the path. host: a name that the server is also reached by, or ""."""

    def __init__(self, app: App, token: str, host: str = "") -> None:
        self._app, self._token, self._host = app, token, host.lower()
        self._clients = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        kind = scope["type"]
        if kind == "http":
            await self._page(scope, receive, send)
        elif kind == "websocket":
            await self._socket(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _page(self, scope: Scope, receive: Receive, send: Send) -> None:
        name = self._name(scope["path"])
        if not self._is_host(header(scope, "host")):
            await answer(send, 403, "Wrong host: open the address that clpeel printed.")
        elif name is None:
            await answer(send, 403, "Wrong address: open the one that clpeel printed, to its last letter.")
        elif scope["method"] not in ("GET", "HEAD"):
            await answer(send, 405, "Wrong method: expected GET.")
        elif scope["path"] == f"/{self._token}":
            await answer(send, 307, "", {"location": f"/{self._token}/"})
        else:
            await self._app({**scope, "path": f"/{name}"}, receive, with_headers(send, scope["method"] == "HEAD"))

    async def _socket(self, scope: Scope, receive: Receive, send: Send) -> None:
        host, origin = header(scope, "host"), header(scope, "origin")
        if self._name(scope["path"]) is None or not self._is_host(host) or not is_own(origin, host):
            await receive()
            await send({"type": "websocket.close", "code": WRONG_MESSAGE})  # before `accept`, so the answer is 403
            return
        if self._clients >= MOST_CLIENTS:
            await receive()
            await send({"type": "websocket.accept"})
            text = f"at most {MOST_CLIENTS} pages look on at a time"
            await send({"type": "websocket.close", "code": TRY_LATER, "reason": text})
            return
        self._clients += 1
        try:
            socket = _Socket(receive, send)
            await self._app({**scope, "path": "/"}, socket.receive, socket.send)
        finally:
            self._clients -= 1

    def _name(self, path: str) -> str | None:
        """Return what follows the token in the path, or None if the token is wrong."""
        parts = path.split("/")
        if len(parts) not in (2, 3) or parts[0]:
            return None
        if not hmac.compare_digest(parts[1].encode(), self._token.encode()):
            return None
        return parts[2] if len(parts) == 3 else ""

    def _is_host(self, host: str) -> bool:
        """Return whether this server may be called so: by an address, as `localhost`, or by the name it was told."""
        found = re.fullmatch(r"(\[[0-9a-fA-F:.]+\]|[^:\[\]]+)(:\d{1,5})?", host)
        if found is None:
            return False
        name = found[1].lower()
        if name in ("localhost", self._host):
            return True
        try:
            ipaddress.ip_address(name.strip("[]"))
        except ValueError:
            return False
        return True


class _Socket:
    """A page's socket. What it sends is checked."""

    def __init__(self, receive: Receive, send: Send) -> None:
        self._receive, self._send = receive, send
        self._sent = self._confirmed = 0
        self._allowed, self._counted = BURST, time.monotonic()
        self._closed = False

    async def receive(self) -> Message:
        event = await self._receive()
        if event["type"] != "websocket.receive" or self._closed:
            return event
        try:
            self._count()
            self._check(event)
        except WrongMessage as wrong:
            self._closed = True
            await self._send({"type": "websocket.close", "code": WRONG_MESSAGE, "reason": str(wrong)[:100]})
            return {"type": "websocket.disconnect", "code": WRONG_MESSAGE}
        return event

    async def send(self, message: Message) -> None:
        if self._closed:
            return
        if message["type"] == "websocket.send" and message.get("bytes") is not None:
            self._sent += 1
        await self._send(message)

    def _count(self) -> None:
        now = time.monotonic()
        self._allowed = min(self._allowed + (now - self._counted) * RATE, BURST) - 1
        self._counted = now
        if self._allowed < 0:
            raise WrongMessage(f"expected at most {RATE:g} messages a second, got more")

    def _check(self, event: Message) -> None:
        text = event.get("text")
        if text is None:
            raise WrongMessage("expected text, got bytes")
        message = checked_message(text)
        if message["type"] == "_framefeedback":
            index = message["index"]
            if not self._confirmed < index <= self._sent:
                raise WrongMessage(f"index: expected a frame that was sent, got {index}")
            self._confirmed = index


def checked_message(text: str) -> dict[str, Any]:
    """Return a page's message, or raise WrongMessage. Each of its fields has been checked, and there is no other."""
    if len(text.encode("utf-8", "replace")) > MOST_BYTES:
        raise WrongMessage(f"expected at most {MOST_BYTES} bytes, got more")
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        raise WrongMessage("expected JSON, got something else") from None
    kind = message.get("type") if isinstance(message, dict) else None
    fields = FIELDS.get(kind) if isinstance(kind, str) else None
    if fields is None:
        raise WrongMessage("type: expected one that a page sends, got another")
    if message.keys() != fields.keys() | {"type"}:
        raise WrongMessage(f"{kind}: expected {', '.join(sorted(fields))}; got other fields")
    for name, is_right in fields.items():
        if not is_right(message[name]):
            raise WrongMessage(f"{kind}: {name} is wrong")
    if kind == "resize" and message["pwidth"] * message["pheight"] > MOST_PIXELS:
        raise WrongMessage(f"resize: expected at most {MOST_PIXELS} pixels, got more")
    return message


# --- fields -----------------------------------------------------------------------------------------------------------

Check = Callable[[Any], bool]


def number(low: float, high: float) -> Check:
    """Return the check of a number low..high. NaN is none, and infinity lies outside."""
    return lambda value: type(value) in (int, float) and low <= value <= high


def whole(low: int, high: int) -> Check:
    """Return the check of a whole number low..high."""
    return lambda value: type(value) is int and low <= value <= high


def _is_key(value: Any) -> bool:
    return type(value) is str and 1 <= len(value) <= 32


def _are_modifiers(value: Any) -> bool:
    known = ("Alt", "Control", "Meta", "Shift")
    return (
        type(value) is list and len(value) <= len(known) and all(type(each) is str and each in known for each in value)
    )


def _are_buttons(value: Any) -> bool:
    return type(value) is list and len(value) <= 6 and all(whole(0, 8)(each) for each in value)


def _is_setting(value: Any) -> bool:
    """Numbers, texts and the like, and a colour's three numbers. What they mean is checked where they are set."""
    if type(value) is list:
        return len(value) == 3 and all(number(0, 1)(each) for each in value)
    return value is None or type(value) is bool or number(-1e9, 1e9)(value) or (type(value) is str and len(value) <= 64)


PLACE = number(-1e6, 1e6)
TIME = number(0, 1e12)
POINTER: Mapping[str, Check] = {
    "x": PLACE,
    "y": PLACE,
    "button": whole(0, 8),
    "buttons": _are_buttons,
    "modifiers": _are_modifiers,
    "timestamp": TIME,
    "ntouches": whole(0, 0),
    "touches": lambda value: value == {},
}
KEY: Mapping[str, Check] = {"key": _is_key, "modifiers": _are_modifiers, "timestamp": TIME}

FIELDS: Mapping[str, Mapping[str, Check]] = {
    "resize": {
        "width": number(1, MOST_SIDE),
        "height": number(1, MOST_SIDE),
        "pwidth": whole(1, MOST_SIDE),
        "pheight": whole(1, MOST_SIDE),
        "ratio": number(0.05, 20),
        "timestamp": TIME,
    },
    **{f"pointer_{name}": POINTER for name in ("down", "up", "move", "enter", "leave")},
    "double_click": {name: check for name, check in POINTER.items() if name not in ("ntouches", "touches")},
    "wheel": {
        "x": PLACE,
        "y": PLACE,
        "dx": PLACE,
        "dy": PLACE,
        "buttons": _are_buttons,
        "modifiers": _are_modifiers,
        "timestamp": TIME,
    },
    "key_down": KEY,
    "key_up": KEY,
    **{name: {"timestamp": TIME} for name in ("focus_in", "focus_out", "show", "hide")},
    "_framefeedback": {"index": whole(1, 1 << 53), "timestamp": TIME, "localtime": TIME},
    "set": {"name": _is_key, "value": _is_setting, "timestamp": TIME},
}
"""The fields of every message that a page sends: those of renderview's events, of its feedback, and of the panel."""


# --- HTTP -------------------------------------------------------------------------------------------------------------


def header(scope: Scope, name: str) -> str:
    """Return a request's header, or "" if it has none or several."""
    found = [value.decode("latin-1") for key, value in scope["headers"] if key.lower() == name.encode()]
    return found[0] if len(found) == 1 else ""


def is_own(origin: str, host: str) -> bool:
    """Return whether the origin of a socket is the page that this host serves."""
    try:
        parts = urlsplit(origin)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and parts.netloc.lower() == host.lower() and bool(host)


async def answer(send: Send, status: int, text: str, headers: Mapping[str, str] | None = None) -> None:
    """Answer a request with a line of text."""
    own = {"content-type": "text/plain; charset=utf-8", **HEADERS, **(headers or {})}
    pairs = [(name.encode(), value.encode()) for name, value in own.items()]
    await send({"type": "http.response.start", "status": status, "headers": pairs})
    await send({"type": "http.response.body", "body": f"{text}\n".encode()})


def with_headers(send: Send, head: bool) -> Send:
    """Return `send` with HEADERS in each answer. head: whether the answer has no body."""

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            own = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
            message = {**message, "headers": [*message.get("headers", ()), *own]}
        elif head and message["type"] == "http.response.body":
            message = {**message, "body": b""}
        await send(message)

    return sending
