"""The guard: what a page sends comes through, and nothing else does."""

from __future__ import annotations

import asyncio
import copy
import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from clpeel.viewer import guard
from clpeel.viewer.guard import FIELDS, Guard, WrongMessage, checked_message

TOKEN = "secret-token"

RIGHT: dict[str, dict[str, Any]] = {
    "resize": {"width": 800.5, "height": 600, "pwidth": 801, "pheight": 600, "ratio": 1.25},
    "pointer_down": {
        "x": 1,
        "y": 2.5,
        "button": 1,
        "buttons": [1],
        "modifiers": ["Shift", "Control"],
        "ntouches": 0,
        "touches": {},
    },
    "double_click": {"x": 1, "y": 2, "button": 1, "buttons": [], "modifiers": []},
    "wheel": {"x": 1, "y": 2, "dx": 0, "dy": -120, "buttons": [], "modifiers": []},
    "key_down": {"key": "a", "modifiers": []},
    "hide": {},
    "_framefeedback": {"index": 1, "localtime": 1.8e9},
    "set": {"name": "opacity", "value": 0.5},
}
for each in ("pointer_up", "pointer_move", "pointer_enter", "pointer_leave"):
    RIGHT[each] = RIGHT["pointer_down"]
RIGHT["key_up"] = RIGHT["key_down"]
for each in ("show", "focus_in", "focus_out"):
    RIGHT[each] = {}


def message(kind: str) -> dict[str, Any]:
    return {"type": kind, **copy.deepcopy(RIGHT[kind]), "timestamp": 12.5}


@pytest.mark.parametrize("kind", FIELDS)
def test_each_message_of_a_page_comes_through(kind: str) -> None:
    assert checked_message(json.dumps(message(kind))) == message(kind)


@pytest.mark.parametrize("value", [None, True, 0.25, "sort", [0.1, 0.2, 1]])
def test_settings_have_simple_values(value: object) -> None:
    assert checked_message(json.dumps({**message("set"), "value": value}))["value"] == value


@pytest.mark.parametrize("kind", FIELDS)
@given(data=st.data())
def test_a_field_that_is_missing_added_or_of_another_type_is_wrong(kind: str, data: st.DataObject) -> None:
    wrong = message(kind)
    name = data.draw(st.sampled_from(sorted(FIELDS[kind])))
    what = data.draw(st.sampled_from(["missing", "added", "changed"]))
    if what == "missing":
        del wrong[name]
    elif what == "added":
        wrong["more"] = 1
    else:
        wrong[name] = {"a": [1]}
    with pytest.raises(WrongMessage):
        checked_message(json.dumps(wrong))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no JSON",
        "[]",
        "1",
        "null",
        '{"type": 1}',
        '{"type": ["hide"]}',
        '{"type": "_clients_change", "ids": [1]}',
        '{"type": "close", "timestamp": 1}',
        '{"type": "hide", "timestamp": NaN}',
        '{"type": "hide", "timestamp": 1e999}',
        '{"type": "hide", "timestamp": true}',
        '{"type": "_framefeedback", "index": 1.5, "timestamp": 1, "localtime": 1}',
        '{"type": "_framefeedback", "index": true, "timestamp": 1, "localtime": 1}',
        '{"type": "set", "name": "opacity", "value": {"a": 1}, "timestamp": 1}',
        '{"type": "set", "name": "opacity", "value": [1, 2], "timestamp": 1}',
        '{"type": "set", "name": "opacity", "value": "' + "x" * 65 + '", "timestamp": 1}',
        '{"type": "key_down", "key": "", "modifiers": [], "timestamp": 1}',
        '{"type": "key_down", "key": "a", "modifiers": ["Shift", 1], "timestamp": 1}',
        "[" * 4000,
        '{"type": "hide", "timestamp": ' + "1" * 3000 + "}",
        '{"type": "hide", "timestamp": 1, "x": "' + "y" * 5000 + '"}',
    ],
)
def test_anything_else_is_wrong(text: str) -> None:
    with pytest.raises(WrongMessage):
        checked_message(text)


def test_a_picture_of_too_many_pixels_is_wrong() -> None:
    large = {**message("resize"), "pwidth": 8192, "pheight": 8192}
    with pytest.raises(WrongMessage, match="33554432 pixels"):
        checked_message(json.dumps(large))


@given(st.text())
def test_no_text_gets_through_or_does_anything_but_raise(text: str) -> None:
    with pytest.raises(WrongMessage):
        checked_message(text)


# --- the middleware ---------------------------------------------------------------------------------------------------


class Inner:
    """The app behind the guard. It keeps what reaches it."""

    def __init__(self) -> None:
        self.paths: list[str] = []
        self.received: list[Any] = []

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        self.paths.append(scope["path"])
        if scope["type"] == "http":
            await send({"type": "http.response.start", "status": 200, "headers": [(b"content-type", b"text/html")]})
            await send({"type": "http.response.body", "body": b"page"})
            return
        await send({"type": "websocket.accept"})
        while (event := await receive())["type"] == "websocket.receive":
            self.received.append(json.loads(event["text"]))
            if self.received[-1]["type"] == "show":
                await send({"type": "websocket.send", "bytes": b"picture"})


def request(
    path: str, kind: str = "http", host: str = "127.0.0.1:80", told: str = "", **more: str
) -> tuple[Inner, list[Any]]:
    """What reaches the app, and what is answered, when this is asked for."""
    messages = more.pop("messages", "").split("\n")
    headers = {"host": host, **({"origin": f"http://{host}"} if kind == "websocket" else {}), **more}
    method = headers.pop("method", "GET")
    scope = {
        "type": kind,
        "path": path,
        "method": method,
        "headers": [(name.encode(), value.encode()) for name, value in headers.items()],
    }
    events = [{"type": "websocket.receive", "text": text} for text in messages if text]
    events = [{"type": "websocket.connect"}, *events, {"type": "websocket.disconnect", "code": 1001}]
    inner, sent = Inner(), []

    async def receive() -> Any:
        if kind == "websocket" and events[0]["type"] == "websocket.connect" and inner.paths:
            events.pop(0)
        return events.pop(0)

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(Guard(inner, TOKEN, told)(scope, receive, send))
    return inner, sent


def test_the_page_has_headers_that_keep_it_alone() -> None:
    inner, sent = request(f"/{TOKEN}/page.js")
    assert inner.paths == ["/page.js"] and sent[0]["status"] == 200
    headers = dict(sent[0]["headers"])
    assert b"default-src 'none'" in headers[b"content-security-policy"]
    assert headers[b"referrer-policy"] == b"no-referrer" and headers[b"x-frame-options"] == b"DENY"
    assert b"unsafe" not in headers[b"content-security-policy"]


@pytest.mark.parametrize(
    "path",
    ["/", "", "/wrong/", f"/{TOKEN}x/", f"/{TOKEN[:-1]}/", f"//{TOKEN}/", f"/{TOKEN}/a/b", f"/{TOKEN}/../x", "/é/"],
)
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_nobody_comes_in_without_the_token(path: str, kind: str) -> None:
    inner, sent = request(path, kind)
    assert inner.paths == []
    assert sent[0].get("status") == 403 or sent == [{"type": "websocket.close", "code": 1008}]


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "localhost.evil.example:80", "", "a b", "[::1", "127.0.0.1:99x"]
)
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_a_name_that_somebody_points_here_leads_nowhere(host: str, kind: str) -> None:
    inner, sent = request(f"/{TOKEN}/", kind, host)
    assert inner.paths == [] and sent[0].get("status", 403) == 403


@pytest.mark.parametrize(
    "host", ["127.0.0.1:80", "localhost:8080", "LOCALHOST", "[::1]:80", "192.168.0.7", "mine.example:80"]
)
@pytest.mark.parametrize("kind", ["http", "websocket"])
def test_an_address_and_the_name_that_was_told_lead_here(host: str, kind: str) -> None:
    inner, _ = request(f"/{TOKEN}/", kind, host, told="mine.example")
    assert inner.paths == ["/"]


@pytest.mark.parametrize(
    "origin",
    [
        "",
        "null",
        "http://evil.example",
        "http://127.0.0.1",
        "http://127.0.0.1:81",
        "file://",
        "http://[",
        "ws://127.0.0.1:80",
    ],
)
def test_no_script_of_another_page_opens_a_socket(origin: str) -> None:
    inner, sent = request(f"/{TOKEN}/", "websocket", origin=origin)
    assert inner.paths == [] and sent == [{"type": "websocket.close", "code": 1008}]


def test_other_methods_are_refused() -> None:
    inner, sent = request(f"/{TOKEN}/", method="POST")
    assert inner.paths == [] and sent[0]["status"] == 405


def test_a_head_has_no_body() -> None:
    _, sent = request(f"/{TOKEN}/", method="HEAD")
    assert sent[0]["status"] == 200 and sent[1]["body"] == b""


def test_the_address_without_its_last_slash_leads_to_the_page() -> None:
    _, sent = request(f"/{TOKEN}")
    assert sent[0]["status"] == 307 and dict(sent[0]["headers"])[b"location"] == f"/{TOKEN}/".encode()


def feedback(index: int) -> str:
    return json.dumps({**message("_framefeedback"), "index": index})


def test_right_messages_reach_the_app_and_a_wrong_one_closes_the_socket() -> None:
    show, key = json.dumps(message("show")), json.dumps(message("key_down"))
    inner, sent = request(f"/{TOKEN}/", "websocket", messages="\n".join([show, key, "{}", key]))
    assert [each["type"] for each in inner.received] == ["show", "key_down"]
    assert sent[-1]["type"] == "websocket.close" and sent[-1]["code"] == 1008


@pytest.mark.parametrize("indices", [[0], [2], [1, 1], [1, 3], [1, 2, 1]])
def test_only_frames_that_were_sent_are_confirmed_and_each_once(indices: list[int]) -> None:
    show = json.dumps(message("show"))  # the app answers with a picture
    inner, sent = request(
        f"/{TOKEN}/", "websocket", messages="\n".join([show, feedback(1), show, *map(feedback, indices)])
    )
    if indices[0] in (0, 1):
        assert sent[-1]["type"] == "websocket.close"
    assert [each["index"] for each in inner.received if each["type"] == "_framefeedback"][0] == 1


def test_a_flood_closes_the_socket(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(guard, "BURST", 50.0)
    monkeypatch.setattr(guard.time, "monotonic", lambda: 1.0)
    key = json.dumps(message("key_down"))
    inner, sent = request(f"/{TOKEN}/", "websocket", messages="\n".join([key] * 60))
    assert len(inner.received) == 50 and sent[-1]["code"] == 1008 and "a second" in sent[-1]["reason"]
