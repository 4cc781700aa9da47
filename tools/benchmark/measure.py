"""Measurements, each in its own process: `python -m benchmark.measure CASE OPTIONS` prints one line of JSON.

CASE is a name in CASES, and OPTIONS is a JSON object of its arguments.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

PLAIN: dict[str, Any] = {"background": (1.0, 1.0, 1.0), "lighting": "none", "samples": 1}
"""What frames are measured with, unless a job says otherwise: as little as there is."""

EDGES = ("edges", "feature_edges", "silhouettes")
"""Options whose edges a renderer keeps on the device until another choice is made. Each choice has its own renderer
here: frames are measured, and not the change of the choice."""

ENOUGH_SECONDS = 3.0
"""After this time no new frame begins. Long frames need no repetition to be timed well."""


def device() -> dict[str, Any]:
    """Return a description of the OpenCL device that a render would use."""
    import numpy

    from clpeel.device.devices import open_device

    found = open_device().device
    return {
        "OpenCL device": found.name.strip(),
        "OpenCL platform": found.platform.name.strip(),
        "OpenCL version": found.version.strip(),
        "OpenCL driver": found.driver_version.strip(),
        "compute units": found.max_compute_units,
        "NumPy": numpy.__version__,
    }


def keep(model: str, path: str) -> dict[str, Any]:
    """Write the geometry of a model to a binary PLY, which all others read quickly."""
    import clpeel
    from benchmark.makers import write_ply

    scene = clpeel.load(model)
    write_ply(path, scene.vertices, scene.faces)
    return {"triangles": len(scene.faces)}


def arrays(scene: list[Any], path: str) -> dict[str, Any]:
    """Write a scene to an NPZ file, for programs without clpeel: vertices, faces, and rgba as uint8 for each face."""
    import numpy as np

    from benchmark.makers import make

    made = make(*scene)
    rgba = np.broadcast_to(made.colors, (len(made.faces), 4)).astype(np.uint8)
    np.savez(path, vertices=made.vertices, faces=made.faces, rgba=rgba)
    return {"triangles": len(made.faces)}


def frames(jobs: list[dict[str, Any]], count: int, out: str | None = None) -> dict[str, Any]:
    """Time frames of the jobs, which take turns. The camera moves a little each time. The first frame does not count.

    A job has a scene [name, numbers...], a size in pixels, and options of `Renderer.render`. out: the file for the last
    picture.
    """
    import numpy as np

    import clpeel
    from benchmark.makers import CAMERA, make

    keys = [str((job["scene"], [job["options"].get(name) for name in EDGES])) for job in jobs]
    renderers = {key: clpeel.Renderer(make(*job["scene"])) for key, job in zip(keys, jobs, strict=True)}
    seconds: list[list[float]] = [[] for _ in jobs]
    stats: list[list[dict[str, Any]]] = [[] for _ in jobs]
    before, camera, began = memory("VmRSS"), CAMERA, 0.0
    for frame in range(count + 1):
        if frame == 1:
            began = time.perf_counter()
        elif frame > 1 and time.perf_counter() - began > ENOUGH_SECONDS * len(jobs):
            break
        camera = camera.azimuth(1e-9)
        for place, job in enumerate(jobs):
            result = None  # frees the memory of the previous picture
            renderer = renderers[keys[place]]
            started = time.perf_counter()
            result = renderer.render(camera, (job["size"], job["size"]), **{**PLAIN, **job["options"]})
            spent = time.perf_counter() - started
            if frame:
                seconds[place].append(spent)
                stats[place].append(dict(result.stats))
    if out is not None and result is not None:
        np.save(out, result.image)
    found = []
    for timed, all_stats in zip(seconds, stats, strict=True):
        stages = {key: medians([one[key] for one in all_stats]) for key in ("seconds", "kernel_seconds")}
        found.append({"median_s": statistics.median(timed), "stats": {**all_stats[-1], **stages}})
    return {"jobs": found, "peak_bytes": memory("VmHWM"), "before_bytes": before}


def medians(rows: list[dict[str, float]]) -> dict[str, float]:
    """Return the median of each key."""
    return {key: statistics.median(row.get(key, 0.0) for row in rows) for key in rows[-1]}


def memory(field: str) -> int:
    """Return the bytes resident now ("VmRSS") or at most so far ("VmHWM"). Without /proc, both are the most so far."""
    try:
        with open("/proc/self/status", encoding="ascii") as file:
            return next(int(line.split()[1]) * 1024 for line in file if line.startswith(field))
    except (OSError, StopIteration):
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


COPY = (
    "kernel void copy(global const float4 *from, global float4 *to) { to[get_global_id(0)] = from[get_global_id(0)]; }"
)


def bandwidth(nbytes: int, repeats: int) -> dict[str, Any]:
    """Return the best rate of several copies of one buffer to another: bytes read plus bytes written, per second."""
    import pyopencl as cl

    from clpeel.device.devices import open_device

    gpu = open_device()
    nbytes = min(nbytes, gpu.device.max_mem_alloc_size, gpu.device.global_mem_size // 4) // 4096 * 4096
    source, target = (cl.Buffer(gpu.context, cl.mem_flags.READ_WRITE, nbytes) for _ in range(2))
    kernel = cl.Kernel(cl.Program(gpu.context, COPY).build(), "copy")
    ways: dict[str, Callable[[], Any]] = {
        "kernel": lambda: kernel(gpu.queue, (nbytes // 16,), (256,), source, target),
        "enqueue_copy": lambda: cl.enqueue_copy(gpu.queue, target, source, byte_count=nbytes),
    }
    for held in (source, target):
        cl.enqueue_fill_buffer(gpu.queue, held, b"\1", 0, nbytes)
    best: dict[str, float] = {}
    for _ in range(repeats):
        for name, copy in ways.items():
            gpu.queue.finish()
            started = time.perf_counter()
            copy()
            gpu.queue.finish()
            best[name] = max(best.get(name, 0.0), 2 * nbytes / (time.perf_counter() - started))
    way = max(best, key=lambda name: best[name])
    return {"bytes_per_second": best[way], "way": way, "nbytes": nbytes}


def camera(scene: list[Any], size: int, count: int) -> dict[str, Any]:
    """Draw frames from a camera that moves a degree each, then the same frames again, and count what each one requests.

    Returns "turns": for both turns, the seconds of each frame and what it requested of OpenCL. An allocation is a
    buffer for which the device must find room. A buffer that wraps a host's array is counted separately.
    """
    import pyopencl as cl

    counted = dict.fromkeys(("allocations", "wrapped", "programs", "bytes to the device"), 0)

    class Buffer(cl.Buffer):  # type: ignore[misc]
        def __init__(self, context: Any, flags: int, size: int = 0, hostbuf: Any = None) -> None:
            super().__init__(context, flags, size, hostbuf)
            counted["wrapped" if flags & cl.mem_flags.USE_HOST_PTR else "allocations"] += 1
            if flags & cl.mem_flags.COPY_HOST_PTR:
                counted["bytes to the device"] += hostbuf.nbytes

    class Program(cl.Program):  # type: ignore[misc]
        def build(self, *arguments: Any, **options: Any) -> Any:
            counted["programs"] += 1
            return super().build(*arguments, **options)

    enqueue_copy = cl.enqueue_copy

    def copy(queue: Any, target: Any, source: Any, **options: Any) -> Any:
        if isinstance(target, cl.MemoryObjectHolder) and not isinstance(source, cl.MemoryObjectHolder):
            counted["bytes to the device"] += memoryview(source).nbytes
        return enqueue_copy(queue, target, source, **options)

    cl.Buffer, cl.Program, cl.enqueue_copy = Buffer, Program, copy

    import clpeel
    from benchmark.makers import CAMERA, make

    renderer = clpeel.Renderer(make(*scene))
    turns: list[list[dict[str, float]]] = [[], []]
    host_peak = result_bytes = 0
    for frame in range(2 * count + 2):
        traced = frame >= 2 * count  # tracing slows a frame, so the last two frames are not timed
        view = CAMERA.azimuth(frame % count)
        counted.update(dict.fromkeys(counted, 0))
        result = None
        if traced:
            tracemalloc.start()
            tracemalloc.reset_peak()
            held = tracemalloc.get_traced_memory()[0]
        started = time.perf_counter()
        result = renderer.render(view, (size, size), **PLAIN)
        spent = time.perf_counter() - started
        if traced:
            host_peak = max(host_peak, tracemalloc.get_traced_memory()[1] - held)
            result_bytes = result.image.nbytes + result.color.nbytes
        else:
            turns[frame // count].append({"seconds": spent, **counted})
    scene_bytes = result.stats["bytes"]["scene"] if result else 0
    return {"turns": turns, "host_peak_bytes": host_peak, "result_bytes": result_bytes, "scene_bytes": scene_bytes}


CASES: dict[str, Callable[..., dict[str, Any]]] = {
    case.__name__: case for case in (device, keep, arrays, frames, bandwidth, camera)
}

if __name__ == "__main__":
    try:
        print(json.dumps(CASES[sys.argv[1]](**json.loads(sys.argv[2])), default=float))
    except Exception as error:
        raise SystemExit(f"{type(error).__name__}: {next(iter(str(error).splitlines()), 'no message')}") from None
