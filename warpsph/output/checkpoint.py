"""Checkpoints: all that a run needs to go on, bit for bit."""

import os
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from warpsph.simulation import Simulation

SCENE = "scene.yaml"  # the name of the scene among the arrays of a checkpoint
KEPT = 2  # The one before the last survives, should the last be cut short with the machine.


_UNREADABLE = (OSError, EOFError, ValueError, KeyError, NotImplementedError, zipfile.BadZipFile, zlib.error)


class CheckpointError(Exception):
    """There is no checkpoint to go on from; the text is one line for the user."""


@dataclass(frozen=True)
class Reached:
    """How far the last checkpoint of a folder is.

    Attributes:
        path: Its file.
        time: [s].
        step: Steps done.
        scene: The scene it was made by, every default filled in, as YAML; empty if it does not tell.
    """

    path: Path
    time: float
    step: int
    scene: str


def write_checkpoint(folder: Path, simulation: Simulation, scene: str = "") -> Path:
    """Write the state of `simulation`, and of its bodies, to `folder`/STEP.npz, with the YAML of the scene.

    First under another name, so that a kill never leaves half a file.
    """
    arrays = {name: array.numpy() for name, array in simulation.kept().items()}
    arrays[SCENE] = np.frombuffer(scene.encode(), np.uint8)
    path = folder / f"{int(arrays['step'][0]):09d}.npz"
    unfinished = path.with_suffix(".part")
    with unfinished.open("wb") as file:
        np.savez(file, **arrays)
        file.flush()
        os.fsync(file.fileno())
    unfinished.replace(path)
    for old in sorted(folder.glob("*.npz"))[:-KEPT]:
        old.unlink()
    return path


def find_checkpoint(folder: Path) -> Reached:
    """The last checkpoint of `folder` that is whole, without its arrays.

    Raises:
        CheckpointError: there is none.
    """
    complaints = []
    for path in sorted(folder.glob("*.npz"), reverse=True):
        try:
            with zipfile.ZipFile(path) as file:
                damaged = file.testzip()
            if damaged:
                raise ValueError(f"{damaged} is damaged")
            with np.load(path) as file:
                scene = file[SCENE].tobytes().decode() if SCENE in file else ""
                return Reached(path, float(file["time"][0]), int(file["step"][0]), scene)
        except _UNREADABLE as error:
            complaints.append(_unreadable(path, error))
    raise CheckpointError(complaints[0] if complaints else f"{folder}: no checkpoint to go on from")


def differences(before: str, now: str) -> dict[str, str]:
    """The fields in which two scenes, as YAML with every default filled in, differ: path -> "1000.0, now 1200.0"."""
    old, new = (dict(_leaves(yaml.safe_load(text), "")) for text in (before, now))
    absent = "absent"
    return {
        path: f"{old.get(path, absent)}, now {new.get(path, absent)}"
        for path in {**old, **new}
        if old.get(path, absent) != new.get(path, absent)
    }


def _leaves(data: Any, path: str) -> Iterator[tuple[str, Any]]:
    """(path, value) of each number, word and empty list of a scene."""
    if isinstance(data, dict) and data:
        for key, value in data.items():
            yield from _leaves(value, f"{path}.{key}" if path else str(key))
    elif isinstance(data, list) and data:
        for i, value in enumerate(data):
            yield from _leaves(value, f"{path}[{i}]")
    else:
        yield path, data


def read_checkpoint(folder: Path, simulation: Simulation) -> None:
    """Load the last checkpoint of `folder` that can be read into `simulation`.

    Raises:
        CheckpointError: there is none, or it does not fit the scene.
    """
    paths = sorted(folder.glob("*.npz"), reverse=True)
    if not paths:
        raise CheckpointError(f"{folder}: no checkpoint to go on from")
    complaints = []
    kept = simulation.kept()
    for path in paths:
        try:
            with np.load(path) as file:
                arrays = {name: file[name] for name in kept}
        except _UNREADABLE as error:
            complaints.append(_unreadable(path, error))
            continue
        for name, values in arrays.items():
            array = kept[name]
            if values.shape != array.numpy().shape:
                raise CheckpointError(f"{path}: made by another scene (its '{name}' has another shape)")
            array.assign(values)
        return
    raise CheckpointError(complaints[0])


def _unreadable(path: Path, error: Exception) -> str:
    return f"{path}: not a checkpoint that can be read ({error})"
