"""Mutated scene files and command lines: refused in words, or good; none hangs, fills memory or writes.

    python tools/fuzz.py                                1,000 scenes and 100 command lines, with seed 0
    python tools/fuzz.py --seed 7 --only scene 412      one member again, with all that it prints

A member is the same for the same seed and number. It runs in a process that is ended after `MOST_SECONDS` of a
processor's time or beyond `MOST_BYTES`; a slow one is tried twice, since the first may have gone to the compiler.
Findings are printed, each on a line; exit code 1 if there are any.
"""

from __future__ import annotations

import argparse
import copy
import json
import os
import random
import re
import select
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).resolve().parents[1]
MOST_SECONDS, MOST_BYTES = 20.0, 2e9
# A line that refuses is read at a glance, and no more of them are told than fit on a page.
MOST_LETTERS, MOST_LINES = 600, 14
# As on a small machine: what takes more is refused, and what is not is set up in seconds [bytes].
FREE_MEMORY = 6e8

# All that a scene may have besides, at once; it is also what the commands run, since it is short.
BASIN = """
title: A basin with everything
spacing: 0.05
materials: {water: {density: 1000.0, sound_speed: 40.0}}
walls: [{name: tank, path: [[-1.0, 0.8], [-1.0, 0.0], [3.0, 0.0], [4.0, 0.8]]}]
fluids: [{name: water, material: water, fill: {level: 0.4, above: tank, between: [0.0, 4.0]}}]
bodies: [{name: box, shape: {box: {min: [1.0, 0.5], max: [1.2, 0.7]}}, density: 500.0, locked: [x], spin: 0.1}]
wave_maker: {waves: regular, x: 0.0, depth: 0.4, height: 0.05, period: 1.2, ramp: 0.5}
damping_zones: [{name: beach, end: 3.5, wavelengths: 0.5}]
gauges: [{name: middle, x: 2.0}]
probes: [{name: corner, at: [3.0, 0.0]}, {name: rider, at: [1.1, 0.5], body: box}]
forces: [{name: slope, wall: tank, part: {min: [3.0, 0.0], max: [4.0, 0.8]}, about: [3.0, 0.0]}]
run_up: [{name: reached, wall: tank, part: {min: [3.0, 0.0], max: [4.0, 0.8]}}]
overtopping: [{name: over, start: [2.0, 0.0], end: [2.0, 0.8]}]
run: {end_time: 0.02, absurd: drop}
output: {frames_per_second: 100, vtk: true, view: {x: [0.0, 4.0], z: [0.0, 1.0]}, speed_scale: 2.0}
"""

NUMBERS = (0, -1, 1, 1e-9, 1e-4, 1e9, 1e300, -1e300, 5e-324, 1e12, -1e8, float("inf"), float("nan"), 2**62, 10**17)
WORDS = (
    "",
    " ",
    "x" * 300,
    "x" * 70,
    "$",
    "$\\frac",
    "\ud800",
    "\x00",
    "../..",
    "é",
    "\u202e",
    "a\nb",
    "true",
    "-",
    "%s{}",
)
SLIDE = ("speed", "thickness", "depth", "slope", "density", "width", "volume", "distance")
LISTS = ("walls", "fluids", "bodies", "damping_zones", "gauges", "probes", "forces", "run_up", "overtopping")
ODD = (None, True, [], {}, [[]], {"a": 1}, [1], "word", [1, 2, 3, 4])


# ------------------------------------------------------------------------------------------------------------- members


def bases() -> dict[str, dict[str, Any]]:
    """The scenes that ship, as coarse as they can be placed, and one that has everything."""
    from warpsph.placement.place import place
    from warpsph.scene.loading import load_scene
    from warpsph.scene.source import SceneError

    found = {"basin": yaml.safe_load(BASIN)}
    for path in sorted((ROOT / "scenes").glob("*.yaml")):
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        data["run"] = {"end_time": 0.02}
        data["output"] = {"frames_per_second": 100}
        data.pop("warm_up", None)
        for times in (6, 5, 4, 3, 2, 1):
            coarse = data | {"spacing": times * data["spacing"]}
            with tempfile.TemporaryDirectory() as folder:
                file = Path(folder, "scene.yaml")
                file.write_text(yaml.safe_dump(coarse), encoding="utf-8")
                try:
                    place(load_scene(file))
                except SceneError:
                    continue
            found[path.stem] = coarse
            break
    return found


def places(data: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The paths of all values in `data`, holders before what they hold."""
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


def at(data: Any, path: tuple[Any, ...]) -> Any:
    """The value at a path."""
    for key in path:
        data = data[key]
    return data


def _number(chance: random.Random, data: dict[str, Any]) -> None:
    """A number becomes another: absurd, or its own thousandfold."""
    numbers = [path for path in places(data) if type(at(data, path)) in (int, float)]
    path = chance.choice(numbers)
    value = at(data, path)
    at(data, path[:-1])[path[-1]] = chance.choice([*NUMBERS, -value, 1e3 * value, 1e-3 * value, 2 * value, 0.5 * value])


def _word(chance: random.Random, data: dict[str, Any]) -> None:
    """A word becomes another."""
    words = [path for path in places(data) if isinstance(at(data, path), str)]
    path = chance.choice(words)
    at(data, path[:-1])[path[-1]] = chance.choice([*WORDS, at(data, path)[:-1]])


def _kind(chance: random.Random, data: dict[str, Any]) -> None:
    """A value becomes one of another kind."""
    path = chance.choice(list(places(data)))
    at(data, path[:-1])[path[-1]] = copy.deepcopy(chance.choice(ODD))


def _lost(chance: random.Random, data: dict[str, Any]) -> None:
    """A value is left out."""
    path = chance.choice(list(places(data)))
    del at(data, path[:-1])[path[-1]]


def _key(chance: random.Random, data: dict[str, Any]) -> None:
    """A key is misspelt, or a strange one comes in."""
    path = chance.choice([path for path in places(data) if isinstance(path[-1], str)])
    holder, key = at(data, path[:-1]), path[-1]
    holder[chance.choice([key[:-1], key + "s", key.upper(), *WORDS])] = holder.pop(key)


def _many(chance: random.Random, data: dict[str, Any]) -> None:
    """A list has its entries many times over, names made new."""
    lists = [path for path in places(data) if isinstance(at(data, path), list) and at(data, path)]
    path = chance.choice([(name,) for name in LISTS if data.get(name)] or lists)
    entries = at(data, path)
    times = min(chance.choice([2, 100, 1000]), 2000 // len(entries))
    made = [copy.deepcopy(entry) for _ in range(times) for entry in entries]
    for i, entry in enumerate(made):
        if isinstance(entry, dict) and "name" in entry:
            entry["name"] = f"n{i}"
    at(data, path[:-1])[path[-1]] = made


def _large(chance: random.Random, data: dict[str, Any]) -> None:
    """All lengths a thousandfold, or a spacing far too fine."""
    if chance.random() < 0.5:
        data["spacing"] = chance.choice([1e-4, 1e-6, 1e-3])
        return
    for name in LISTS:
        for path in places(data.get(name)):
            value = at(data[name], path)
            if type(value) in (int, float) and path[-1] not in ("density", "angle", "mass"):
                at(data[name], path[:-1])[path[-1]] = 1000.0 * value


MUTATIONS: tuple[Callable[[random.Random, dict[str, Any]], None], ...] = (
    *(_number,) * 6,
    *(_word, _kind, _lost, _key) * 2,
    _many,
    _large,
)


def _torn(chance: random.Random, text: str) -> str:
    """A text with an accident: cut, a letter too many or too few, lines twice, anchors in anchors."""
    i = chance.randrange(len(text) + 1)
    lines = text.splitlines(keepends=True)
    return chance.choice(
        [
            text[:i],
            text[:i] + text[i + 1 :],
            text[:i] + chance.choice("\t:[]{}&*!|>%@`'\"#-\x00\x07\u2028\ufeff") + text[i:],
            text.replace(chance.choice(lines), "", 1),
            text + chance.choice(lines),
            "a: &a [x,x,x,x,x,x,x,x,x]\n"
            + "".join(f"{b}: &{b} [{f'*{a},' * 9}]\n" for a, b in zip("abcdefg", "bcdefgh", strict=True))
            + text,
            text * (3_000_000 // len(text)),
        ]
    )


def scene_text(seed: int, number: int, known: dict[str, dict[str, Any]]) -> str:
    """The text of a mutated scene."""
    chance = random.Random(f"scene {seed} {number}")
    data = copy.deepcopy(known[chance.choice(sorted(known))])
    for _ in range(chance.choice([1, 1, 1, 2, 3])):
        try:
            chance.choice(MUTATIONS)(chance, data)
        except (
            IndexError,
            TypeError,
            KeyError,
            AttributeError,
            OverflowError,
        ):  # an earlier one has left nothing for it
            continue
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=chance.random() < 0.5)
    return _torn(chance, text) if chance.random() < 0.1 else text


def scene_command(seed: int, number: int, file: str) -> list[str]:
    """What is done with a scene: most are checked, some are run for a few steps."""
    if random.Random(f"way {seed} {number}").random() < 0.85:
        return ["check", file, "--threads", "1"]
    return ["scene", file, "--threads", "1", "--out", "run", "--until", "1e-4"]


def command_line(seed: int, number: int) -> list[str]:
    """A mutated command line."""
    chance = random.Random(f"command {seed} {number}")
    words = chance.choice(
        [
            ["scene", "basin.yaml", "--out", "run", "--until", "0.001"],
            ["scene", "basin.yaml", "--set", "output.pictures=false", "--until", "0.001", "--overwrite"],
            ["check", "still_water", "--set", "spacing=0.02"],
            ["check", "basin.yaml", "--picture", "x.png"],
            ["check", "run"],
            ["resume", "run", "--until", "1"],
            ["report", "run"],
            ["surface", "run"],
            ["compare", "run", "other", "--out", "page.html"],
            [
                "sweep",
                "basin.yaml",
                "--set",
                "spacing=0.05,0.1",
                "--until",
                "0.001",
                "--out",
                "sweep",
                "--workers",
                "1",
            ],
            ["screen", *(f"--{name}=2" for name in SLIDE)],
            ["completion", "bash"],
            ["validate", "--list"],
            ["validate", "nothing", "--json", "out.json"],
            ["list"],
            ["schema"],
        ]
    )
    odd = [
        "",
        "-",
        "--",
        "-1",
        "0",
        "nan",
        "inf",
        "1e999",
        "x" * 5000,
        "\udcff",
        "a\nb",
        "/dev/null",
        "/",
        "/proc/x/y",
        ".",
    ]
    odd += ["--set", "--until", "--out", "--threads", "--device", "spacing=", "=", "a.b[0]=1", "walls[0].path[0]={}"]
    odd += [
        "spacing=1e-9",
        "run.end_time=1e300",
        "title='$'",
        "fluids[0].fill.level=1e300",
        "cuda:99",
        "99999999999",
        "résumé",
    ]
    for _ in range(chance.choice([1, 1, 2, 3])):
        i, word = chance.randrange(len(words) + 1), chance.choice(odd)
        way = chance.random()
        if way < 0.4:
            words.insert(i, word)
        elif way < 0.8:
            words[i : i + 1] = [word]
        else:
            del words[i : i + 1]
    if words[:1] == ["validate"] and "--list" not in words:  # whatever its words have become: not all cases are run
        words.append("nothing")
    return (
        words
        if "--threads" in words
        else [*words, *(["--threads", "1"] if words[:1] in (["scene"], ["check"]) else [])]
    )


# ------------------------------------------------------------------------------------------------------------- judging


def judge(answer: dict[str, Any], file: str = "") -> list[str]:
    """What is wrong with how a member ended; nothing where all is well."""
    code, told, said = answer["code"], answer["stderr"], answer["stdout"]
    wrong = []
    if answer["traceback"] or "Traceback" in told + said:
        wrong.append("traceback: " + (answer["traceback"] or told).strip().splitlines()[-1][:300])
    if re.search(r"\w*Warning: |<class |<frozen|object at 0x", told + said):
        wrong.append("noise: " + told.strip()[:300])
    refused = code not in (0, 3, 5)
    if refused and not answer["traceback"]:
        lines = told.strip().splitlines()
        usage = bool(lines) and lines[0].startswith("usage:")
        if code not in (2, 4):
            wrong.append(f"exit code {code}: {told[:200]}")
        if not lines or len(lines) > MOST_LINES or (not usage and max(map(len, lines)) > MOST_LETTERS):
            wrong.append(f"{len(lines)} lines of {len(told)} letters: {told[:200]}")
        if file and code == 2 and not usage and file not in told and "--set" not in told:
            wrong.append(f"names no file: {told[:200]}")
        if answer["wrote"]:
            wrong.append(f"refused, and wrote {answer['wrote'][:5]}")
    return wrong


# ------------------------------------------------------------------------------------------------------------- running


def work() -> int:
    """Do as told on standard input, a line of JSON each; the answers, and nothing else, go to standard output."""
    answers = os.fdopen(os.dup(1), "w")
    import warpsph.memory
    from warpsph.cli import main

    free = warpsph.memory.free_memory
    warpsph.memory.free_memory = lambda device: min(FREE_MEMORY, free(device))
    for line in sys.stdin:
        job = json.loads(line)
        with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            os.chdir(folder)
            if "text" not in job:
                Path("basin.yaml").write_text(BASIN)
            else:
                Path("scene.yaml").write_bytes(job["text"].encode("utf-8", "surrogatepass"))
            os.dup2(out.fileno(), 1), os.dup2(err.fileno(), 2)
            code, trace = -1, ""
            try:
                code = main(job["arguments"])
            except SystemExit as left:
                code = left.code if isinstance(left.code, int) else 1
            except BaseException:
                trace = traceback.format_exc()
            sys.stdout.flush(), sys.stderr.flush()
            wrote = sorted(str(path) for path in Path(".").rglob("*") if str(path) not in ("scene.yaml", "basin.yaml"))
            os.chdir("/")
            told = []
            for stream in (out, err):
                stream.seek(0)
                told.append(stream.read(100_000).decode("utf-8", "replace"))
        answer = {"code": code, "traceback": trace, "stdout": told[0], "stderr": told[1], "wrote": wrote}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()
    return 0


class Worker:
    """A process that runs members one by one, and is begun anew when one had to be ended."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[str] | None = None
        self.seconds, self.peak = 0.0, 0.0  # of the last member: a processor's time [s], most memory [bytes]

    def run(self, job: dict[str, Any], most_seconds: float = MOST_SECONDS) -> tuple[dict[str, Any] | None, str]:
        """The answer, or None and why there is none."""
        if self._process is None:
            command = [sys.executable, __file__, "--work"]
            environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "default", "COLUMNS": "100"}
            self._process = subprocess.Popen(
                command, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
            # What is loaded and compiled once is not the member's.
            self.run({"arguments": ["scene", "basin.yaml", "--out", "run", "--threads", "1"]}, 1e3)
        process, began, entered = self._process, self._seconds(), time.monotonic()
        Path(f"/proc/{process.pid}/clear_refs").write_text("5")  # the peak of memory starts anew
        process.stdin.write(json.dumps(job) + "\n")
        process.stdin.flush()
        while not select.select([process.stdout], [], [], 0.05)[0]:
            used = self._bytes()
            if used > MOST_BYTES:
                return None, self._end(f"takes {used / 1e9:.1f} GB")
            if self._seconds() - began > most_seconds or time.monotonic() - entered > 20.0 * most_seconds:
                return None, self._end(f"hangs for {MOST_SECONDS:g} s")
        line = process.stdout.readline()
        self.seconds, self.peak = self._seconds() - began, self._bytes("VmHWM")
        return (json.loads(line), "") if line else (None, self._end("ends the process"))

    def _bytes(self, which: str = "VmRSS") -> float:
        try:
            status = Path(f"/proc/{self._process.pid}/status").read_text()
            return 1024.0 * int(re.search(which + r":\s+(\d+)", status)[1])
        except (OSError, TypeError):
            return 0.0

    def _seconds(self) -> float:
        """Of a processor that the process has had, so that what else runs on the machine does not count."""
        try:
            words = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
            return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")
        except (OSError, IndexError):
            return 0.0

    def _end(self, why: str = "") -> str:
        self._process.kill()
        self._process.wait()
        self._process = None
        return why

    def close(self) -> None:
        """End the process."""
        if self._process:
            self._end()


def main(arguments: list[str]) -> int:
    """Run the members and print what is wrong with them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--commands", type=int, default=100)
    parser.add_argument("--only", nargs=2, metavar=("KIND", "NUMBER"), help="scene or command, and its number")
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.work:
        return work()
    members = [("scene", i) for i in range(options.scenes)] + [("command", i) for i in range(options.commands)]
    if options.only:
        members = [(options.only[0], int(options.only[1]))]
    known, worker, findings, codes = bases(), Worker(), 0, dict[Any, int]()
    began, slowest, largest = time.monotonic(), (0.0, ""), (0.0, "")
    for kind, number in members:
        if kind == "scene":
            text = scene_text(options.seed, number, known)
            job = {"arguments": scene_command(options.seed, number, "scene.yaml"), "text": text}
        else:
            job = {"arguments": command_line(options.seed, number)}
        answer, why = worker.run(job)
        if why.startswith("hangs"):
            answer, why = worker.run(job)
        if options.only:
            print(job.get("text", ""), job["arguments"], json.dumps(answer, indent=2), sep="\n")
        wrong = [why] if answer is None else judge(answer, "scene.yaml" if kind == "scene" else "")
        for one in wrong:
            print(f"{kind} {number}: {one}", flush=True)
        findings += bool(wrong)
        code = answer["code"] if answer else None
        codes[code] = codes.get(code, 0) + 1
        slowest = max(slowest, (worker.seconds, f"{kind} {number}"))
        largest = max(largest, (worker.peak, f"{kind} {number}"))
    worker.close()
    told = ", ".join(f"{count} with exit code {code}" for code, count in sorted(codes.items(), key=str))
    print(f"{len(members)} members in {time.monotonic() - began:.0f} s: {told}; {findings} went wrong")
    print(f"slowest: {slowest[1]}, {slowest[0]:.1f} s; most memory: {largest[1]}, {largest[0] / 1e9:.2f} GB")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
