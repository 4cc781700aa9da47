"""Order-independent transparency on any OpenCL device, with no graphics API."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from clpeel.camera import Camera as Camera
    from clpeel.comparison import Comparison as Comparison
    from clpeel.comparison import Interrupted as Interrupted
    from clpeel.comparison import compare as compare
    from clpeel.depth_complexity import Complexity as Complexity
    from clpeel.depth_complexity import complexity as complexity
    from clpeel.errors import ClpeelError as ClpeelError
    from clpeel.errors import InputError as InputError
    from clpeel.errors import NoDeviceError as NoDeviceError
    from clpeel.layers import Layers as Layers
    from clpeel.layers import load_layers as load_layers
    from clpeel.loading import load as load
    from clpeel.renderer import Renderer as Renderer
    from clpeel.renderer import Result as Result
    from clpeel.renderer import render as render
    from clpeel.scene import Scene as Scene

__version__ = "0.1.0"

# Imported when first asked for: `clpeel --help` needs neither NumPy nor OpenCL.
_HOMES = {
    "Camera": "clpeel.camera",
    "ClpeelError": "clpeel.errors",
    "Comparison": "clpeel.comparison",
    "Complexity": "clpeel.depth_complexity",
    "InputError": "clpeel.errors",
    "Interrupted": "clpeel.comparison",
    "Layers": "clpeel.layers",
    "NoDeviceError": "clpeel.errors",
    "Renderer": "clpeel.renderer",
    "Result": "clpeel.renderer",
    "Scene": "clpeel.scene",
    "compare": "clpeel.comparison",
    "complexity": "clpeel.depth_complexity",
    "load": "clpeel.loading",
    "load_layers": "clpeel.layers",
    "render": "clpeel.renderer",
}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'clpeel' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
