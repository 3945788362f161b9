"""A run's claim on its folder: a list of its own files, a lock while it runs, the removal of an earlier run."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import socket
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import warpsph
from warpsph.scene.whole import INSTRUMENTS

try:
    import fcntl
except ImportError:  # not on Windows: there a lock that a crash has left behind is to be deleted by hand
    fcntl = None  # type: ignore[assignment]

MARK, LOCK = ".warpsph", "LOCK"

# All that a run writes beside its frames, by folder; its records, which are named by the user, stand in the mark.
_OWN = {
    "": r"\.sweep|scene\.yaml|run\.json|log\.txt|report\.html|STOP|\.(warpsph|run\.json|scene\.yaml|report\.html|sweep)"
    r"\.part",
    "checkpoints": r"\d{9,}\.(npz|part)",
    **dict.fromkeys(("fluids", "bodies", *INSTRUMENTS), ""),
}
_RECORD = re.compile(rf"(energy|left|(fluids|bodies|{'|'.join(INSTRUMENTS)})/\w+)\.csv")


class FolderError(Exception):
    """The run folder cannot be used; the text is one line for the user."""


@dataclass(frozen=True)
class Mark:
    """What tells a run folder from any other.

    Attributes:
        records: Paths of the records of the run, such as "gauges/g17.csv".
        scene: The SHA-256 of its scene.yaml.
    """

    records: tuple[str, ...]
    scene: str

    @classmethod
    def of(cls, scene: str, records: Iterable[str]) -> Mark:
        """The mark of a run of `scene`, its YAML."""
        return cls(tuple(records), digest(scene.encode()))

    def write(self, folder: Path) -> None:
        """Mark `folder`: before anything else is written there, so that a kill leaves no folder that nobody owns."""
        about = "a run folder: --overwrite takes away what the run has written, and nothing else"
        facts = {"about": about, "warpsph": warpsph.__version__, "scene": self.scene, "records": self.records}
        write_whole(folder / MARK, json.dumps(facts, indent=1) + "\n")


def read_mark(folder: Path) -> Mark | None:
    """The mark of a run folder; None where there is none that can be read."""
    facts = read_json(folder / MARK)
    try:
        records = tuple(str(name) for name in facts["records"])
        return Mark(tuple(name for name in records if _RECORD.fullmatch(name)), str(facts["scene"]))
    except (KeyError, TypeError):
        return None


def refuse_foreign(
    folder: Path, overwrite: bool, scene_file: Path | None, records: Iterable[str], frames: dict[str, str]
) -> None:
    """Raise FolderError unless a new run may write to `folder`: it is new or empty, or holds a run to be replaced.

    `scene_file` is the input of the new run, `records` are the paths of its records, `frames` patterns of the names of
    frames, by folder. Nothing is touched.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        raise FolderError(f"{folder}: is there already and is no folder; choose another --out")
    if not folder.is_dir() or all(entry.name in (LOCK, f"{MARK}.part") for entry in folder.iterdir()):
        return
    if scene_file is not None and folder.resolve() in scene_file.resolve().parents:
        raise FolderError(f"{folder}: holds {scene_file}, the scene to be run; choose another --out")
    mark = read_mark(folder)
    if mark is None:
        has_mark = (folder / MARK).exists()
        why = f"its mark, {MARK}, cannot be read" if has_mark else f"holds no run of ours (it has no {MARK})"
        raise FolderError(f"{folder}: is there already and {why}; choose another --out")
    if not overwrite:
        raise FolderError(f"{folder}: holds another run; give --overwrite to replace it, or another --out")
    for path in (folder, *(folder / name for name in _OWN | frames), *_written(folder, mark, frames)):
        if path.is_symlink():
            raise FolderError(f"{path}: is a link, and nothing is overwritten through one; choose another --out")
    scene = folder / "scene.yaml"
    if scene.exists() and digest(scene.read_bytes()) != mark.scene:
        raise FolderError(f"{scene}: is not as the run wrote it; move it away, or choose another --out")
    for name in records:
        if os.path.lexists(folder / name) and name not in mark.records:
            raise FolderError(f"{folder / name}: was not written by the run here; move it, or choose another --out")


def clear(folder: Path, frames: dict[str, str]) -> None:
    """Take away what an earlier run has written to `folder`, but for its mark; `refuse_foreign` has been asked."""
    mark = read_mark(folder)
    if mark is None:
        return
    for path in _written(folder, mark, frames):
        path.unlink(missing_ok=True)
    for name in sorted(filter(None, _OWN | frames), reverse=True):  # usd/frames before usd
        if (folder / name).is_dir() and not any((folder / name).iterdir()):
            (folder / name).rmdir()


def _written(folder: Path, mark: Mark, frames: dict[str, str]) -> Iterator[Path]:
    """The files of the run that `mark` tells of."""
    for name, own in (_OWN | frames).items():
        if (folder / name).is_dir():
            for path in list((folder / name).iterdir()):
                record = path.with_name(path.name.removeprefix(".").removesuffix(".part"))
                is_record = record.relative_to(folder).as_posix() in mark.records
                if (is_record or re.fullmatch(own, path.name)) and (path.is_symlink() or path.is_file()):
                    yield path


class Lock:
    """The file LOCK of a run folder: it tells who runs there, and goes when the run ends.

    The system itself holds the lock and drops it when the process dies, however that happens. The file that is left
    then tells of the dead run.

    Attributes:
        left_by: Who held it last and died, in words; empty if nobody did.
    """

    def __init__(self, folder: Path) -> None:
        """Take the lock of `folder`. Raises FolderError, of one line, while another process has it."""
        self._path = folder / LOCK
        while True:
            self._file = self._path.open("a+", encoding="utf-8")
            try:
                holder = self._take(folder)
                if os.path.samestat(os.fstat(self._file.fileno()), self._path.stat()):
                    break
            except FileNotFoundError:  # the run before has just let go of it, with the file
                pass
            except BaseException:
                self._file.close()
                raise
            self._file.close()
        self.left_by = _in_words(holder) if holder else ""
        since = datetime.now(UTC).isoformat(timespec="seconds")
        self._file.truncate(0)
        self._file.write(json.dumps({"process": os.getpid(), "host": socket.gethostname(), "since": since}) + "\n")
        self._file.flush()

    def _take(self, folder: Path) -> dict[str, Any]:
        """Take it, and return what it told of its last holder, {} if it told nothing."""
        is_free = fcntl is not None
        if fcntl is not None:
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                is_free = False
        self._file.seek(0)
        text = self._file.read()
        try:
            holder = json.loads(text)
            host = holder["host"]
        except (ValueError, TypeError, KeyError):
            holder, host = {}, socket.gethostname()
        if not is_free and (fcntl is not None or holder):
            who = _in_words(holder) if holder else "another process"
            more = "" if fcntl is not None else f"; if it is dead, delete {self._path}"
            raise FolderError(f"{folder}: {who} runs here{more}; choose another --out")
        if host != socket.gethostname():
            # Whether that one lives cannot be told from here.
            raise FolderError(f"{folder}: {_in_words(holder)} runs here; if it is dead, delete {self._path}")
        return holder

    def release(self) -> None:
        """Let go of it; once is enough."""
        if not self._file.closed:
            self._path.unlink(missing_ok=True)
            self._file.close()


def _in_words(holder: dict[str, Any]) -> str:
    return f"process {holder.get('process')} on {holder.get('host')}, since {holder.get('since')},"


def beside(path: Path) -> Path:
    """Where a file is written before it takes its place."""
    return path.with_name(f".{path.name.removeprefix('.')}.part")


def write_whole(path: Path, text: str) -> None:
    """Write a file beside its place, then rename it: neither a kill nor a full disk leaves half of it."""
    unfinished = beside(path)
    try:
        unfinished.write_text(text, encoding="utf-8")
        os.replace(unfinished, path)
    except OSError as error:
        with contextlib.suppress(OSError):  # what there is of it only fills the disk
            unfinished.unlink()
        raise OSError(error.errno, error.strerror, str(path)) from None


def read_json(path: Path) -> dict[str, Any]:
    """The mapping in a JSON file; {} where there is none that can be read."""
    try:
        facts = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return facts if isinstance(facts, dict) else {}


def digest(data: bytes) -> str:
    """The SHA-256 of a file's bytes, in hexadecimal digits."""
    return hashlib.sha256(data).hexdigest()
