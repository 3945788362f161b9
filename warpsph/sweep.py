"""A sweep: one scene with fields varied, a run folder for each member, one table and plots over each variable.

Members run in processes of their own on this machine, or on the workers of a Dask cluster that see the same disk. Those
that are done are left alone, so that a sweep that was cut short goes on; one whose process or worker was killed is run
again.
"""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from warpsph.output.claim import digest, read_json, write_whole
from warpsph.output.gauge_waves import describe_gauge
from warpsph.output.pages import is_ours, write_table
from warpsph.output.plots import line_colors, name_lines, small_plot
from warpsph.output.records import read_records
from warpsph.scene.loading import load_scene
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError

ATTEMPTS = 3  # of a member whose process is killed
PERIOD = 0.1  # at which processes are looked after [s]
DIGEST = ".sweep"  # the file in a member's folder that tells which scene it was run with
PAGE, TABLES = "sweep.html", ("sweep.csv", "sweep.json")  # what comes of it
GAUGE = ("crest [m]", "arrival [s]", "trough [m]", "period [s]")
# More members than this are a slip: each has a folder, and a row of the table.
MOST_MEMBERS = 10_000
# A longer name is longer than the name of a folder may be.
LONGEST_NAME = 120
_RANGE = re.compile(r"([-+.\deE]+):([-+.\deE]+)")
_ONE_AT_A_TIME = threading.Lock()  # in a worker: a member has all of its threads


class SweepError(ValueError):
    """The sweep cannot be made; the text is one line for the user."""


@dataclass(frozen=True)
class Member:
    """One run of a sweep.

    Attributes:
        name: Of its folder.
        values: Of the fields that are varied, by their path.
        overrides: All fields that are set, as on the command line.
        scene: None where it is refused.
        refused: Why.
    """

    name: str
    values: dict[str, str]
    overrides: tuple[str, ...]
    scene: Scene | None
    refused: str = ""


@dataclass
class MemberResult:
    """What became of a member; `code` is the exit code of one that failed, 0 where it has none."""

    member: Member
    outcome: str
    why: str = ""
    code: int = 0


def read_settings(settings: Sequence[str]) -> dict[str, list[str]]:
    """The values of each field, from words such as "spacing=0.01,0.02"; commas in brackets belong to a value.

    Raises SweepError for words without a path or a value.
    """
    found: dict[str, list[str]] = {}
    for words in settings:
        path, equals, values = words.partition("=")
        parts = _split(values)
        if not (path and equals and all(parts)):
            raise SweepError(f"--set {words}: PATH=VALUE,VALUE,... is needed")
        if path in found:
            raise SweepError(f"--set {words}: {path} is set already")
        found[path] = parts
    return found


def _split(text: str) -> list[str]:
    """The parts between commas that are in no bracket."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "[{(") - (letter in "]})")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return [part.strip() for part in parts]


def product(settings: dict[str, list[str]]) -> list[dict[str, str]]:
    """All combinations of values. Raises SweepError where they are more than anybody wants."""
    if (count := math.prod(map(len, settings.values()))) > MOST_MEMBERS:
        raise SweepError(f"--set: {count:,} combinations; {MOST_MEMBERS:,} are the most")
    return [dict(zip(settings, values, strict=True)) for values in itertools.product(*settings.values())]


def latin_hypercube(settings: dict[str, list[str]], count: int, seed: int) -> list[dict[str, str]]:
    """So many samples of the ranges LOW:HIGH, each of them divided evenly (McKay, Beckman & Conover 1979), by SALib.

    Raises SweepError where there is no range, or a list of values, or SALib is missing.
    """
    ranges = {path: found for path, (value, *_) in settings.items() if (found := _RANGE.fullmatch(value))}
    if not ranges:
        raise SweepError("--samples needs a range, such as --set spacing=0.01:0.02")
    for path, values in settings.items():
        if len(values) > 1:
            raise SweepError(f"--set {path}: with --samples it is one value or a range LOW:HIGH")
    if count > MOST_MEMBERS:
        raise SweepError(f"--samples: must be at most {MOST_MEMBERS:,}, not {count:,}")
    bounds = [[float(found[1]), float(found[2])] for found in ranges.values()]
    for path, (low, high) in zip(ranges, bounds, strict=True):
        if not low < high:
            raise SweepError(f"--set {path}: the first end of a range must be less than the second")
    try:
        from SALib.sample import latin
    except ImportError:
        raise SweepError("--samples needs SALib: python -m pip install SALib") from None
    problem = {"num_vars": len(ranges), "names": list(ranges), "bounds": bounds}
    samples = latin.sample(problem, count, seed=seed)
    fixed = {path: values[0] for path, values in settings.items() if path not in ranges}
    return [fixed | {path: f"{x:.6g}" for path, x in zip(ranges, sample, strict=True)} for sample in samples]


def members(file: Path, choices: Sequence[dict[str, str]], until: float | None = None) -> list[Member]:
    """The members of a sweep over `choices`: values by the path of their field. A scene that is refused tells why."""
    varied = [path for path in choices[0] if len({choice[path] for choice in choices}) > 1]
    short = {path: path.rpartition(".")[2] for path in varied}
    labels = short if len(set(short.values())) == len(short) else {path: path for path in varied}
    found, seen = [], set()
    for choice in choices:
        name = ",".join(f"{labels[path]}={choice[path]}" for path in varied) or file.stem
        name = re.sub(r"[^\w.,=+\[\]-]+", "_", name)
        if len(name.encode()) > LONGEST_NAME:
            name = f"{name.encode()[: LONGEST_NAME // 2].decode(errors='ignore')}...{digest(name.encode())[:8]}"
        if name in seen:
            raise SweepError(f"two members would be called {name}; is a value given twice?")
        seen.add(name)
        overrides = [f"{path}={value}" for path, value in choice.items()]
        overrides += [] if until is None else [f"run.end_time={until}"]
        values = {path: choice[path] for path in varied}
        try:
            found.append(Member(name, values, tuple(overrides), load_scene(file, overrides)))
        except SceneError as error:
            found.append(Member(name, values, tuple(overrides), None, str(error)))
    return found


def is_done(member: Member, folder: Path) -> bool:
    """Whether the member has been run to its end, as it is now."""
    mark = folder / member.name / DIGEST
    if member.scene is None or not mark.exists() or mark.read_text(encoding="utf-8") != _digest(member.scene):
        return False
    return read_json(folder / member.name / "run.json").get("outcome") == "done"


def _digest(scene: Scene) -> str:
    return digest(scene.resolved_yaml().encode())


def share_cores(workers: int | None, cores: int) -> tuple[int, int]:
    """How many workers, and threads of each: all cores between them."""
    workers = min(workers or cores, cores)
    return workers, max(1, cores // workers)


def run_locally(
    file: Path, todo: Sequence[Member], folder: Path, *, workers: int, threads: int, device: str
) -> Generator[MemberResult]:
    """Run members in processes of their own, `workers` at a time; one that is killed is begun anew."""
    waiting = [(member, 1) for member in todo]
    running: dict[subprocess.Popen[str], tuple[Member, int]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                member, attempt = waiting.pop(0)
                command = [sys.executable, "-m", "warpsph", "scene", str(file), "--out", str(folder / member.name)]
                command += [part for override in member.overrides for part in ("--set", override)]
                command += ["--overwrite", "--device", device, "--threads", str(threads)]
                process = subprocess.Popen(
                    command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
                )
                running[process] = member, attempt
            time.sleep(PERIOD)
            for process in [one for one in running if one.poll() is not None]:
                member, attempt = running.pop(process)
                said = (process.stderr.read() if process.stderr else "").strip().splitlines()
                if process.returncode < 0 and attempt < ATTEMPTS:
                    waiting.insert(0, (member, attempt + 1))
                    continue
                if process.returncode == 0:
                    _mark(member, folder)
                    yield MemberResult(member, "done")
                else:
                    why = said[-1] if said else f"exit code {process.returncode}"
                    yield MemberResult(member, "failed", why, process.returncode)
    finally:
        for process in running:
            process.terminate()  # ends at its next record, with a checkpoint
        for process in running:
            process.wait()


def run_on_cluster(todo: Sequence[Member], folder: Path, *, address: str, device: str) -> Generator[MemberResult]:
    """Run members on the workers of a Dask cluster, one at a time on each, with all of its threads.

    Raises SweepError where there is no Dask, or no cluster at `address`.
    """
    try:
        from distributed import Client, as_completed
    except ImportError:
        raise SweepError("--scheduler needs Dask: python -m pip install distributed") from None
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:  # nobody answers, or it is no address
        raise SweepError(f"--scheduler {address}: {error}") from None
    with client:
        by_key = {}
        waiting = list(todo)

        def submit() -> Any:
            member = waiting.pop(0)
            text = member.scene.resolved_yaml() if member.scene else ""
            out = str((folder / member.name).resolve())
            future = client.submit(
                run_member, text, out, device, key=f"{member.name}-{digest(text.encode())}", retries=0
            )
            by_key[future.key] = member
            return future

        slots = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
        busy = as_completed([submit() for _ in range(min(slots, len(waiting)))])
        for future in busy:
            member = by_key[future.key]
            if future.status == "error":
                yield MemberResult(member, "failed", str(future.exception()).splitlines()[0])
            else:
                outcome, why = future.result()
                if outcome == "done":
                    _mark(member, folder)
                yield MemberResult(member, outcome if outcome == "done" else "failed", why)
            if waiting:
                busy.add(submit())


def run_member(text: str, folder: str, device: str) -> tuple[str, str]:
    """Run a scene, given as YAML, in the process that calls, and return its outcome and why. What a worker does."""
    from distributed import get_worker

    from warpsph.run import Run

    with _ONE_AT_A_TIME:
        file = Path(f"{folder}.scene.yaml")
        write_whole(file, text)
        scene = load_scene(file)
        file.unlink()
        run = Run(scene, folder, device=device, threads=get_worker().state.nthreads, overwrite=True)
        facts = run.execute()
        return facts["outcome"], facts["why"]


def _mark(member: Member, folder: Path) -> None:
    if member.scene is not None:
        write_whole(folder / member.name / DIGEST, _digest(member.scene))


def sweep(
    todo: Sequence[Member], folder: Path, run: Callable[[Sequence[Member]], Iterator[MemberResult]]
) -> Generator[MemberResult]:
    """All members in turn: those that are done or refused at once, the others as `run` ends them.

    Raises SweepError, before anything is run, where results would take the place of files that no sweep has written.
    """
    if os.path.lexists(folder) and not folder.is_dir():
        raise SweepError(f"{folder}: is there already and is no folder; choose another --out")
    for name in (PAGE, *TABLES):
        if (folder / name).exists() and not is_ours(folder / PAGE):
            raise SweepError(f"{folder / name}: is there already, and was not written by a sweep; choose another --out")
    folder.mkdir(parents=True, exist_ok=True)
    left = []
    for member in todo:
        if member.scene is None:
            yield MemberResult(member, "refused", member.refused)
        elif is_done(member, folder):
            yield MemberResult(member, "done", "was done already")
        else:
            left.append(member)
    if left:
        yield from run(left)


# --------------------------------------------------------------------------------------------------- table and plots


def tabulate(results: Sequence[MemberResult], folder: Path) -> tuple[list[str], list[list[Any]]]:
    """The headings and the rows of the table: what was varied, what came out at each gauge, how the run went."""
    varied = list(results[0].member.values)
    numbers = [_numbers(folder / result.member.name) if result.outcome == "done" else {} for result in results]
    columns = list(dict.fromkeys(name for row in numbers for name in row))
    rows = [
        [
            result.member.name,
            *(_value(result.member.values[path]) for path in varied),
            result.outcome,
            *(row.get(column) for column in columns),
            "" if result.outcome == "done" else result.why,
        ]
        for result, row in zip(results, numbers, strict=True)
    ]
    return ["member", *varied, "outcome", *columns, "why"], rows


def _value(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text


def _numbers(folder: Path) -> dict[str, float]:
    """What a run came to."""
    found: dict[str, float] = {}
    for gauge, record in read_records(folder.glob("gauges/*.csv"), "level [m]").items():
        wave = describe_gauge(*record.values())
        found |= {f"{gauge}: {name}": wave[name] for name in GAUGE if name in wave}
    facts = read_json(folder / "run.json")
    for name, impact in facts.get("impacts", {}).items():
        found[f"{name}: impact [m/s]"] = impact["speed [m/s]"]
    found["particles"] = facts["counts"]["particles"]
    drift = facts["conservation"].get("energy drift / converted")
    return found | ({} if drift is None else {"energy drift / converted": drift})


def plots_over(
    headings: Sequence[str], rows: Sequence[Sequence[Any]], varied: Sequence[str]
) -> list[tuple[str, Figure]]:
    """The crests of all gauges over each variable that is a number; one figure for each."""
    crests = [heading for heading in headings if heading.endswith(": crest [m]")]
    figures = []
    for path in varied:
        at = headings.index(path)
        shown = [row for row in rows if isinstance(row[at], float)]
        if not (crests and shown):
            continue
        figure, axes = small_plot()
        for heading, color in zip(crests, line_colors(len(crests)), strict=True):
            points = [(row[at], row[headings.index(heading)]) for row in shown]
            points = [point for point in points if point[1] is not None]
            axes.plot(*zip(*sorted(points), strict=True), "o", color=color, markersize=5, label=heading.split(":")[0])
        axes.set(xlabel=path, ylabel="crest [m]")
        name_lines(figure, axes)
        figures.append((f"Crests over {path}", figure))
    return figures


def write_results(results: Sequence[MemberResult], folder: Path, title: str) -> Path:
    """Write sweep.csv, sweep.json and sweep.html into the folder of the sweep, members in the order of their making.

    Returns the page. Raises PageError where a page of another kind is in its place.
    """
    varied = list(results[0].member.values)
    headings, rows = tabulate(results, folder)
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerows([headings, *rows])
    facts = [{"member": one.member.name, "values": one.member.values, "outcome": one.outcome} for one in results]
    done = sum(result.outcome == "done" for result in results)
    links = {one.member.name: f"{one.member.name}/report.html" for one in results if one.outcome == "done"}
    page = folder / PAGE
    words = [f"{done} of {len(results)} members are done; the table is in sweep.csv too."]
    figures = plots_over(headings, rows, varied)
    write_table(page, title=title, words=words, headings=headings, rows=rows, links=links, figures=figures)
    for name, written in zip(TABLES, (text.getvalue(), json.dumps(facts, indent=1) + "\n"), strict=True):
        write_whole(folder / name, written)
    return page


def core_count() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
