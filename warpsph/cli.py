"""The command line: what a user types, and the exit code of whatever happens.

0 done; 1 a validation failed; 2 the user's input; 3 the physics blew up; 4 the machine (disk, memory, device);
5 stopped before the end (a STOP file, run.max_steps, Ctrl-C, a signal): `resume` goes on.
"""

import argparse
import contextlib
import json
import logging
import math
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

import warpsph
from warpsph.output.progress import tell
from warpsph.scene.scene import Scene, SceneError, json_schema, load_scene
from warpsph.scene.source import nearest, show

OK, INVALID, INPUT, BLOWN_UP, MACHINE, STOPPED_EARLY = 0, 1, 2, 3, 4, 5

# No machine has more: threads that share a core get in each other's way.
MOST_CORES = 1024

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
    options = _parser().parse_args(arguments)
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
        return options.command(options)
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


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="warpsph", description="SPH on NVIDIA Warp: waves made by landslides.")
    parser.add_argument("--version", action="version", version=f"warpsph {warpsph.__version__}")
    parser.set_defaults(command=lambda _: _help(parser))
    commands = parser.add_subparsers(metavar="COMMAND")

    def command(name: str, function: Any, help: str) -> argparse.ArgumentParser:
        one = commands.add_parser(name, help=help, description=help)
        one.set_defaults(command=function)
        return one

    scene = command("scene", _scene, "run a scene: records, pictures, a report and a USD cache go to a run folder")
    check = command(
        "check",
        _check,
        "print counts, memory, time step and time of a scene; a few steps are timed, nothing is written; "
        "or look for whatever is wrong with the USD cache of a run folder",
    )
    scene.add_argument("file", type=Path, metavar="SCENE", help="scene file (YAML), or a name that `list` prints")
    check.add_argument("file", type=Path, metavar="SCENE", help="the same, or a run folder")
    check.add_argument("--picture", type=Path, metavar="FILE.png", help="draw the scene as it is set up, too")
    for one in (scene, check):
        one.add_argument(
            "--set", action="append", default=[], metavar="PATH=VALUE", help="override a field of the scene"
        )
        one.add_argument("--until", type=_number, metavar="SECONDS", help="end time instead of the scene's [s]")
    scene.add_argument("--out", type=Path, help="run folder (default: runs/NAME)")
    scene.add_argument("--overwrite", action="store_true", help="replace the run that the folder holds")

    resume = command("resume", _resume, "go on from the last checkpoint of a run, bit for bit")
    resume.add_argument("run", type=Path, help="run folder")
    resume.add_argument("--until", type=_number, metavar="SECONDS", help="end time instead of the scene's [s]")
    validate = command("validate", _validate, "reproduce the case studies: measured against reference, pass or fail")
    validate.add_argument("cases", nargs="*", metavar="CASE", help="cases to run (default: all)")
    validate.add_argument("--list", action="store_true", help="name the cases and run nothing")
    validate.add_argument("--json", type=Path, metavar="FILE", help="write the results to FILE as well")
    validate.add_argument("--out", type=Path, default=Path("runs/validate"), help="folder for the runs")
    for one in (scene, check, resume, validate):
        one.add_argument("--device", default="cpu", help="cpu (default), cuda, cuda:1, ...")
        one.add_argument("--threads", type=_cores, help="CPU threads (default: all cores)")

    surface = command("surface", _surface, "make a mesh of the water's surface, frame by frame, in the cache of a run")
    surface.add_argument("run", type=Path, help="run folder")
    surface.add_argument("--threads", type=_cores, default=os.cpu_count() or 1, help="CPU threads (default: all cores)")

    sweep = command(
        "sweep", _sweep, "run a scene many times with fields varied: all combinations, or samples of ranges"
    )
    sweep.add_argument("file", type=Path, metavar="SCENE", help="scene file (YAML), or a name that `list` prints")
    sweep.add_argument(
        "--set", action="append", default=[], metavar="PATH=A,B,C", help="values of a field, or its range LOW:HIGH"
    )
    sweep.add_argument("--until", type=_number, metavar="SECONDS", help="end time instead of the scene's [s]")
    sweep.add_argument("--samples", type=_positive, help="a Latin hypercube of so many members in the ranges")
    sweep.add_argument("--seed", type=_whole, default=0, help="of the samples (default: 0)")
    sweep.add_argument("--out", type=Path, help="folder for the members (default: runs/NAME_sweep)")
    sweep.add_argument("--workers", type=_cores, help="members at a time; they share the cores (default: a core each)")
    sweep.add_argument("--device", default="cpu", help="cpu (default), cuda, cuda:1, ...")
    sweep.add_argument(
        "--scheduler", metavar="ADDRESS", help="of a Dask cluster that runs the members, such as tcp://..."
    )

    compare = command("compare", _compare, "lay the gauges of runs over each other, with how far each is off the first")
    compare.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="run folders, two or more")
    compare.add_argument("--out", type=Path, default=Path("compare.html"), help="the page (default: compare.html)")

    report = command("report", _report, "write the HTML page of a run again")
    report.add_argument("run", type=Path, help="run folder")
    screen = command(
        "screen", _screen, "the wave of a slide by the hand formulae of VAW-Mitteilungen 254 (2019), with their limits"
    )
    for name, words in {
        "speed": "of the slide's centre at the impact [m/s]",
        "thickness": "of the slide [m]",
        "depth": "of still water [m]",
        "slope": "of its path [degrees]",
        "density": "of the slide with its pores [kg/m3]",
        "width": "of the slide, in a channel of this [m]",
        "volume": "of the slide with its pores [m3]",
    }.items():
        screen.add_argument(f"--{name}", type=_above_zero, required=True, metavar="NUMBER", help=words)
    screen.add_argument(
        "--distance", type=_above_zero, metavar="NUMBER", help="a place to tell the wave of as well [m]"
    )
    screen.add_argument("--basin", action="store_true", help="waves that spread in a basin, not in a channel")
    screen.add_argument(
        "--angle", type=_number, default=0.0, metavar="NUMBER", help="from the slide's axis, of a basin"
    )
    command("list", _list, "name the scenes that ship with warpsph")
    command("schema", _schema, "print the JSON Schema of a scene file, for editors")
    completion = command(
        "completion", lambda _: _completion(commands.choices), "print what completes these words in a shell"
    )
    completion.add_argument("shell", choices=("bash", "zsh"), help='eval "$(warpsph completion bash)" in ~/.bashrc')
    return parser


def _completion(commands: dict[str, argparse.ArgumentParser]) -> int:
    """Print a function of bash, which zsh takes too, that completes commands, options, scenes that ship, and files."""
    options = {
        name: " ".join(word for action in parser._actions for word in action.option_strings)
        for name, parser in commands.items()
    }
    scenes = " ".join(sorted(path.stem for path in SCENES.glob("*.yaml")))
    cases = "\n".join(f"    {name}) words='{words}' ;;" for name, words in options.items())
    _print(f"""\
[ -n "$ZSH_VERSION" ] && autoload -U +X bashcompinit && bashcompinit
_warpsph() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" words=''
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W '{" ".join(commands)} --help --version' -- "$word")); return
  fi
  case "${{COMP_WORDS[1]}}" in
{cases}
  esac
  case "${{COMP_WORDS[1]}}" in scene|check) [ "$COMP_CWORD" -eq 2 ] && words="$words {scenes}" ;; esac
  COMPREPLY=($(compgen -W "$words" -- "$word") $(compgen -f -- "$word"))
}}
complete -o filenames -F _warpsph warpsph""")
    return OK


def _help(parser: argparse.ArgumentParser) -> int:
    parser.print_help()
    return OK


def _positive(text: str) -> int:
    return _whole(text, least=1)


def _cores(text: str) -> int:
    return _whole(text, 1, MOST_CORES)


def _whole(text: str, least: int = 0, most: float = math.inf) -> int:
    if not re.fullmatch(r"\s*[-+]?[0-9]{1,18}\s*", text):
        raise argparse.ArgumentTypeError(f"a whole number is needed, not {show(text)}")
    value = int(text)
    if value < least:
        raise argparse.ArgumentTypeError(f"must be {least} or more, not {value}")
    if value > most:
        raise argparse.ArgumentTypeError(f"must be {most:g} or less, not {value}")
    return value


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"a number is needed, not {show(text)}") from None


def _above_zero(text: str) -> float:
    value = _number(text)
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"must be more than 0, not {text}")
    return value


def _complain(message: str, code: int) -> int:
    tell(f"{message}\n", sys.stderr)
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
    tell(f"{text}\n", sys.stdout)


class _Terminal(logging.Handler):
    """Warnings on the standard error, for as long as anyone reads it."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line."""
        tell(f"{self.format(record)}\n", sys.stderr)


def _log_to_terminal() -> None:
    log = logging.getLogger("warpsph")
    log.setLevel(logging.INFO)
    log.propagate = False
    for old in list(log.handlers):
        log.removeHandler(old)
    handler = _Terminal()
    handler.setLevel(logging.WARNING)
    handler.setFormatter(logging.Formatter("warning: %(message)s"))
    log.addHandler(handler)


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
    from warpsph.run import BLEW_UP, STOPPED

    facts = run.execute()
    told, complaint, code = summary(facts, run.folder), "", OK
    if facts["outcome"] == BLEW_UP:
        complaint, code = f"blew up: {facts['why']}", BLOWN_UP
    if facts["outcome"] == STOPPED:
        complaint, code = f"stopped {facts['why']}; `resume {run.folder}` goes on", STOPPED_EARLY
    with (run.folder / "log.txt").open("a", encoding="utf-8") as log:
        log.write("\n".join(filter(None, (told, complaint))) + "\n")
    _print(told)
    return _complain(complaint, code) if complaint else OK


def summary(facts: dict[str, Any], folder: Path) -> str:
    """What a run came to, for the terminal."""
    speed, conservation = facts["speed"], facts["conservation"]
    lines = [
        f"{facts['title']}: {facts['outcome']} at t = {facts['time [s]']:g} s",
        f"  particles       {facts['counts']['particles']:,} and {facts['counts']['wall points']:,} wall points",
        f"  steps           {speed['steps']:,}, {speed['particle updates per second'] / 1e6:.2f} M particle-updates/s",
        f"  first steps     {speed['seconds to the first steps']:.1f} s after the start",
        f"  whole run       {speed['seconds, all output included']:.1f} s, all output included",
        f"  mass            {conservation['mass / mass placed']:.9f} of what was placed",
        f"  behind walls    {facts['particles behind walls']:,} particles",
    ]
    if left := facts.get("left"):
        unit = next(name for name in left if name.startswith("volume"))
        lines.append(
            f"  left the tank   {left['particles']:,} particles, {left[unit]:.3g} {unit[8:-1]}, "
            f"{left['share of all particles']:.2%} of all, from t = {left['first [s]']:.3f} s on (left.csv)"
        )
        if left["dropped as absurd"]:
            lines.append(f"  dropped         {left['dropped as absurd']:,} of these, which had become absurd")
    if "energy drift / converted" in conservation:
        lines.append(
            f"  energy sum      drifts by {conservation['energy drift / converted']:.2%} of the energy converted"
        )
    for name, gauge in facts["gauges"].items():
        lines.append(
            f"  gauge {name:<9} crest {gauge['crest amplitude [m]']:.4f} m above {gauge['still level [m]']:.4f} m "
            f"at t = {gauge['crest time [s]']:.3f} s{', still rising' if gauge.get('still rising') else ''}"
        )
    lines += _train_lines(facts.get("wave train", {}))
    for name, impact in facts.get("impacts", {}).items():
        lines.append(
            f"  impact of {name:<5} {impact['speed [m/s]']:.3f} m/s at t = {impact['time [s]']:.3f} s, "
            f"Froude number {impact['Froude number']:.3f}, {impact['kinetic energy [J/m]']:.1f} J/m"
        )
    for name, wave in facts.get("waves", {}).items():
        kinetic, potential = wave["kinetic energy [J/m]"], wave["potential energy [J/m]"]
        crest, period = wave["crest amplitude [m]"], wave["period [s]"]
        celerity = f", celerity {wave['celerity [m/s]']:.3f} m/s" if "celerity [m/s]" in wave else ""
        lines += [
            f"  wave at {name:<7} crest {crest:.4f} m, period {period:.2f} s{celerity}",
            f"{'':<18}solitary with R2 = {wave['likeness to a solitary wave, R2']:.3f}",
            f"{'':<18}kinetic {kinetic:.2f} and potential {potential:.2f} J/m, "
            f"{wave['energy / kinetic energy of the impact']:.1%} of the energy of the impact",
        ]
    lines.append(f"  results         {folder}/report.html, {folder}/usd/scene.usda, {folder}/gauges/")
    return "\n".join(lines)


def _train_lines(train: dict[str, Any]) -> list[str]:
    """What a wave maker made, for the terminal."""
    gauges, lines = train.get("gauges", {}), []
    if isinstance(gauges, str):
        return [f"  wave train      {gauges}"]
    for name, gauge in gauges.items():
        period = f", period {gauge['period [s]']:.3f} s" if "period [s]" in gauge else ""
        share = gauge["height / asked for"]
        lines.append(
            f"  waves at {name:<6} height {gauge['height [m]']:.4f} m{period}, {share:.1%} of what was asked for"
        )
    if "reflection" in train:
        found = train["reflection"]
        lines.append(f"  reflection      {found['coefficient']:.1%}, by {found['gauges']}")
    return lines


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
        raise _InputError(f"no validation case named '{unknown[0]}'; there are: {', '.join(CASES)}")
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


def _list(options: argparse.Namespace) -> int:
    for path in sorted(SCENES.glob("*.yaml")):
        _print(f"{path.stem:<18} {load_scene(path).title}")
    _print(f"in {SCENES}")
    return OK


def _schema(options: argparse.Namespace) -> int:
    _print(json.dumps(json_schema(), indent=2))
    return OK
