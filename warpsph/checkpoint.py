"""Checkpoints: all that a run needs to go on, bit for bit."""

import os
import zipfile
from pathlib import Path

import numpy as np

from warpsph.state import State

KEPT = 2  # The one before the last survives, should the last be cut short with the machine.


class CheckpointError(Exception):
    """There is no checkpoint to go on from; the text is one line for the user."""


def write_checkpoint(folder: Path, state: State) -> Path:
    """Write the state to `folder`/STEP.npz: first under another name, so that a kill never leaves half a file."""
    arrays = {name: getattr(state, name).numpy() for name in (*State.PARTICLE, *State.CLOCK, "work")}
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


def read_checkpoint(folder: Path, state: State) -> None:
    """Load the last checkpoint of `folder` into `state`.

    Raises:
        CheckpointError: there is none, or it does not fit the scene.
    """
    paths = sorted(folder.glob("*.npz"))
    if not paths:
        raise CheckpointError(f"{folder}: no checkpoint to go on from")
    try:
        with np.load(paths[-1]) as arrays:
            for name in (*State.PARTICLE, *State.CLOCK, "work"):
                array = getattr(state, name)
                if arrays[name].shape != array.numpy().shape:
                    raise CheckpointError(f"{paths[-1]}: made by another scene (its '{name}' has another shape)")
                array.assign(arrays[name])
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise CheckpointError(f"{paths[-1]}: not a checkpoint that can be read ({error})") from None
