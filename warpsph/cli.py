"""The command line: what a user types, and the exit code of whatever happens.

0 done; 1 a validation failed; 2 the user's input; 3 the physics blew up; 4 the machine (disk, memory, device);
5 stopped before the end (a STOP file, run.max_steps, Ctrl-C, a signal): `resume` goes on.
"""

import argparse
import contextlib
import json
import logging
import os
import re
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from warpsph.arguments import completion, parser
from warpsph.output.progress import tell
from warpsph.scene.loading import json_schema, load_scene
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError, nearest, readable, show

OK, INVALID, INPUT, BLOWN_UP, MACHINE, STOPPED_EARLY = 0, 1, 2, 3, 4, 5

_PACKAGE = Path(__file__).parent
# Beside the package in a wheel, beside its folder in a checkout.
SCENES = next((p for p in (_PACKAGE / "scenes", _PACKAGE.parent / "scenes") if p.is_dir()), _PACKAGE / "scenes")


class _InputError(Exception):
    """A mistake on the command line; the text is one line."""


def main(arguments: Sequence[str] | None = None, began: float | None = None) -> int:
    """Run one command. `began` is when the program started (time.perf_counter) [s]. Returns the exit code."""
    _open_closed_streams()
    if not sys.warnoptions:  # of libraries, about nothing that a user could mend
        warnings.simplefilter("ignore")
    understood = parser()
    options = understood.parse_args(arguments)
    if options.command is None:
        understood.print_help()
        return OK
    options.began = time.perf_counter() if began is None else began
    _log_to_terminal()
    with _signals_as_interrupts():
        try:
            return _run_command(options)
        except KeyboardInterrupt as stop:
            return _complain(f"stopped {_by(stop)}", STOPPED_EARLY)


@contextlib.contextmanager
def _signals_as_interrupts() -> Iterator[None]:
    """What ends a program from outside ends a command as Ctrl-C does; a run holds both back until its next record."""

    def end(number: int, _: object) -> None:
        raise KeyboardInterrupt(f"by {signal.Signals(number).name}")

    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    is_main = threading.current_thread() is threading.main_thread()  # Python hands them to no other
    taken = [number for number in numbers if is_main and signal.getsignal(number) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


def _by(stop: KeyboardInterrupt) -> str:
    return str(stop) or "from the keyboard"


def _run_command(options: argparse.Namespace) -> int:
    from warpsph.device.launch import DeviceError  # the heavy imports come only once the words are understood
    from warpsph.memory import NoRoomError
    from warpsph.output.checkpoint import CheckpointError
    from warpsph.output.claim import FolderError

    try:
        return _COMMANDS[options.command](options)
    except (SceneError, FolderError, CheckpointError, DeviceError, _InputError) as error:
        return _complain(str(error), INPUT)
    except NoRoomError as error:
        return _complain(str(error), MACHINE)
    except (MemoryError, RuntimeError) as error:
        # Warp says so in words.
        if isinstance(error, RuntimeError) and not re.search("failed to allocate|out of memory", str(error), re.I):
            raise
        return _complain(_out_of_memory(options), MACHINE)
    except OSError as error:
        folder = getattr(options, "out", None) or getattr(options, "run", None)  # what a write to a file does not tell
        return _complain(f"{error.filename or folder or 'the machine'}: {error.strerror or error}", MACHINE)


def _complain(message: str, code: int) -> int:
    tell(f"{readable(message)}\n", sys.stderr)
    return code


def _open_closed_streams() -> None:
    """Lead streams that were closed before the program began nowhere: else a file of the run takes their number."""
    if sys.stdout is not None and sys.stderr is not None:
        return
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    sys.stdout = sys.stdout or open(1, "w", closefd=False)  # noqa: SIM115
    sys.stderr = sys.stderr or open(2, "w", closefd=False)  # noqa: SIM115


def _print(text: object) -> None:
    """Tell what was asked for. Raises OSError where the file that should take it is full."""
    if error := tell(f"{text}\n", sys.stdout):
        raise OSError(error.errno, error.strerror, "standard output")


class _Terminal(logging.Handler):
    """Warnings and news of what takes long on the standard error, for as long as anyone reads it."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether it is shown."""
        return record.levelno >= logging.WARNING or record.name == "warpsph.progress"

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line."""
        tell(f"{'warning: ' * (record.levelno >= logging.WARNING)}{self.format(record)}\n", sys.stderr)


def _log_to_terminal() -> None:
    log = logging.getLogger("warpsph")
    log.setLevel(logging.INFO)
    log.propagate = False
    for old in list(log.handlers):
        log.removeHandler(old)
    log.addHandler(_Terminal())


def _scene_file(given: Path) -> Path:
    """The scene file that the user means: a path, or the name of a scene that ships, as `list` prints it."""
    shipped = {path.stem: path for path in SCENES.glob("*.yaml")}
    if given.is_file() or given.suffix or len(given.parts) != 1:
        return given
    if given.name not in shipped:
        known = nearest(given.name, shipped) or "; `list` names those that ship"
        raise _InputError(f"{given}: no such file, and no scene of that name ships{known}")
    return shipped[given.name]


def _load(options: argparse.Namespace) -> Scene:
    options.file = _scene_file(options.file)
    overrides = [*options.set]
    if options.until is not None:
        overrides.append(f"run.end_time={options.until}")
    options.scene = load_scene(options.file, overrides)
    return options.scene


def _out_of_memory(options: argparse.Namespace) -> str:
    """One line for a run that found no more memory."""
    from warpsph.device.launch import Launcher
    from warpsph.memory import out_of_memory

    if not hasattr(options, "scene"):
        return "out of memory"
    return out_of_memory(options.scene, Launcher(options.device, 1).device)


def _scene(options: argparse.Namespace) -> int:
    from warpsph.run import Run

    scene = _load(options)
    folder = options.out or Path("runs") / options.file.stem
    run = Run(
        scene,
        folder,
        device=options.device,
        threads=options.threads,
        overwrite=options.overwrite,
        began=options.began,
        scene_file=options.file,
    )
    return _finish(run)


def _resume(options: argparse.Namespace) -> int:
    from warpsph.run import Run

    file = options.run / "scene.yaml"
    if not file.exists():
        raise _InputError(f"{options.run}: not a run folder (it has no scene.yaml)")
    scene = load_scene(file, [] if options.until is None else [f"run.end_time={options.until}"])
    options.scene = scene
    run = Run(scene, options.run, device=options.device, threads=options.threads, resume=True, began=options.began)
    return _finish(run)


def _finish(run: Any) -> int:
    from warpsph.output.run_folder import BLEW_UP, STOPPED
    from warpsph.output.summary import summary

    facts = run.execute()
    told, complaint, code = summary(facts, run.folder), "", OK
    if facts["outcome"] == BLEW_UP:
        complaint, code = f"blew up: {facts['why']}", BLOWN_UP
    if facts["outcome"] == STOPPED:
        complaint, code = f"stopped {facts['why']}; `resume {run.folder}` goes on", STOPPED_EARLY
    with (run.folder / "log.txt").open("a", encoding="utf-8") as log:
        log.write("\n".join(filter(None, (told, complaint))) + "\n")
    tell(f"{told}\n", sys.stdout)
    return _complain(complaint, code) if complaint else OK


def _check(options: argparse.Namespace) -> int:
    if (options.file / "scene.yaml").exists():
        return _check_cache(options)

    from warpsph.device.launch import Launcher
    from warpsph.forecast import forecast
    from warpsph.output.gauge_waves import read_observed

    if options.picture and (options.picture.suffix != ".png" or not options.picture.absolute().parent.is_dir()):
        raise _InputError(f"{options.picture}: --picture needs a file that ends in .png, in a folder that is there")
    scene = _load(options)
    read_observed(scene)
    launcher = Launcher(options.device, options.threads)
    if options.picture:
        from warpsph.output.writers import picture_setup

        picture_setup(scene, launcher, options.picture)
        _print(f"{options.picture}: drawn")
    facts = forecast(scene, launcher)
    seconds = facts.steps * facts.step_seconds
    _print(f"{scene.title}")
    for name, count in facts.counts.items():
        _print(f"  {name:<15} {count:,} particles")
    _print(f"  wall points     {facts.wall_count:,}")
    if facts.body_points:
        _print(f"  body points     {facts.body_points:,}")
    memory, a_particle = facts.memory, facts.memory.arrays / facts.particle_count
    arrays = f"{memory.arrays / 1e6:,.1f} MB of arrays ({a_particle:.0f} bytes a particle)"
    if memory.shared:
        _print(f"  memory          {memory.host / 1e6:,.0f} MB at most, with {arrays}")
    else:
        _print(f"  memory          {arrays} on the device, {memory.host / 1e6:,.0f} MB at most on the host")
    for name, (own, artificial) in facts.viscosities.items():
        _print(f"  viscosity       {name}: {own:.2e} m2/s of its own, {artificial:.2e} m2/s artificial")
    for name, need in facts.sound.items():
        _print(f"  sound speed     {name}: {need.advised:g} m/s, chosen {need.why}")
    if facts.viscous_stages:
        _print(f"  viscous sweeps  {facts.viscous_stages} a step")
    if scene.wave_maker:
        from warpsph.bodies.wave_maker import in_words

        _print(f"  wave maker      {in_words(scene.wave_maker, scene.run.end_time, scene.gravity)}")
    _print(f"  first dt        {facts.first_dt:.3e} s, about {facts.steps:,} steps")
    by = f"{launcher.threads} thread(s), by the first steps and a coarse rehearsal"
    _print(f"  time            about {_duration(seconds)} on {by}; output not counted")
    for warning in facts.warnings:
        _print(f"  warning: {warning}")
    return OK


def _check_cache(options: argparse.Namespace) -> int:
    from warpsph.output.usd_check import check_cache

    folder = options.file / "usd"
    if options.set or options.until is not None or options.picture:
        raise _InputError("--set, --until and --picture go with a scene, not with a run folder")
    if not (folder / "scene.usda").exists():
        raise _InputError(f"{options.file}: this run has no USD cache")
    problems = check_cache(folder)
    for problem in problems:
        _print(problem)
    if not problems:
        _print(f"{folder}: sound, {len(list((folder / 'frames').glob('fluid.*.usdc')))} frames")
    return INVALID if problems else OK


def _duration(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def _validate(options: argparse.Namespace) -> int:
    from warpsph.validation import CASES, as_dicts, print_table, run_case

    unknown = [name for name in options.cases if name not in CASES]
    if unknown:
        known = nearest(unknown[0], CASES) or "; `validate --list` names them"
        raise _InputError(f"no validation case named {show(unknown[0])}{known}")
    if options.list:
        for name, case in CASES.items():
            _print(f"{name:<20} {case.title}")
        return OK
    if options.json:
        options.json.open("a").close()  # a path that cannot be written to is told now, not after hours
    results = []
    for name in options.cases or CASES:
        tell(f"running {name} ...\n", sys.stderr)
        results += run_case(name, SCENES, options.out, device=options.device, threads=options.threads)
    if options.json:
        options.json.write_text(json.dumps(as_dicts(results), indent=2) + "\n", encoding="utf-8")
    with contextlib.suppress(BrokenPipeError):  # whoever read the table has gone
        print_table(results)
        sys.stdout.flush()
    return INVALID if any(result.verdict == "FAIL" for result in results) else OK


def _report(options: argparse.Namespace) -> int:
    from warpsph.output.report import ReportError, write_report

    if not (options.run / "run.json").exists():
        raise _InputError(f"{options.run}: not a finished run (it has no run.json)")
    try:
        _print(write_report(options.run))
    except ReportError as error:
        return _complain(str(error), INPUT)
    return OK


def _surface(options: argparse.Namespace) -> int:
    from warpsph.output.surface import SurfaceError, make_surface

    folder = options.run / "usd"
    found = []
    try:
        for mesh in make_surface(folder, options.threads):
            found.append(mesh)
            tell(f"frame {mesh.frame}, {mesh.fluid}: moved by {mesh.moved:+.3f} spacings\n", sys.stderr)
    except SurfaceError as error:
        return _complain(str(error), INPUT)
    if not found:
        return _complain(f"{folder}: there is no water in any of its frames", INPUT)
    open_ones = [mesh for mesh in found if not mesh.is_closed]
    low, high = (pick(mesh.share for mesh in found) for pick in (min, max))
    farthest = max(abs(mesh.moved) for mesh in found)
    shares = f"{low:.4f} to {high:.4f} of the volume of the particles"
    _print(f"{folder / 'surface.usda'}: {shares}, for which it was moved by {farthest:.2f} spacings at most")
    for mesh in open_ones:
        _print(f"frame {mesh.frame}, {mesh.fluid}: is not watertight")
    return INVALID if open_ones else OK


def _sweep(options: argparse.Namespace) -> int:
    from warpsph import sweep
    from warpsph.output.pages import PageError

    file = _scene_file(options.file)
    folder = options.out or Path("runs") / f"{file.stem}_sweep"
    workers, threads = sweep.share_cores(options.workers, sweep.core_count())

    def run(todo: Sequence[sweep.Member]) -> Iterator[sweep.MemberResult]:
        if options.scheduler:
            return sweep.run_on_cluster(todo, folder, address=options.scheduler, device=options.device)
        on = {"workers": workers, "threads": threads, "device": options.device}
        return sweep.run_locally(file, todo, folder, **on)

    try:
        settings = sweep.read_settings(options.set)
        if options.samples:
            choices = sweep.latin_hypercube(settings, options.samples, options.seed)
        else:
            choices = sweep.product(settings)
        members = sweep.members(file, choices, options.until)
        if all(member.scene is None for member in members):
            raise sweep.SweepError(members[0].refused)
        order = {member.name: i for i, member in enumerate(members)}
        results = []
        with contextlib.closing(sweep.sweep(members, folder, run)) as ended:  # whatever happens, its members end too
            for result in ended:
                results.append(result)
                why = f", {result.why}" if result.why else ""
                tell(f"{len(results)} of {len(members)}: {result.member.name}: {result.outcome}{why}\n", sys.stderr)
        results.sort(key=lambda result: order[result.member.name])
        title = next(member.scene.title for member in members if member.scene)
        _print(sweep.write_results(results, folder, f"{title}: a sweep"))
    except (sweep.SweepError, PageError) as error:
        return _complain(str(error), INPUT)
    except KeyboardInterrupt as stop:
        raise KeyboardInterrupt(f"{_by(stop)}; the same command goes on with what is left of the sweep") from None
    if any(result.code == MACHINE for result in results):
        return MACHINE
    return OK if all(result.outcome == "done" for result in results) else INVALID


def _compare(options: argparse.Namespace) -> int:
    from warpsph.compare import HEADINGS, CompareError, write_comparison
    from warpsph.output.pages import PageError
    from warpsph.output.plots import split_heading

    if len({run.resolve() for run in options.runs}) < 2:
        raise _InputError("compare needs two run folders or more")
    if not options.out.absolute().parent.is_dir():
        raise _InputError(f"{options.out}: --out needs a folder that is there")
    try:
        found = write_comparison(options.runs, options.out)
    except (CompareError, PageError) as error:
        return _complain(str(error), INPUT)
    for row in found.rows:
        numbers = zip(map(split_heading, HEADINGS[1:]), row[1:], strict=True)
        told = (" ".join((name, f"{value:.4g}", unit)).strip() for (name, unit), value in numbers if value is not None)
        _print(f"{row[0]}: {', '.join(told)}")
    _print(options.out)
    return OK


def _screen(options: argparse.Namespace) -> int:
    from warpsph.theory.impulse import Slide, in_words

    if options.slope > 90.0:
        raise _InputError(f"--slope: must be at most 90 degrees, not {options.slope:g}")
    if options.angle and not options.basin:
        raise _InputError("--angle goes with --basin")
    if abs(options.angle) > 90.0:
        raise _InputError(f"--angle: must be from -90 to 90 degrees, not {options.angle:g}")
    names = ("speed", "thickness", "volume", "density", "slope", "width", "depth")
    slide = Slide(**{name: getattr(options, name) for name in names})
    for line in in_words(slide, options.distance, basin=options.basin, angle=options.angle):
        _print(line)
    return OK


def _completion(options: argparse.Namespace) -> int:
    _print(completion(sorted(path.stem for path in SCENES.glob("*.yaml"))))
    return OK


def _list(options: argparse.Namespace) -> int:
    for path in sorted(SCENES.glob("*.yaml")):
        _print(f"{path.stem:<18} {load_scene(path).title}")
    _print(f"in {SCENES}")
    return OK


def _schema(options: argparse.Namespace) -> int:
    _print(json.dumps(json_schema(), indent=2))
    return OK


_COMMANDS = {
    "scene": _scene,
    "check": _check,
    "resume": _resume,
    "validate": _validate,
    "surface": _surface,
    "sweep": _sweep,
    "compare": _compare,
    "report": _report,
    "screen": _screen,
    "list": _list,
    "schema": _schema,
    "completion": _completion,
}
