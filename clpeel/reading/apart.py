"""Apart: runs a reader in a process of its own, as libraries in C++ print what they like, and may crash on damage."""

from __future__ import annotations

import pickle
import signal
import subprocess
import sys
from typing import Any

from clpeel.errors import InputError
from clpeel.scene.scene import Scene

_CHILD = """
import os, sys
result = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)
import pickle
sys.path[:], module, name, given = pickle.load(sys.stdin.buffer)
from importlib import import_module
from clpeel.errors import InputError
from clpeel.reading.words import one_line
try:
    made = getattr(import_module(module), name)(*given)
except InputError as error:
    made = str(error)
except MemoryError:
    made = "not a readable mesh: it asks for more memory than there is"
except Exception as error:
    made = f"not a readable mesh: the file is damaged (the reader stopped with {one_line(error)})"
pickle.dump(made, result)
result.close()
os._exit(0)
"""
"""What the process runs. Only its result goes to standard output: what a library prints there goes to standard error.

It ends at once, as destructors of a library may crash, too, when nothing is left to lose.
"""


def read_apart(module: str, name: str, *given: Any) -> Scene:
    """Return the scene that a function of a module makes of these arguments, which pickle must know.

    Raises InputError as the function does, and if the process ends otherwise.
    """
    command = [sys.executable, "-P", "-c", _CHILD]
    asked = pickle.dumps((sys.path, module, name, given))
    run = subprocess.run(command, input=asked, capture_output=True, check=False)
    if run.returncode or not run.stdout:
        raise InputError(f"not a readable mesh: the file is damaged (its reader ended with {_ended(run.returncode)})")
    made: Scene | str = pickle.loads(run.stdout)
    if isinstance(made, str):
        raise InputError(made)
    return made


def _ended(code: int) -> str:
    """Return in words how a process ended."""
    try:
        return signal.Signals(-code).name if code < 0 else f"code {code}"
    except ValueError:
        return f"signal {-code}"
