"""Order-independent transparency on any OpenCL device, with no graphics API."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from clpeel.version import VERSION

if TYPE_CHECKING:
    from clpeel.errors import ClpeelError as ClpeelError
    from clpeel.errors import InputError as InputError
    from clpeel.errors import NoDeviceError as NoDeviceError
    from clpeel.film.turntable import Film as Film
    from clpeel.film.turntable import turntable as turntable
    from clpeel.pictures.colormaps import ColorMap as ColorMap
    from clpeel.pictures.layers import Layers as Layers
    from clpeel.pictures.layers import load_layers as load_layers
    from clpeel.reading.from_pyvista import from_pyvista as from_pyvista
    from clpeel.reading.load import load as load
    from clpeel.rendering.renderer import Renderer as Renderer
    from clpeel.rendering.renderer import render as render
    from clpeel.rendering.result import Result as Result
    from clpeel.rendering.result import Stats as Stats
    from clpeel.rendering.warm_up import Warmed as Warmed
    from clpeel.rendering.warm_up import warm_up as warm_up
    from clpeel.scene.camera import Camera as Camera
    from clpeel.scene.grid import grid as grid
    from clpeel.scene.materials import Material as Material
    from clpeel.scene.scalars import with_scalars as with_scalars
    from clpeel.scene.scene import Scene as Scene
    from clpeel.scene.textures import Texture as Texture
    from clpeel.study.compare import compare as compare
    from clpeel.study.comparison import Comparison as Comparison
    from clpeel.study.comparison import Interrupted as Interrupted
    from clpeel.study.complexity import Complexity as Complexity
    from clpeel.study.complexity import complexity as complexity
    from clpeel.study.standings import InterruptedSuite as InterruptedSuite
    from clpeel.study.standings import SuiteComparison as SuiteComparison
    from clpeel.study.suite import compare_suite as compare_suite
    from clpeel.viewer.open import view as view
    from clpeel.viewer.show import show as show

__version__ = VERSION

# Modules are imported when a name is first used, because `clpeel --help` needs neither NumPy nor OpenCL.
_HOMES = {
    "Camera": "clpeel.scene.camera",
    "ClpeelError": "clpeel.errors",
    "ColorMap": "clpeel.pictures.colormaps",
    "Comparison": "clpeel.study.comparison",
    "Complexity": "clpeel.study.complexity",
    "Film": "clpeel.film.turntable",
    "InputError": "clpeel.errors",
    "Interrupted": "clpeel.study.comparison",
    "InterruptedSuite": "clpeel.study.standings",
    "Layers": "clpeel.pictures.layers",
    "Material": "clpeel.scene.materials",
    "NoDeviceError": "clpeel.errors",
    "Renderer": "clpeel.rendering.renderer",
    "Result": "clpeel.rendering.result",
    "Scene": "clpeel.scene.scene",
    "Stats": "clpeel.rendering.result",
    "SuiteComparison": "clpeel.study.standings",
    "Texture": "clpeel.scene.textures",
    "Warmed": "clpeel.rendering.warm_up",
    "compare": "clpeel.study.compare",
    "compare_suite": "clpeel.study.suite",
    "complexity": "clpeel.study.complexity",
    "from_pyvista": "clpeel.reading.from_pyvista",
    "grid": "clpeel.scene.grid",
    "load": "clpeel.reading.load",
    "load_layers": "clpeel.pictures.layers",
    "render": "clpeel.rendering.renderer",
    "show": "clpeel.viewer.show",
    "turntable": "clpeel.film.turntable",
    "view": "clpeel.viewer.open",
    "warm_up": "clpeel.rendering.warm_up",
    "with_scalars": "clpeel.scene.scalars",
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
