"""The command line: what each command leaves behind, and one clear line and a code for each mistake."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import warpsph
from warpsph import cli
from warpsph.cli import BLOWN_UP, INPUT, INVALID, MACHINE, OK, SCENES, STOPPED_EARLY, main
from warpsph.output.records import read_record
from warpsph.output.usd_check import check_cache
from warpsph.scene.loading import load_scene

# A landslide that takes a second: a fifth of the resolution, a twentieth of the time.
COARSE = ["--set", "spacing=0.025", "--until", "0.1"]
LANDSLIDE = str(SCENES / "landslide.yaml")
THIN = ("submarine_slide",)  # what is in it is thinner than the coarsest spacing


def run(*arguments: object) -> int:
    return main([str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "landslide"
    assert run("scene", LANDSLIDE, *COARSE, "--out", folder) == OK
    return folder


@pytest.mark.parametrize("scene", sorted(SCENES.glob("*.yaml")), ids=lambda path: path.stem)
def test_each_scene_that_ships_runs(scene, tmp_path, capsys):
    assert run("check", scene) == OK
    assert "first dt" in capsys.readouterr().out
    loaded = load_scene(scene)
    coarsest = 0.0 if scene.stem in THIN else 0.025
    coarse = ["--set", f"spacing={max(coarsest, 2.0 * loaded.spacing)}", "--until", "0.1"]
    if loaded.warm_up:
        coarse += ["--set", "warm_up.duration=0.02"]
    assert run("scene", scene, *coarse, "--out", tmp_path / "run", "--set", "output.pictures=false") == OK
    facts = json.loads((tmp_path / "run" / "run.json").read_text())
    assert facts["outcome"] == "done"
    assert facts["time [s]"] == 0.1
    assert facts["conservation"]["mass / mass placed"] == pytest.approx(1.0, abs=1e-12)


def test_run_folder_holds_what_the_readme_says(finished):
    records = ["energy.csv", "gauges/g17.csv", "fluids/slide.csv"]
    for name in ["scene.yaml", "run.json", "log.txt", "report.html", *records]:
        assert (finished / name).stat().st_size > 0, name
    assert len(list((finished / "preview").glob("frame.*.png"))) == 4  # t = 0, 1/30, 2/30, 3/30
    assert list((finished / "preview").glob("animation.*")) and (finished / "preview" / "gauges.png").exists()
    assert list((finished / "checkpoints").glob("*.npz"))
    assert check_cache(finished / "usd") == []
    time_column = read_record(finished / "energy.csv")["time [s]"]
    assert (time_column[0], time_column[-1], len(time_column)) == (0.0, 0.1, 21)


def test_the_log_holds_what_the_terminal_showed(tmp_path, capsys):
    slow = ["--set", "materials.water.sound_speed=11", "--set", "allow=[low_sound_speed]"]
    assert run("scene", LANDSLIDE, *COARSE, *slow, "--until", "0.02", "--out", tmp_path / "run") == OK
    shown, log = capsys.readouterr(), (tmp_path / "run" / "log.txt").read_text()
    assert "m/s is too low for" in shown.err
    for line in shown.out.splitlines() + [line for line in shown.err.splitlines() if line.startswith("warning: ")]:
        assert line.removeprefix("warning: ") in log


def test_resume_goes_on_to_a_later_end_with_the_same_bits(finished, tmp_path):
    first, whole = tmp_path / "first", tmp_path / "whole"
    often = [*COARSE, "--set", "output.checkpoint_every=0.05"]
    assert run("scene", LANDSLIDE, *often, "--out", first, "--until", 0.05) == OK
    assert run("resume", first, "--until", 0.1) == OK
    assert run("scene", LANDSLIDE, *often, "--out", whole) == OK
    for name in ("energy.csv", "gauges/g17.csv", "fluids/slide.csv", "usd/frames/fluid.00003.usdc"):
        assert (first / name).read_bytes() == (whole / name).read_bytes(), name


def test_stop_file_ends_a_run(tmp_path):
    folder = tmp_path / "run"
    command = [sys.executable, "-m", "warpsph", "scene", LANDSLIDE, *COARSE, "--until", "1000", "--out", str(folder)]
    with subprocess.Popen(command, cwd=SCENES.parent, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        _wait_for(lambda: (folder / "usd" / "frames" / "fluid.00001.usdc").exists(), process)
        (folder / "STOP").touch()
        assert process.wait(30) == STOPPED_EARLY
    assert json.loads((folder / "run.json").read_text())["outcome"] == "stopped"


def test_cache_of_a_killed_run_holds_every_finished_frame(tmp_path):
    folder = tmp_path / "run"
    command = [sys.executable, "-m", "warpsph", "scene", LANDSLIDE, *COARSE, "--until", "1000", "--out", str(folder)]
    with subprocess.Popen(command, cwd=SCENES.parent, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        _wait_for(lambda: (folder / "usd" / "frames" / "fluid.00003.usdc").exists(), process)
        os.kill(process.pid, signal.SIGKILL)
    assert check_cache(folder / "usd") == []


def _wait_for(is_there, process: subprocess.Popen) -> None:
    deadline = time.monotonic() + 60.0
    while not is_there():
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)


def test_report_can_be_written_again(finished, capsys):
    (finished / "report.html").unlink()
    assert run("report", finished) == OK
    assert (finished / "report.html").exists()


def test_wave_of_a_block_is_told_in_full(tmp_path, capsys):
    """Impact, crest, period, celerity, likeness to a solitary wave, both energies, share: printed, and in run.json."""
    coarse = ["--set", "spacing=0.025", "--set", "output.usd=false", "--until", "1.2"]
    near = ["--set", "gauges=[{name: near, x: 0.6}, {name: next, x: 1.0}]", "--set", "output.pictures=false"]
    assert run("scene", SCENES / "block_maciel.yaml", *coarse, *near, "--out", tmp_path / "run") == OK
    told, facts = capsys.readouterr().out, json.loads((tmp_path / "run" / "run.json").read_text())
    impact = facts["impacts"]["block"]
    assert f"Froude number {impact['Froude number']:.3f}, {impact['kinetic energy [J/m]']:.1f} J/m" in told
    assert set(facts["waves"]) == {"near", "next"}
    for wave in facts["waves"].values():
        assert f"crest {wave['crest amplitude [m]']:.4f} m, period {wave['period [s]']:.2f} s" in told
        assert f"celerity {wave['celerity [m/s]']:.3f} m/s" in told
        assert f"solitary with R2 = {wave['likeness to a solitary wave, R2']:.3f}" in told
        kinetic, potential = wave["kinetic energy [J/m]"], wave["potential energy [J/m]"]
        assert f"kinetic {kinetic:.2f} and potential {potential:.2f} J/m" in told
        share = wave["energy / kinetic energy of the impact"]
        assert share == pytest.approx((kinetic + potential) / impact["kinetic energy [J/m]"])
        assert f"{share:.1%} of the energy of the impact" in told


def test_scenes_and_cases_are_listed(capsys):
    assert run("list") == OK and run("validate", "--list") == OK
    listed = capsys.readouterr().out
    assert listed.count("landslide_0200") == 2 and "still_water" in listed


def test_a_scene_that_ships_goes_by_its_name(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run("check", "still_water", "--set", "spacing=0.05") == OK
    assert "water" in capsys.readouterr().out
    assert run("scene", "landslide", *COARSE, "--until", "0.01", "--set", "output.pictures=false") == OK
    assert (tmp_path / "runs" / "landslide" / "run.json").exists()


def test_check_of_a_run_looks_at_its_cache(finished, tmp_path, capsys):
    assert run("check", finished) == OK
    assert "sound, 4 frames" in capsys.readouterr().out
    broken = tmp_path / "broken"
    shutil.copytree(finished, broken)
    (broken / "usd" / "frames" / "fluid.00002.usdc").unlink()
    assert run("check", broken) == INVALID
    assert "fluid.00002.usdc: missing" in capsys.readouterr().out
    shutil.rmtree(broken / "usd")
    assert run("check", broken) == INPUT
    assert "this run has no USD cache" in capsys.readouterr().err


def test_version_and_help(capsys):
    with pytest.raises(SystemExit) as left:
        run("--version")
    assert left.value.code == 0 and capsys.readouterr().out == f"warpsph {warpsph.__version__}\n"
    assert run() == OK
    assert "run a scene" in capsys.readouterr().out


def test_a_shell_completes_commands_options_scenes_and_files(capsys, tmp_path):
    assert run("completion", "bash") == OK
    script = tmp_path / "completion.sh"
    script.write_text(capsys.readouterr().out)
    (tmp_path / "mine.yaml").touch()
    for words, wanted in (
        (["warpsph", "che"], ["check"]),
        (["warpsph", "scene", "landslide_0"], ["landslide_0175", "landslide_0200"]),
        (["warpsph", "scene", "mine"], ["mine.yaml"]),
        (["warpsph", "resume", "--un"], ["--until"]),
    ):
        asked = (
            f'COMP_WORDS=({" ".join(words)}); COMP_CWORD={len(words) - 1}; _warpsph; printf "%s\\n" "${{COMPREPLY[@]}}"'
        )
        command = ["bash", "-c", f". {script}; {asked}"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
        assert done.stdout.split() == wanted, done.stderr


def test_schema_is_printed(capsys):
    assert run("schema") == OK
    assert json.loads(capsys.readouterr().out)["properties"]["spacing"]["description"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["scene", "nowhere.yaml"], "nowhere.yaml: no such file"),
        (["scene", "landslde"], "landslde: no such file, and no scene of that name ships; did you mean 'landslide'?"),
        (["check", "nowhere"], "no scene of that name ships; `list` names those that ship"),
        (["scene", LANDSLIDE, "--set", "spacing=-1"], "--set spacing=-1: spacing: must be more than 0, not -1"),
        (["scene", LANDSLIDE, "--set", "fluids[1].fill.level=-5"], "nowhere below the level"),
        (["scene", LANDSLIDE, "--set", "materials.water.sound_speed=3"], "m/s is needed"),
        (["scene", LANDSLIDE, "--device", "cuda:7"], "no device named 'cuda:7' here"),
        (["resume", "nowhere"], "nowhere: not a run folder"),
        (["report", "nowhere"], "nowhere: not a finished run"),
        (["validate", "landslde"], "no validation case named 'landslde'; did you mean 'landslide'?"),
        (["validate", "nothing"], "no validation case named 'nothing'; `validate --list` names them"),
        (["check", "still_water", "--device", "x" * 5000], "xxx...xxx"),
    ],
)
def test_mistake_is_one_line_and_writes_nothing(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(*arguments) == INPUT
    complaint = capsys.readouterr().err.strip()
    assert words in complaint and "\n" not in complaint and len(complaint) < 600
    assert not list(tmp_path.iterdir())


def test_a_word_of_thousands_of_letters_is_not_told_whole(capsys):
    with pytest.raises(SystemExit, match=f"^{INPUT}$"):
        run("x" * 5000)
    assert len(capsys.readouterr().err) < 600


def test_a_file_of_results_that_cannot_be_written_is_told_first(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("warpsph.validation.run_case", None)  # would be called only afterwards
    assert run("validate", "still_water", "--json", tmp_path / "no" / "x.json") == MACHINE
    assert capsys.readouterr().err.strip() == f"{tmp_path}/no/x.json: No such file or directory"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("words", [["schema"], ["completion", "bash"], ["list"]])
def test_what_is_asked_for_does_not_vanish_on_a_full_disk(words, monkeypatch, capsys):
    """`schema > file` once ended with 0 and an empty file."""
    with open("/dev/full", "w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        assert run(*words) == MACHINE
    assert capsys.readouterr().err == "standard output: No space left on device\n"


def test_another_run_is_not_overwritten_unasked(finished, tmp_path, capsys):
    before = (finished / "run.json").read_bytes()
    assert run("scene", LANDSLIDE, *COARSE, "--out", finished) == INPUT
    assert "--overwrite" in capsys.readouterr().err
    assert (finished / "run.json").read_bytes() == before
    (tmp_path / "letter.txt").write_text("not a run")
    assert run("scene", LANDSLIDE, *COARSE, "--out", tmp_path, "--overwrite") == INPUT
    assert "holds no run" in capsys.readouterr().err


def test_blow_up_is_told_and_keeps_the_last_good_frame(tmp_path, capsys):
    slow = ["materials.water.sound_speed=1.6", "materials.slide.sound_speed=1.6", "allow=[low_sound_speed]"]
    overrides = [word for field in slow for word in ("--set", field)]
    folder = tmp_path / "run"
    assert run("scene", LANDSLIDE, *COARSE, *overrides, "--until", "1", "--out", folder) == BLOWN_UP
    told = capsys.readouterr().err.strip().splitlines()[-1]
    assert told.startswith("blew up: particle ") and " at t = " in told and "x = " in told
    assert json.loads((folder / "run.json").read_text())["outcome"] == "blew up"
    assert check_cache(folder / "usd") == []


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_ends_any_command_with_a_line(name, monkeypatch, capsys):
    if not hasattr(signal, name) or signal.getsignal(getattr(signal, name)) is signal.SIG_IGN:
        pytest.skip("does not come here")
    monkeypatch.setitem(cli._COMMANDS, "list", lambda _: os.kill(os.getpid(), getattr(signal, name)))
    assert main(["list"]) == STOPPED_EARLY
    assert capsys.readouterr().err == f"stopped {'from the keyboard' if name == 'SIGINT' else f'by {name}'}\n"
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_an_interrupt_while_trimesh_loads_is_not_lost():
    """It takes whatever is raised then for a part that is missing."""
    words = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)
class Interrupter:
    def find_spec(self, name, path=None, target=None):
        if name == "scipy":  # which it looks for whether it is installed or not
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupter())
try:
    import warpsph.shapes.mesh
except KeyboardInterrupt:
    print("stopped")
"""
    done = subprocess.run([sys.executable, "-c", words], cwd=SCENES.parent, capture_output=True, text=True, check=True)
    assert done.stdout == "stopped\n"
