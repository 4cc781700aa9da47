"""The server, asked by programs that are no browser: who comes in, what closes whom, and how it ends."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

pytest.importorskip("rendercanvas", reason="needs the extra 'view'")
pytest.importorskip("uvicorn", reason="needs the extra 'view'")
client = pytest.importorskip("websockets.sync.client", reason="needs the extra 'view'")
from websockets.exceptions import ConnectionClosed, InvalidStatus  # noqa: E402

SHAPE = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
RESIZE = {"type": "resize", "width": 80, "height": 60, "pwidth": 80, "pheight": 60, "ratio": 1, "timestamp": 1}
KEY = {"type": "key_down", "key": "1", "modifiers": [], "timestamp": 1}


class Served:
    """A server in a process of its own, started as a user would."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        shape = folder / "shape.off"
        shape.write_text(SHAPE)
        command = [
            sys.executable,
            "-P",
            "-m",
            "clpeel",
            "view",
            str(shape),
            "--opacity=0.5",
            "--no-open",
            "--backend=browser",
        ]
        self.process = subprocess.Popen(
            [*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env={**os.environ}
        )
        assert self.process.stdout is not None
        self.line = self.process.stdout.readline()
        found = re.search(r"http://\S+", self.line)
        assert found, f"no address in {self.line!r}: {self.process.communicate()[1]}"
        self.address = found[0]
        self.parts = urlsplit(self.address)

    def socket(self, **options: Any) -> Any:
        """A page's socket."""
        given = {
            "origin": f"http://{self.parts.netloc}",
            "compression": None,
            "max_size": None,
            "max_queue": None,
            "open_timeout": 20,
        }
        return client.connect(self.address.replace("http", "ws", 1), **{**given, **options})

    def get(self, path: str, method: str = "GET", **headers: str) -> tuple[int, bytes]:
        """The status and the text of an answer."""
        asked = http.client.HTTPConnection(self.parts.hostname or "", self.parts.port or 0, timeout=20)
        with contextlib.closing(asked):
            asked.request(method, path, headers=headers)
            answer = asked.getresponse()
            return answer.status, answer.read()

    def end(self, how: int = signal.SIGINT) -> tuple[int, str, str]:
        """Ends it. Returns its exit code, and what it printed."""
        self.process.send_signal(how)
        try:
            out, err = self.process.communicate(timeout=30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate()
            raise
        return self.process.returncode, out, err


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    found = Served(tmp_path_factory.mktemp("served"))
    yield found
    code = found.process.poll()
    assert code is None, f"the server ended by itself with code {code}: {found.process.communicate()}"
    code, _, err = found.end()
    assert code == 0 and "Traceback" not in err


def frame(page: Any, timeout: float = 60, confirm: bool = True) -> tuple[dict[str, Any], bytes]:
    """The next frame of a page, which is then confirmed."""
    while True:
        message = json.loads(page.recv(timeout=timeout))
        if message["type"] == "framebufferdata":
            data = page.recv(timeout=timeout)
            if confirm:
                feedback = {"type": "_framefeedback", "index": message["index"], "timestamp": 1, "localtime": 1}
                page.send(json.dumps(feedback))
            return message, data


def settled(page: Any) -> tuple[dict[str, Any], bytes]:
    """The frames of a page until one is lossless."""
    while True:
        message, data = frame(page)
        if message["status"]["lossless"]:
            return message, data


def send(page: Any, *messages: dict[str, Any]) -> None:
    for message in messages:
        page.send(json.dumps(message))


def assert_well(served: Served) -> None:
    """A new page gets its picture. (Earlier pages are closed by then, but the server may not know yet.)"""
    deadline = time.monotonic() + 30
    with served.socket() as page:
        send(page, RESIZE)
        message, data = settled(page)
        while not message["status"]["full"] and time.monotonic() < deadline:
            message, data = settled(page)
        assert data.startswith(b"\x89PNG") and message["mimetype"] == "image/png"


def test_a_page_gets_a_draft_and_then_the_picture_without_loss(served: Served) -> None:
    with served.socket() as page:
        send(page, RESIZE)
        first, data = frame(page)
        assert data.startswith((b"\xff\xd8", b"\x89PNG"))
        message, data = settled(page)
        assert data.startswith(b"\x89PNG") and message["status"]["full"]
        assert message["status"]["technique"] == "sort"


def test_nothing_is_served_but_the_page(served: Served) -> None:
    path = served.parts.path
    assert served.get(path)[0] == 200
    for name in ("page.js", "page.css", "renderview.js", "viewer.json"):
        assert served.get(path + name)[0] == 200, name
    for name in (
        "view.py",
        "../view.py",
        "%2e%2e/guard.py",
        "shape.off",
        "page.js/",
        "..",
        "index.html%00",
        "renderview-client.js",
    ):
        assert served.get(path + name)[0] in (403, 404), name
    for wrong in ("/", "/wrong/", path[:-2] + "/", path.swapcase(), "//" + path[1:]):
        assert served.get(wrong)[0] == 403, wrong
    assert served.get(path, "POST")[0] == 405


def test_a_name_that_somebody_points_here_leads_nowhere(served: Served) -> None:
    assert served.get(served.parts.path, Host="evil.example")[0] == 403
    assert served.get(served.parts.path, Host=f"localhost:{served.parts.port}")[0] == 200


@pytest.mark.parametrize("wrong", ["token", "origin", "no origin", "host"])
def test_no_socket_for_those_who_do_not_belong(served: Served, wrong: str) -> None:
    options: dict[str, Any] = {
        "token": {},
        "origin": {"origin": "http://evil.example"},
        "no origin": {"origin": None},
        "host": {"origin": "http://evil.example", "additional_headers": {"Host": "evil.example"}},
    }[wrong]
    address = served.address.replace("http", "ws", 1)
    if wrong == "token":
        address = address[:-4] + "xyz/"
        options = {"origin": f"http://{served.parts.netloc}"}
    with pytest.raises(InvalidStatus) as refused, client.connect(address, **options):
        pass
    assert refused.value.response.status_code in (403, 400)


WRONG = [
    "garbage",
    '{"type": "_clients_change", "ids": []}',
    '{"type": "key_down", "key": 7, "modifiers": [], "timestamp": 1}',
    '{"type": "set", "name": "opacity", "value": {"a": 1}}',
    '{"type": "_framefeedback", "index": 99999, "timestamp": 1, "localtime": 1}',
    "[" * 4000,
    "x" * 100_000,
    b"bytes",
    b"\xff" * 5000,
]


@pytest.mark.parametrize("wrong", WRONG, ids=lambda each: str(each)[:24])
def test_a_wrong_message_closes_its_own_socket_alone(served: Served, wrong: str | bytes) -> None:
    with served.socket() as good, served.socket() as bad:
        send(good, RESIZE)
        settled(good)
        bad.send(wrong)
        with pytest.raises(ConnectionClosed) as closed:
            while True:
                bad.recv(timeout=20)
        received = closed.value.rcvd
        assert received is None or received.code in (1007, 1008, 1009)
        send(good, {**KEY, "key": "2"})
        until(good, "depth-peeling")
        send(good, {**KEY, "key": "r"})


def test_a_flood_closes_its_own_socket(served: Served) -> None:
    with served.socket() as bad, pytest.raises(ConnectionClosed):
        for _ in range(200_000):
            send(bad, {**KEY, "key": "x"})
    assert_well(served)


def test_a_setting_that_is_impossible_is_a_notice(served: Served) -> None:
    with served.socket() as page:
        send(page, RESIZE)
        settled(page)
        send(page, {"type": "set", "name": "opacity", "value": 7, "timestamp": 2})
        while True:
            message, _ = frame(page)
            if message["status"]["notice"]:
                break
        assert "opacity: expected a number 0..1" in message["status"]["notice"]


def until(page: Any, technique: str) -> None:
    """Waits for the lossless picture of a technique."""
    while settled(page)[0]["status"]["technique"] != technique:
        pass


def test_the_first_page_steers_the_second_looks_on_and_takes_over(served: Served) -> None:
    with served.socket() as first, served.socket() as second:
        send(first, RESIZE)
        settled(first)
        send(second, {**RESIZE, "pwidth": 30}, {**KEY, "key": "3"})  # nobody listens to it
        send(first, {**KEY, "key": "2"})
        until(first, "depth-peeling")
        until(second, "depth-peeling")
        first.close()
        while json.loads(second.recv(timeout=20)) != {"type": "active", "value": True}:
            pass
        send(second, RESIZE, {**KEY, "key": "3"})
        until(second, "weighted-average")
        send(second, {**KEY, "key": "r"})


def test_a_page_that_confirms_nothing_gets_two_frames_and_holds_nobody_up(served: Served) -> None:
    with served.socket() as good:
        send(good, RESIZE)
        settled(good)
        with served.socket() as silent:
            for step in range(40):
                send(good, {"type": "set", "name": "opacity", "value": step / 40, "timestamp": 2})
                frame(good)
            got = 0
            with pytest.raises(TimeoutError):
                while True:
                    message = silent.recv(timeout=1)
                    got += isinstance(message, bytes)
            assert got == 2
        send(good, {**KEY, "key": "r"})


def test_pages_that_vanish_leave_the_server_well(served: Served) -> None:
    for _ in range(5):
        raw = socket.create_connection((served.parts.hostname, served.parts.port))
        head = (
            f"GET {served.parts.path} HTTP/1.1\r\nHost: {served.parts.netloc}\r\nOrigin: http://{served.parts.netloc}\r\n"
            "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        )
        raw.sendall(head.encode())
        raw.recv(10)  # in the middle of an answer
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\x01\x00\x00\x00\x00\x00\x00\x00")
        raw.close()  # with a reset
    assert_well(served)


def test_too_many_pages_are_told_to_come_later(served: Served) -> None:
    with contextlib.ExitStack() as pages:
        for _ in range(16):
            pages.enter_context(served.socket())
        with served.socket() as late, pytest.raises(ConnectionClosed) as closed:
            while True:
                late.recv(timeout=20)
        assert closed.value.rcvd.code == 1013
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        try:
            assert_well(served)
            return
        except ConnectionClosed:
            time.sleep(0.2)
    pytest.fail("nobody comes in any more")


# --- how it begins and ends -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("how", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("looked_at", [False, True])
def test_it_ends_when_it_is_told_to(how: int, code: int, looked_at: bool, tmp_path: Path) -> None:
    served = Served(tmp_path)
    if looked_at:
        with served.socket() as page:
            send(page, RESIZE, {**KEY, "key": " "})  # turning: there is always something to draw
            frame(page)
            ended = served.end(how)
    else:
        ended = served.end(how)
    assert ended[0] == code and "Traceback" not in ended[2] and "Received signal" not in ended[2]


def test_c_prints_the_command_line(tmp_path: Path) -> None:
    served = Served(tmp_path)
    with served.socket() as page:
        send(page, RESIZE)
        message, _ = settled(page)
        send(page, {**KEY, "key": "c"})
        assert served.process.stdout is not None
        assert served.process.stdout.readline().strip() == message["status"]["command"]
    assert served.end()[0] == 0


def test_a_port_that_is_taken_is_one_line(served: Served, tmp_path: Path) -> None:
    (tmp_path / "shape.off").write_text(SHAPE)
    command = [
        sys.executable,
        "-P",
        "-m",
        "clpeel",
        "view",
        str(tmp_path / "shape.off"),
        "--backend=browser",
        "--no-open",
    ]
    for more in ([f"--port={served.parts.port}"], ["--host=no.such.name.example"], ["--host=8.8.8.8"]):
        done = subprocess.run([*command, *more], capture_output=True, text=True, timeout=60, check=False)
        lines = [line for line in done.stderr.splitlines() if "note:" not in line]
        assert done.returncode == 2 and len(lines) == 1, done.stderr
        assert "expected a free port of this machine" in lines[0]
