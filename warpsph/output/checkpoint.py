"""Checkpoints: all that a run needs to go on, bit for bit."""

import os
import zipfile
from pathlib import Path

import numpy as np

from warpsph.simulation import Simulation

KEPT = 2  # The one before the last survives, should the last be cut short with the machine.


class CheckpointError(Exception):
    """There is no checkpoint to go on from; the text is one line for the user."""


def write_checkpoint(folder: Path, simulation: Simulation) -> Path:
    """Write the state of `simulation`, and of its bodies, to `folder`/STEP.npz.

    First under another name, so that a kill never leaves half a file.
    """
    arrays = {name: array.numpy() for name, array in simulation.kept().items()}
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
        except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
            complaints.append(f"{path}: not a checkpoint that can be read ({error})")
            continue
        for name, values in arrays.items():
            array = kept[name]
            if values.shape != array.numpy().shape:
                raise CheckpointError(f"{path}: made by another scene (its '{name}' has another shape)")
            array.assign(values)
        return
    raise CheckpointError(complaints[0])
