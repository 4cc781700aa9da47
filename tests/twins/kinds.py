"""Kinds of pictures whose tests fail in other processes. Those can import this module, but not a test."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from clpeel.rendering.checking import WrongPictureError
from clpeel.rendering.warm_up import Kind
from clpeel.scene.scene import Scene


class Hanging(Kind):
    """A kind whose test starts another process, as compilers do, and then waits for ever."""

    def scene(self) -> Scene:
        other = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(1000)"])
        Path(os.environ["TEST_PIDS"]).write_text(f"{os.getpid()} {other.pid}")
        time.sleep(1000)
        return super().scene()


class Crashing(Kind):
    """A kind whose test ends the process."""

    def scene(self) -> Scene:
        os.kill(os.getpid(), signal.SIGKILL)  # PoCL handles SIGSEGV, and goes on
        return super().scene()


class Failing(Kind):
    """A kind whose kernels are not compiled, or draw wrongly."""

    def scene(self) -> Scene:
        import pyopencl

        if self.floats:
            raise WrongPictureError("a long message", "a short reason")
        raise pyopencl.LogicError("clBuildProgram failed\nwith a long log")
