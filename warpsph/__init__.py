"""Smoothed particle hydrodynamics on NVIDIA Warp: landslide waves and free-surface flow from one YAML scene.

The front door for a notebook: `load_scene`, `Simulation`, `Run` and `read_run`. Each is imported when it is first
asked for, so that `import warpsph` starts no device.
"""

import importlib
from typing import Any

__version__ = "0.1.0"

_FRONT_DOOR = {
    "load_scene": "warpsph.scene.loading",
    "Simulation": "warpsph.simulation",
    "Run": "warpsph.run",
    "read_run": "warpsph.output.run_folder",
}

__all__ = ["Run", "Simulation", "__version__", "load_scene", "read_run"]


def __getattr__(name: str) -> Any:
    if name not in _FRONT_DOOR:
        raise AttributeError(f"module 'warpsph' has no attribute '{name}'")
    found = getattr(importlib.import_module(_FRONT_DOOR[name]), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_FRONT_DOOR})
