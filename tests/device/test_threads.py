"""Threads and forks: a Renderer that threads share, renderers side by side, and what becomes of a forked process."""

from __future__ import annotations

import multiprocessing
import os
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np
import plainly
import pytest

import clpeel
from clpeel.errors import DeviceError, InputError

SIZE = (96, 64)


@pytest.fixture(scope="module")
def scene() -> clpeel.Scene:
    rng = np.random.default_rng(5)
    corners = rng.normal(size=(300, 3))
    return clpeel.Scene.from_arrays(corners, np.arange(300).reshape(-1, 3), color=(0.2, 0.5, 0.9, 0.4))


def views(scene: clpeel.Scene) -> list[clpeel.Camera]:
    return [clpeel.Camera.frame(scene, direction=(np.cos(k), 0.3, np.sin(k))) for k in range(6)]


@pytest.mark.parametrize("shared", [True, False], ids=["one renderer", "a renderer each"])
def test_threads_get_the_same_bits(scene: clpeel.Scene, shared: bool) -> None:
    cameras, renderer = views(scene), plainly.Renderer(scene)
    techniques = ("sort", "dual-depth-peeling")

    def picture(number: int) -> np.ndarray:
        options: dict[str, Any] = {"size": SIZE, "technique": techniques[number % 2]}
        camera = cameras[number % 6]
        result = renderer.render(camera, **options) if shared else plainly.render(scene, camera, **options)
        return result.color.view(np.uint32)

    want = [picture(number) for number in range(6)]
    with ThreadPoolExecutor(8) as pool:
        for number, got in enumerate(pool.map(picture, range(96))):
            np.testing.assert_array_equal(got, want[number % 6])


def test_a_picture_within_a_picture_is_refused(scene: clpeel.Scene) -> None:
    renderer = plainly.Renderer(scene)
    with pytest.raises(InputError, match="expected no picture of this Renderer under way in this thread"):
        renderer.render(size=SIZE, progress=lambda done, text: renderer.render(size=SIZE))
    renderer.render(size=SIZE)  # and the Renderer is free again


def test_a_refused_picture_does_not_hold_others_up(scene: clpeel.Scene) -> None:
    renderer = plainly.Renderer(scene)
    with pytest.raises(InputError):
        renderer.render(size=SIZE, samples=3)
    thread = threading.Thread(target=renderer.render, kwargs={"size": SIZE})
    thread.start()
    thread.join(60)
    assert not thread.is_alive()


def answer_of_a_fork(do: Any) -> str:
    """What `do` says in a child that ends as processes do."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.write(writing, str(do()).encode())
        except Exception as error:
            os.write(writing, f"{type(error).__name__}: {error}".encode())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as file:
        said = file.read().decode()
    os.waitpid(child, 0)
    return said


needs_fork = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs os.fork, which this system does not have")


@needs_fork
@pytest.mark.parametrize("busy", [False, True], ids=["idle", "while a thread renders"])
def test_a_forked_child_says_what_to_do(scene: clpeel.Scene, busy: bool) -> None:
    renderer = plainly.Renderer(scene)
    want = renderer.render(size=SIZE).image
    started, ended = threading.Event(), threading.Event()

    def progress(done: float, text: str) -> None:
        started.set()
        ended.wait(60)

    thread = threading.Thread(target=lambda: renderer.render(size=SIZE, progress=progress))
    if busy:
        thread.start()
        assert started.wait(60)
    for do in (
        lambda: renderer.render(size=SIZE),
        lambda: plainly.render(scene, size=SIZE),
        lambda: clpeel.complexity(scene, size=SIZE),
    ):
        said = answer_of_a_fork(do)
        assert said.startswith("DeviceError: device: ") and "multiprocessing.get_context('spawn')" in said
    ended.set()
    if busy:
        thread.join(60)
    np.testing.assert_array_equal(renderer.render(size=SIZE).image, want)


@needs_fork
def test_workers_that_are_forked_fail_and_do_not_hang(scene: clpeel.Scene) -> None:
    plainly.render(scene, size=SIZE)
    with ProcessPoolExecutor(1, multiprocessing.get_context("fork")) as pool, pytest.raises(DeviceError, match="spawn"):
        pool.submit(plainly.render, scene, size=SIZE).result(60)


def test_workers_that_are_spawned_render(scene: clpeel.Scene) -> None:
    want = plainly.render(scene, size=SIZE).image
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        got = pool.submit(plainly.render, scene, size=SIZE).result(120)
    np.testing.assert_array_equal(got.image, want)
