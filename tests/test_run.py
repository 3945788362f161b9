"""A run and its folder: nothing foreign is touched, nothing is lost, nothing that was changed goes on unsaid."""

import errno
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from pxr import Usd

from scenes import block, pool, scene, tank
from warpsph.cli import INPUT, MACHINE, OK, SCENES, STOPPED_EARLY, main
from warpsph.output.checkpoint import find_checkpoint
from warpsph.output.claim import LOCK, MARK, FolderError, Lock
from warpsph.output.records import read_record
from warpsph.output.usd import UsdCache
from warpsph.output.usd_check import check_cache
from warpsph.run import Run
from warpsph.scene.loading import load_scene
from warpsph.shapes.mesh import read_mesh

# A dam break that takes a second, without what is drawn of it.
SCENE = scene(
    "A column collapses",
    0.05,
    [tank(0.8, 0.6)],
    [block([0.0, 0.0], [0.2, 0.4])],
    "gauges: [{name: middle, x: 0.4}]",
    "output: {pictures: false, usd: false, checkpoint_every: 0.02, samples_per_second: 100}",
    sound_speed=28.0,
    end_time=0.05,
)

FALLING = scene(
    "A box falls, 10 frames a second",
    0.05,
    [tank(1.0, 2.0)],
    [pool(0.2)],
    "bodies: [{name: box, shape: {box: {min: [0.4, 1.4], max: [0.6, 1.6]}}, mass: 20.0}]",
    "output: {frames_per_second: 10, samples_per_second: 10, pictures: false}",
    sound_speed=40.0,
    end_time=0.5,
)


@pytest.fixture(scope="module")
def scene(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("input") / "dam.yaml"
    path.write_text(SCENE, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def done(scene, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "done"
    assert run("scene", scene, "--out", folder) == OK
    return folder


@pytest.fixture
def folder(done, tmp_path) -> Path:
    """A run folder of its own to each test."""
    return shutil.copytree(done, tmp_path / "run")


def run(*arguments: object) -> int:
    return main([*(str(argument) for argument in arguments), "--threads", "1"])


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def refused(capsys, folder: Path, *arguments: object) -> str:
    """What a command that is refused says, in one line, having touched nothing of `folder`."""
    before = contents(folder)
    capsys.readouterr()
    assert run(*arguments) == INPUT
    told = capsys.readouterr().err.strip()
    assert told and "\n" not in told
    assert contents(folder) == before
    return told


# ------------------------------------------------------------------------------------------------------- foreign files


def test_the_folder_of_the_input_is_never_overwritten(tmp_path, monkeypatch, capsys):
    """A project folder: a scene, a DEM and a report, and the run told to go to it."""
    for name, text in {"scene.yaml": SCENE, "dem.asc": "1 2 3", "report.html": "mine"}.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    for out in (".", tmp_path):
        assert "scene.yaml, the scene to be run" in refused(
            capsys, tmp_path, "scene", "scene.yaml", "--out", out, "--overwrite"
        )


def test_the_scene_of_a_run_is_not_run_into_itself(folder, capsys):
    told = refused(capsys, folder, "scene", folder / "scene.yaml", "--out", folder, "--overwrite")
    assert "the scene to be run" in told


def test_a_folder_without_a_mark_is_not_overwritten(scene, tmp_path, capsys):
    (tmp_path / "scene.yaml").write_text(SCENE)
    assert "holds no run of ours" in refused(capsys, tmp_path, "scene", scene, "--out", tmp_path, "--overwrite")


def test_overwriting_takes_only_what_the_run_wrote(scene, folder):
    foreign = {"dem.asc", "gauges/measured.csv", "preview/poster.png", "checkpoints/notes.txt", "data/x.npz", "my.csv"}
    for name in foreign:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("mine")
    stale = folder / "checkpoints" / "999999999.npz"
    stale.touch()
    assert (folder / "left.csv").exists()
    assert run("scene", scene, "--out", folder, "--overwrite", "--set", "gauges=[{name: other, x: 0.3}]") == OK
    after = contents(folder)
    assert {name for name in foreign if after.get(name) == b"mine"} == foreign
    assert "gauges/other.csv" in after and "gauges/middle.csv" not in after and not stale.exists()


def test_a_foreign_record_is_not_overwritten(scene, folder, capsys):
    (folder / "gauges" / "far.csv").write_text("measured")
    more = ["--set", "gauges=[{name: far, x: 0.3}]"]
    told = refused(capsys, folder, "scene", scene, "--out", folder, "--overwrite", *more)
    assert told.startswith(f"{folder}/gauges/far.csv: was not written by the run here")


def test_a_scene_put_into_a_run_folder_is_foreign(scene, folder, capsys):
    (folder / "scene.yaml").write_text(SCENE)
    assert "not as the run wrote it" in refused(capsys, folder, "scene", scene, "--out", folder, "--overwrite")


@pytest.mark.parametrize("name", ["", "gauges", "gauges/middle.csv", "usd"])
def test_nothing_is_overwritten_through_a_link(name, scene, folder, tmp_path, capsys):
    elsewhere = tmp_path / "elsewhere"
    if (folder / name).exists():
        (folder / name).rename(elsewhere)
    else:
        elsewhere.mkdir()
    (folder / name).symlink_to(elsewhere)
    before = contents(tmp_path)
    assert "is a link" in refused(capsys, folder, "scene", scene, "--out", folder, "--overwrite")
    assert contents(tmp_path) == before


@pytest.mark.parametrize("left", [(), (LOCK,), (LOCK, f"{MARK}.part"), (MARK,)])
def test_a_run_killed_at_its_start_is_taken_up(left, scene, done, tmp_path):
    """Before scene.yaml is written, whatever else is there by then."""
    folder = tmp_path / "run"
    folder.mkdir()
    for name in left:
        shutil.copy(done / MARK, folder / name) if name == MARK else (folder / name).touch()
    assert run("scene", scene, "--out", folder, "--overwrite") == OK
    assert set(contents(folder)) == set(contents(done))


# ---------------------------------------------------------------------------------------------------------- going on


def test_a_finished_run_goes_on_to_a_later_end(scene, folder, tmp_path):
    """From the checkpoint at its end, wherever that lies; with the bits of a run that was never interrupted."""
    assert sorted(path.stem for path in (folder / "checkpoints").glob("*.npz"))
    assert run("resume", folder, "--until", "0.07") == OK
    assert run("scene", scene, "--out", tmp_path / "whole", "--until", "0.07") == OK
    for name in ("energy.csv", "gauges/middle.csv", "fluids/water.csv"):
        assert (folder / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    facts, whole = (json.loads((path / "run.json").read_text()) for path in (folder, tmp_path / "whole"))
    first, second = facts["sessions"]
    assert (first["from [s]"], first["to [s]"], second["from [s]"], second["to [s]"]) == (0.0, 0.05, 0.05, 0.07)
    assert facts["speed"]["steps"] == first["steps"] + second["steps"] == whole["speed"]["steps"]
    assert facts["speed"]["seconds"] == pytest.approx(first["seconds"] + second["seconds"], abs=1e-3)


def test_an_end_before_what_is_reached_is_refused(folder, capsys):
    told = refused(capsys, folder, "resume", folder, "--until", "0.03")
    assert told == f"{folder}: has reached t = 0.05 s, which is beyond 0.03 s; give a later --until"


def test_what_records_have_reached_counts(folder, capsys):
    """A killed run has come farther than its last checkpoint."""
    last = max((folder / "checkpoints").glob("*.npz"))
    last.unlink()
    (folder / "run.json").unlink()
    assert "has reached t = 0.05 s" in refused(capsys, folder, "resume", folder, "--until", "0.045")


def test_a_finished_run_is_not_run_again(folder, capsys):
    assert refused(capsys, folder, "resume", folder).startswith(f"{folder}: is done, at t = 0.05 s")
    (folder / "run.json").unlink()  # killed after the last step: what is missing is made
    assert run("resume", folder) == OK
    assert json.loads((folder / "run.json").read_text())["outcome"] == "done"


def test_no_more_steps_than_allowed(scene, tmp_path, capsys):
    folder = tmp_path / "run"
    assert run("scene", scene, "--out", folder, "--set", "run.max_steps=5") == STOPPED_EARLY
    assert f"by run.max_steps; `resume {folder}` goes on" in capsys.readouterr().err
    assert "all that run.max_steps allows" in refused(capsys, folder, "resume", folder)


def edit(folder: Path, path: str, value: object) -> None:
    data = yaml.safe_load((folder / "scene.yaml").read_text())
    *parents, last = path.split(".")
    part = data
    for name in parents:
        part = part[name]
    part[last] = value
    (folder / "scene.yaml").write_text(yaml.safe_dump(data))


def test_a_changed_scene_is_refused_by_its_fields(folder, capsys):
    edit(folder, "materials.water.density", 1200.0)
    edit(folder, "gravity", 1.62)
    told = refused(capsys, folder, "resume", folder, "--until", "0.07")
    assert "materials.water.density was 1000.0, now 1200.0" in told and "gravity was 9.81, now 1.62" in told


@pytest.mark.parametrize(
    ("path", "value"), [("spacing", 0.04), ("walls", []), ("fluids", []), ("gauges", []), ("output.usd", True)]
)
def test_no_change_of_the_scene_goes_unsaid(path, value, folder, capsys):
    if value == []:  # another name
        value = yaml.safe_load((folder / "scene.yaml").read_text())[path]
        value[0]["name"] = "another"
        if path == "walls":
            value[0]["path"][0][1] = 0.7
    edit(folder, path, value)
    assert path in refused(capsys, folder, "resume", folder, "--until", "0.07")


def test_another_rate_of_frames_is_refused_with_its_cause(scene, tmp_path, capsys):
    folder = tmp_path / "run"
    assert run("scene", scene, "--out", folder, "--set", "output.usd=true") == OK
    edit(folder, "output.frames_per_second", 60.0)
    told = refused(capsys, folder, "resume", folder, "--until", "0.07")
    assert "output.frames_per_second was 30.0, now 60.0" in told
    edit(folder, "output.frames_per_second", 30.0)
    (folder / "usd" / "frames" / "fluid.00001.usdc").unlink()
    before = contents(folder)
    assert run("resume", folder, "--until", "0.07") != OK
    assert "fluid.00001.usdc" in capsys.readouterr().err and contents(folder) == before


def test_changed_outputs_go_on_and_are_named(folder, capsys):
    edit(folder, "output.samples_per_second", 200.0)
    assert run("resume", folder, "--until", "0.07") == OK
    told = "goes on with output.samples_per_second, which was 100.0, now 200.0"
    assert told in capsys.readouterr().err and told in (folder / "log.txt").read_text()  # before the log was open
    times = read_record(folder / "energy.csv")["time [s]"]
    np.testing.assert_allclose(times, [0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.055, 0.06, 0.065, 0.07], rtol=0, atol=1e-9)


def test_a_changed_file_of_the_scene_is_named(tmp_path, capsys):
    """The scene itself is as it was, the table of motion that it names is not."""
    rows = "time,x\n0,0\n1,{}\n"
    (tmp_path / "motion.csv").write_text(rows.format(0.1))
    text = FALLING.replace("mass: 20.0", "mass: 20.0, motion: {kind: table, file: motion.csv}")
    (tmp_path / "pushed.yaml").write_text(text.replace("end_time: 0.5", "end_time: 0.01"))
    folder = tmp_path / "run"
    assert run("scene", tmp_path / "pushed.yaml", "--out", folder, "--set", "output.usd=false") == OK
    (tmp_path / "motion.csv").write_text(rows.format(0.2))
    told = refused(capsys, folder, "resume", folder, "--until", "0.02")
    assert f"files.{tmp_path / 'motion.csv'} was " in told
    (tmp_path / "motion.csv").write_text(rows.format(0.1))
    assert run("resume", folder, "--until", "0.02") == OK


def test_a_report_of_a_cut_run_json_is_refused_in_a_line(folder, capsys):
    (folder / "run.json").write_text('{"title": "A')
    capsys.readouterr()
    assert main(["report", str(folder)]) == INPUT
    told = capsys.readouterr().err.strip()
    assert f"{folder}/run.json" in told and "\n" not in told


def test_a_cache_that_is_taken_away_on_the_way_is_told(tmp_path, monkeypatch, capsys):
    (tmp_path / "falling.yaml").write_text(FALLING)
    write = UsdCache.write

    def lose(cache: UsdCache, *arguments: object) -> Path:
        if cache.frame_count == 2:
            shutil.rmtree(cache.folder)
        return write(cache, *arguments)

    monkeypatch.setattr(UsdCache, "write", lose)
    assert run("scene", tmp_path / "falling.yaml", "--out", tmp_path / "run") == MACHINE
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith(f"{tmp_path}/run/usd")


@pytest.mark.parametrize("part", ["", "fluids", "checkpoints", "preview"])
def test_a_folder_that_is_taken_away_on_the_way_is_told(part, tmp_path, monkeypatch, capsys):
    (tmp_path / "falling.yaml").write_text(FALLING.replace("pictures: false", "pictures: true, checkpoint_every: 0.1"))
    folder, emit = tmp_path / "run", Run._emit

    def lose(run: Run) -> None:
        emit(run)
        if (folder / "preview" / "frame.00001.png").exists():
            shutil.rmtree(folder / part, ignore_errors=True)

    monkeypatch.setattr(Run, "_emit", lose)
    assert run("scene", tmp_path / "falling.yaml", "--out", folder) == MACHINE
    last = capsys.readouterr().err.strip().splitlines()[-1]
    assert last.startswith(str(folder / part)) and last.endswith("No such file or directory")


def test_a_folder_that_cannot_be_written_to_is_told(scene, tmp_path, monkeypatch, capsys):
    def refuse(path: Path, *_: object, **__: object) -> None:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))

    monkeypatch.setattr(Path, "mkdir", refuse)
    assert run("scene", scene, "--out", tmp_path / "run") == MACHINE
    assert capsys.readouterr().err.strip() == f"{tmp_path}/run: Read-only file system"


def test_a_title_may_hold_signs_of_mathematics(tmp_path):
    r"""matplotlib reads $x$ and $\frac$ as TeX, and ends where it cannot."""
    (tmp_path / "tank.yaml").write_text(
        FALLING.replace("A box falls", r"A $x^ and $\frac{ 5 $").replace("false", "true")
    )
    assert run("scene", tmp_path / "tank.yaml", "--out", tmp_path / "run", "--until", "0.1") == OK
    assert r"A $x^ and $\frac{ 5 $" in (tmp_path / "run" / "report.html").read_text()


# ---------------------------------------------------------------------------------------------------------- the lock


def test_a_second_run_in_a_folder_is_refused(scene, folder, capsys):
    first = Run(load_scene(scene), folder, threads=1, overwrite=True)
    for command in (["scene", scene, "--out", folder, "--overwrite"], ["resume", folder]):
        told = refused(capsys, folder, *command)
        assert told.startswith(f"{folder}: process {os.getpid()} on {socket.gethostname()}, since ")
    assert first.execute()["outcome"] == "done"
    assert not (folder / LOCK).exists()
    assert len(read_record(folder / "gauges" / "middle.csv")["time [s]"]) == 6


def test_a_run_in_another_process_is_seen_and_a_dead_one_is_told(scene, tmp_path, capsys):
    folder = tmp_path / "run"
    command = [sys.executable, "-m", "warpsph", "scene", str(scene), "--until", "1000", "--out", str(folder)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with subprocess.Popen([*command, "--threads", "1"], cwd=SCENES.parent, **quiet) as process:
        wait_for_a_checkpoint(folder, process)
        assert run("resume", folder) == INPUT
        assert f"process {process.pid} on " in capsys.readouterr().err
        os.kill(process.pid, signal.SIGKILL)
    reached = read_record(folder / "energy.csv")["time [s]"][-1]
    assert run("resume", folder, "--until", reached + 0.02) == OK
    told = capsys.readouterr().err
    assert f"process {process.pid} on " in told and "ended without a word; its lock is taken over" in told


def test_a_lock_of_another_machine_is_respected(tmp_path):
    """Whether that one lives cannot be told from here."""
    (tmp_path / LOCK).write_text(json.dumps({"process": 1, "host": "elsewhere", "since": "yesterday"}))
    with pytest.raises(FolderError, match=r"process 1 on elsewhere, since yesterday, runs here; if it is dead, delete"):
        Lock(tmp_path)
    (tmp_path / LOCK).write_text("")  # killed before it told who it is
    lock = Lock(tmp_path)
    assert lock.left_by == ""
    lock.release()


def test_a_run_that_cannot_be_set_up_leaves_no_lock(scene, tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    assert run("scene", scene, "--out", folder, "--set", "materials.water.sound_speed=1") == INPUT
    assert not list(folder.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(5))
def test_a_run_killed_at_any_time_goes_on_with_the_same_bits(seed, scene, tmp_path):
    """Six kills in each, at random times from the first checkpoint on; with a cache, which is whole after each."""
    folder, chance = tmp_path / "run", random.Random(seed)
    cache = ["--set", "output.usd=true", "--set", "output.frames_per_second=100"]
    command = [sys.executable, "-m", "warpsph", "scene", str(scene), *cache, "--until", "2", "--out", str(folder)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    for _ in range(6):
        with subprocess.Popen([*command, "--threads", "1"], cwd=SCENES.parent, **quiet) as process:
            wait_for_a_checkpoint(folder, process)
            time.sleep(chance.uniform(0.0, 1.0))
            process.kill()
        assert check_cache(folder / "usd") == []
        command = [sys.executable, "-m", "warpsph", "resume", str(folder), "--until", "2"]
    run("resume", folder, "--until", "2")  # or it had come to its end before it was killed
    assert json.loads((folder / "run.json").read_text())["outcome"] == "done"
    assert run("scene", scene, *cache, "--until", "2", "--out", tmp_path / "whole") == OK
    ours, whole = contents(folder), contents(tmp_path / "whole")
    for name in ("energy.csv", "left.csv", "gauges/middle.csv", "fluids/water.csv", "usd/frames/fluid.00200.usdc"):
        assert ours[name] == whole[name], name


# ------------------------------------------------------------------------------------- stopped, and nobody listening


def wait_for_a_checkpoint(folder: Path, process: subprocess.Popen) -> None:
    deadline = time.monotonic() + 60.0
    while not list((folder / "checkpoints").glob("*.npz")):
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_stops_a_run_at_a_record_with_a_checkpoint(name, scene, tmp_path):
    folder = tmp_path / "run"
    command = [sys.executable, "-m", "warpsph", "scene", str(scene), "--until", "1000", "--out", str(folder)]
    pipe = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # What a shell starts with & ignores Ctrl-C, and so would all that these tests start.
    pipe["preexec_fn"] = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen([*command, "--threads", "1"], cwd=SCENES.parent, **pipe) as process:
        try:
            wait_for_a_checkpoint(folder, process)
            process.send_signal(getattr(signal, name))
            _, told = process.communicate(timeout=60)
        except BaseException:
            process.kill()  # it would be waited for
            raise
    assert process.returncode == STOPPED_EARLY
    facts = json.loads((folder / "run.json").read_text())
    by = "Ctrl-C" if name == "SIGINT" else name
    assert facts["why"] == f"at t = {facts['time [s]']:g} s, by {by}"
    assert f"stopped {facts['why']}; `resume {folder}` goes on" in told and "Traceback" not in told
    assert f"stopped {facts['why']}" in (folder / "log.txt").read_text()
    assert find_checkpoint(folder / "checkpoints").time == facts["time [s]"]


@pytest.mark.parametrize("way", ["gone", "closed", "full"])
def test_a_run_goes_on_though_nobody_listens(way, scene, tmp_path):
    """`2>&1 | head -1`, `>&- 2>&-`, a full disk behind both; with a warning, progress and a summary to be told."""
    folder = tmp_path / "run"
    command = f"{sys.executable} -m warpsph scene {scene} --until 0.2 --out {folder} --threads 1"
    command += " --set materials.water.sound_speed=18"
    ways = {"gone": "2>&1 | :", "closed": ">&- 2>&-", "full": "> /dev/full 2>&1"}
    if way == "full" and not Path("/dev/full").exists():
        pytest.skip("needs /dev/full")
    done = subprocess.run(["bash", "-c", f"set -o pipefail; {command} {ways[way]}"], cwd=SCENES.parent, check=False)
    assert done.returncode == OK
    facts = json.loads((folder / "run.json").read_text())
    assert facts["outcome"] == "done" and facts["warnings"]


def test_a_list_that_is_not_read_to_its_end_is_no_fault():
    command = f"set -o pipefail; {sys.executable} -m warpsph list | :"
    done = subprocess.run(["bash", "-c", command], cwd=SCENES.parent, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (OK, "")


def test_missing_meshio_is_named_by_what_installs_it(monkeypatch, tmp_path):
    (tmp_path / "cube.e").write_text("a format that only meshio knows")
    monkeypatch.setattr(trimesh, "available_formats", lambda: {"stl", "obj"})
    with pytest.raises(ValueError, match=r"python -m pip install meshio$"):
        read_mesh(tmp_path / "cube.e")


# ------------------------------------------------------------------------------------- what is drawn is of its instant


def test_a_body_is_drawn_where_it_was_at_the_instant_of_the_frame(tmp_path):
    """The record is written by the stepping thread itself, the frame by another while steps go on."""
    (tmp_path / "falling.yaml").write_text(FALLING)
    assert run("scene", tmp_path / "falling.yaml", "--out", tmp_path / "run") == OK
    # The box does 125 J of work on water whose own height turns 1 J: the drift is a share of what went through it.
    conservation = json.loads((tmp_path / "run" / "run.json").read_text())["conservation"]
    assert conservation["energy converted"] > 50.0 and conservation["energy drift / converted"] < 0.1
    record = read_record(tmp_path / "run" / "bodies" / "box.csv")
    stage = Usd.Stage.Open(str(tmp_path / "run" / "usd" / "scene.usda"))
    place = stage.GetPrimAtPath("/World/Bodies/box").GetAttribute("xformOp:translate")
    drawn = np.array([place.Get(frame) for frame in range(6)])
    # Records have nine digits; the box falls freely until it meets the water, 0.4 s later.
    np.testing.assert_allclose(drawn[:, [0, 2]].T, [record["x [m]"], record["z [m]"]], rtol=0, atol=1e-8)
    np.testing.assert_allclose(drawn[:4, 2], 1.5 - 0.5 * 9.81 * (0.1 * np.arange(4)) ** 2, rtol=0, atol=1e-5)


def test_a_run_folder_is_the_same_on_any_number_of_threads(tmp_path):
    """All of it, bodies included, but for when and on what it was run."""
    folders = [tmp_path / str(threads) for threads in (1, 2)]
    for folder in folders:
        scene = load_scene(SCENES / "sinking_disc.yaml", ["run.end_time=0.1"])
        Run(scene, folder, threads=int(folder.name)).execute()
    one, two = (contents(folder) for folder in folders)
    for files in (one, two):
        facts = json.loads(files.pop("run.json"))
        for name in ("provenance", "sessions", "speed"):
            del facts[name]
        files["facts"] = json.dumps(facts).encode()
        for name in ("log.txt", "report.html"):
            del files[name]
    assert set(one) == set(two) and {"usd/scene.usda", "bodies/disc.csv", "preview/frame.00003.png"} <= set(one)
    assert [name for name in one if one[name] != two[name]] == []
