"""A cache folder that can be written: without one PoCL shows no device and pyopencl cannot be imported."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile


def ensure_cache() -> None:
    """Where the user's cache folder cannot be written, use a fresh one for this process; call before pyopencl.

    So it is where HOME is missing or read-only, as in many containers. Kernels are then compiled anew each time.
    """
    if not sys.platform.startswith("linux"):
        return
    folder = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    try:
        os.makedirs(folder, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return
    except OSError:
        pass
    fresh = tempfile.mkdtemp(prefix="clpeel-cache-")
    atexit.register(shutil.rmtree, fresh, ignore_errors=True)
    os.environ["XDG_CACHE_HOME"] = fresh
