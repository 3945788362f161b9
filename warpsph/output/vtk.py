"""Particles for ParaView: a file of VTK's XML format for each frame, and one that lists them with their times.

    particles/particles.pvd      what ParaView opens
    particles/fluid.00000.vtu    the particles of one frame

Every file is written under another name and then renamed, the list last: whatever ends the run, it names whole files.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warpsph.output.fields import fields_of

if TYPE_CHECKING:
    from warpsph.output.usd_scenery import Place
    from warpsph.state import Snapshot

# Names of VTK for types of NumPy; numbers are little-endian.
_TYPES = {"<f4": "Float32", "<f8": "Float64", "<i4": "Int32", "<i8": "Int64", "|u1": "UInt8"}
_VERTEX = 1  # a cell of one point


class Particles:
    """Writes the particles of a run, a frame at a time."""

    def __init__(
        self,
        folder: Path,
        *,
        origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
        frames_per_second: float,
        resume_at: int | None = None,
    ) -> None:
        """Frames go to `folder`, which is made when absent; `origin` [m] is from where all points count.

        Frame i is of the time i / `frames_per_second` [s]. `resume_at` is the first frame yet to come of a run that
        goes on.

        Raises:
            OSError: A file could not be written.
        """
        self._folder, self._origin, self._fps = folder, np.array(origin), frames_per_second
        self._frames = [frame for frame in range(resume_at or 0) if (folder / _name(frame)).exists()]
        folder.mkdir(parents=True, exist_ok=True)

    def write(self, frame: int, snapshot: Snapshot, places: Sequence[Place] = ()) -> None:
        """Write a frame, then the list that names it.

        Raises:
            OSError: The file could not be written.
        """
        count = len(snapshot.position)
        points = {"points": snapshot.position + self._origin}
        cells = {
            "connectivity": np.arange(count, dtype=np.int64),
            "offsets": np.arange(1, count + 1, dtype=np.int64),
            "types": np.full(count, _VERTEX, dtype=np.uint8),
        }
        parts = {"Points": points, "Cells": cells, "PointData": fields_of(snapshot)}
        _publish(self._folder / _name(frame), _unstructured_grid(count, parts))
        self._frames.append(frame)
        rows = "".join(f'<DataSet timestep="{i / self._fps:.9g}" part="0" file="{_name(i)}"/>\n' for i in self._frames)
        text = f'<VTKFile type="Collection" version="1.0">\n<Collection>\n{rows}</Collection>\n</VTKFile>\n'
        _publish(self._folder / "particles.pvd", text.encode())

    def finish(self) -> None:
        """Nothing is left to write."""


def _name(frame: int) -> str:
    return f"fluid.{frame:05d}.vtu"


def _unstructured_grid(count: int, parts: dict[str, dict[str, np.ndarray]]) -> bytes:
    """The bytes of a .vtu file: what its arrays are, then their numbers, each array behind its length in bytes."""
    head, data, offset = [], [], 0
    for part, arrays in parts.items():
        head.append(f"<{part}>")
        for name, values in arrays.items():
            values = np.ascontiguousarray(values)
            values = values.astype(values.dtype.newbyteorder("<"), copy=False)
            width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
            kind = _TYPES[values.dtype.str]
            head.append(f'<DataArray type="{kind}" Name="{name}"{width} format="appended" offset="{offset}"/>')
            data += [values.nbytes.to_bytes(8, "little"), values.tobytes()]
            offset += 8 + values.nbytes
        head.append(f"</{part}>")
    body = "\n".join(head)
    text = (
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">\n'
        f'<UnstructuredGrid>\n<Piece NumberOfPoints="{count}" NumberOfCells="{count}">\n{body}\n</Piece>\n'
        '</UnstructuredGrid>\n<AppendedData encoding="raw">\n_'
    )
    return text.encode() + b"".join(data) + b"\n</AppendedData>\n</VTKFile>\n"


def _publish(path: Path, content: bytes) -> None:
    """Write a file beside its place, then rename it: neither a reader nor a kill ever meets half a file."""
    partial = path.with_name(f".{path.name}")
    partial.write_bytes(content)
    os.replace(partial, path)
