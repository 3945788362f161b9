"""A run folder read back, for a notebook: its records as arrays by name, with their units, and what run.json tells."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsph.output.records import read_record

if TYPE_CHECKING:
    import pandas

# How a run may end, as run.json tells.
DONE, STOPPED, BLEW_UP = "done", "stopped", "blew up"

_HEADING = re.compile(r"(?P<name>.*?)(?: \[(?P<unit>.*)\])?")


class Table(Mapping[str, np.ndarray]):
    """One record: its columns by name, each of shape [row_count].

    Attributes:
        units: The unit of each column by its name, "" where a heading has none.
    """

    def __init__(self, columns: Mapping[str, np.ndarray]) -> None:
        """Take columns by their heading, such as "level [m]"."""
        self._columns: dict[str, np.ndarray] = {}
        self.units: dict[str, str] = {}
        for heading, values in columns.items():
            found = _HEADING.fullmatch(heading)
            name, unit = (found["name"], found["unit"] or "") if found else (heading, "")
            self._columns[name], self.units[name] = values, unit

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._columns:
            raise KeyError(f"no column '{name}'; there are: {', '.join(self._columns)}")
        return self._columns[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __repr__(self) -> str:
        return f"Table({', '.join(f'{name} [{unit}]' for name, unit in self.units.items())})"

    def frame(self) -> pandas.DataFrame:
        """The same as a pandas frame: the time [s] is its index, the headings with their units name its columns.

        Raises ImportError where pandas is not installed.
        """
        import pandas

        headings = {f"{name} [{unit}]" if unit else name: self._columns[name] for name, unit in self.units.items()}
        frame = pandas.DataFrame(headings)
        return frame.set_index("time [s]") if "time [s]" in frame else frame


@dataclass(frozen=True)
class RunFolder(Mapping[str, Table]):
    """What a run has written: its records by the path of their file without .csv, such as "gauges/g17" or "energy".

    Attributes:
        folder: Where it lies.
        facts: What run.json holds; empty while the run goes on.
        records: The records by name.
    """

    folder: Path
    facts: Mapping[str, Any]
    records: Mapping[str, Table]

    def __getitem__(self, name: str) -> Table:
        if name not in self.records:
            raise KeyError(f"no record '{name}'; there are: {', '.join(self.records)}")
        return self.records[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.records)

    def __len__(self) -> int:
        return len(self.records)


def read_run(folder: Path | str) -> RunFolder:
    """Read the records of a run, finished or not, and its facts.

    Raises FileNotFoundError where `folder` is no run folder.
    """
    folder = Path(folder)
    if not (folder / "scene.yaml").exists():
        raise FileNotFoundError(f"{folder}: not a run folder (it has no scene.yaml)")
    file = folder / "run.json"
    facts = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    paths = sorted([*folder.glob("*.csv"), *folder.glob("*/*.csv")])
    records = {path.relative_to(folder).with_suffix("").as_posix(): Table(read_record(path)) for path in paths}
    return RunFolder(folder, facts, records)
