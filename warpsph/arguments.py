"""What may be typed on the command line: commands, their options, and what completes them in a shell."""

import argparse
import math
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import NoReturn

import warpsph
from warpsph.scene.source import readable, show

# No machine has more: threads that share a core get in each other's way.
MOST_CORES = 1024


class _Parser(argparse.ArgumentParser):
    """One whose complaints are read at a glance, whatever was typed."""

    def error(self, message: str) -> NoReturn:
        """Tell how it is used, and what is wrong, and leave."""
        super().error(readable(message))


def parser() -> argparse.ArgumentParser:
    """What understands the words; `command` is the one that was typed, None where there was none."""
    return _parser_and_commands()[0]


def _parser_and_commands() -> tuple[_Parser, dict[str, _Parser]]:
    parser = _Parser(prog="warpsph", description="SPH on NVIDIA Warp: waves made by landslides.")
    parser.add_argument("--version", action="version", version=f"warpsph {warpsph.__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", dest="command")

    def command(name: str, help: str) -> _Parser:
        return commands.add_parser(name, help=help, description=help)

    scene = command("scene", "run a scene: records, pictures, a report and a USD cache go to a run folder")
    check = command(
        "check",
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

    resume = command("resume", "go on from the last checkpoint of a run, bit for bit")
    resume.add_argument("run", type=Path, help="run folder")
    resume.add_argument("--until", type=_number, metavar="SECONDS", help="end time instead of the scene's [s]")
    validate = command("validate", "reproduce the case studies: measured against reference, pass or fail")
    validate.add_argument("cases", nargs="*", metavar="CASE", help="cases to run (default: all)")
    validate.add_argument("--list", action="store_true", help="name the cases and run nothing")
    validate.add_argument("--json", type=Path, metavar="FILE", help="write the results to FILE as well")
    validate.add_argument("--out", type=Path, default=Path("runs/validate"), help="folder for the runs")
    for one in (scene, check, resume, validate):
        one.add_argument("--device", default="cpu", help="cpu (default), cuda, cuda:1, ...")
        one.add_argument("--threads", type=_cores, help="CPU threads (default: all cores)")

    surface = command("surface", "make a mesh of the water's surface, frame by frame, in the cache of a run")
    surface.add_argument("run", type=Path, help="run folder")
    surface.add_argument("--threads", type=_cores, default=os.cpu_count() or 1, help="CPU threads (default: all cores)")

    sweep = command("sweep", "run a scene many times with fields varied: all combinations, or samples of ranges")
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

    compare = command("compare", "lay the gauges of runs over each other, with how far each is off the first")
    compare.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="run folders, two or more")
    compare.add_argument("--out", type=Path, default=Path("compare.html"), help="the page (default: compare.html)")

    report = command("report", "write the HTML page of a run again")
    report.add_argument("run", type=Path, help="run folder")
    screen = command(
        "screen", "the wave of a slide by the hand formulae of VAW-Mitteilungen 254 (2019), with their limits"
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
    command("list", "name the scenes that ship with warpsph")
    command("schema", "print the JSON Schema of a scene file, for editors")
    completion = command("completion", "print what completes these words in a shell")
    completion.add_argument("shell", choices=("bash", "zsh"), help='eval "$(warpsph completion bash)" in ~/.bashrc')
    return parser, commands.choices


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


def completion(scenes: Iterable[str]) -> str:
    """A function of bash, which zsh takes too, that completes commands, options, `scenes` that ship, and files."""
    commands = _parser_and_commands()[1]
    options = {
        name: " ".join(word for action in parser._actions for word in action.option_strings)
        for name, parser in commands.items()
    }
    cases = "\n".join(f"    {name}) words='{words}' ;;" for name, words in options.items())
    return f"""\
[ -n "$ZSH_VERSION" ] && autoload -U +X bashcompinit && bashcompinit
_warpsph() {{
  local word="${{COMP_WORDS[COMP_CWORD]}}" words=''
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W '{" ".join(commands)} --help --version' -- "$word")); return
  fi
  case "${{COMP_WORDS[1]}}" in
{cases}
  esac
  case "${{COMP_WORDS[1]}}" in scene|check) [ "$COMP_CWORD" -eq 2 ] && words="$words {" ".join(scenes)}" ;; esac
  COMPREPLY=($(compgen -W "$words" -- "$word") $(compgen -f -- "$word"))
}}
complete -o filenames -F _warpsph warpsph"""
