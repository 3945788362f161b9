"""Sweeps: which members there are, that a sweep goes on and begins anew what was killed, and its table."""

import csv
import errno
import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from scenes import block, scene
from warpsph import sweep
from warpsph.cli import INPUT, INVALID, MACHINE, OK, STOPPED_EARLY, main
from warpsph.output.records import read_record

TANK = scene(
    "A tank",
    0.05,
    [{"name": "tank", "box": {"min": [0.0, 0.0], "max": [1.0, 0.6]}}],
    [block([0.0, 0.0], [0.4, 0.4])],
    "gauges: [{name: far, x: 0.5}]",
    "output: {pictures: false, usd: false}",
    end_time=0.25,
)


@pytest.fixture
def tank(tmp_path) -> Path:
    path = tmp_path / "tank.yaml"
    path.write_text(TANK)
    return path


def test_values_are_read_between_commas_that_are_in_no_bracket():
    words = ["spacing=0.01, 0.02", "fluids[0].velocity=[1,0],[2,0]", "gravity=9.81"]
    assert sweep.read_settings(words) == {
        "spacing": ["0.01", "0.02"],
        "fluids[0].velocity": ["[1,0]", "[2,0]"],
        "gravity": ["9.81"],
    }
    for wrong in ("spacing", "=1", "spacing=1,,2"):
        with pytest.raises(sweep.SweepError, match="PATH=VALUE"):
            sweep.read_settings([wrong])


def test_a_product_has_all_combinations_named_by_what_is_varied(tank):
    choices = sweep.product(
        {"spacing": ["0.05"], "materials.water.alpha": ["0.01", "0.02"], "gravity": ["9", "10", "11"]}
    )
    members = sweep.members(tank, choices)
    assert [member.name for member in members][:2] == ["alpha=0.01,gravity=9", "alpha=0.01,gravity=10"]
    assert len({member.name for member in members}) == 6
    assert {(member.scene.gravity, member.scene.materials["water"].alpha) for member in members} == {
        (gravity, alpha) for gravity in (9.0, 10.0, 11.0) for alpha in (0.01, 0.02)
    }


def test_a_latin_hypercube_has_one_sample_in_each_slice_of_each_range():
    pytest.importorskip("SALib")
    settings = {"gravity": ["9:11"], "materials.water.alpha": ["0.01:0.05"], "spacing": ["0.05"]}
    samples = sweep.latin_hypercube(settings, 8, seed=3)
    assert samples == sweep.latin_hypercube(settings, 8, seed=3)
    for path, low, high in (("gravity", 9.0, 11.0), ("materials.water.alpha", 0.01, 0.05)):
        values = np.array([float(sample[path]) for sample in samples])
        assert sorted(np.floor((values - low) / (high - low) * 8).astype(int)) == list(range(8))
    assert {sample["spacing"] for sample in samples} == {"0.05"}


@pytest.mark.parametrize(
    ("workers", "cores", "shares"), [(None, 8, (8, 1)), (2, 8, (2, 4)), (3, 8, (3, 2)), (9, 4, (4, 1))]
)
def test_workers_share_the_cores(workers, cores, shares):
    assert sweep.share_cores(workers, cores) == shares


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "sweep.csv").open() as file:
        return list(csv.DictReader(file))


def test_a_sweep_has_a_table_tells_what_is_refused_and_goes_on(tank, tmp_path, capsys):
    out = tmp_path / "sweep"
    words = [
        "sweep",
        str(tank),
        "--set",
        "gravity=9.81,4",
        "--set",
        "spacing=0.05,-1",
        "--out",
        str(out),
        "--workers",
        "2",
    ]
    assert main(words) == INVALID
    rows = rows_of(out)
    assert [row["outcome"] for row in rows] == ["done", "refused", "done", "refused"]
    assert "must be more than 0" in rows[1]["why"]
    assert float(rows[0]["gravity"]) == 9.81 and rows[0]["particles"] == "64"
    assert "far: crest [m]" in rows[0]
    assert (out / "sweep.html").read_text().count("<figure>") == 1 + 1
    # A second time nothing is run, and the table is the same.
    marks = [path.stat().st_mtime_ns for path in sorted(out.glob("*/run.json"))]
    table = (out / "sweep.csv").read_bytes()
    assert main(words) == INVALID
    assert "was done already" in capsys.readouterr().err
    assert [path.stat().st_mtime_ns for path in sorted(out.glob("*/run.json"))] == marks
    assert (out / "sweep.csv").read_bytes() == table
    # The same bits as alone.
    alone = tmp_path / "alone"
    assert main(["scene", str(tank), "--set", "gravity=4", "--out", str(alone)]) == OK
    member = out / "gravity=4,spacing=0.05"
    assert (alone / "energy.csv").read_bytes() == (member / "energy.csv").read_bytes()
    assert np.array_equal(*(read_record(one / "gauges/far.csv")["level [m]"] for one in (alone, member)))


def test_a_member_that_is_killed_is_begun_anew(tank, tmp_path, monkeypatch):
    members = sweep.members(tank, sweep.product({"gravity": ["9", "10"]}))
    popen, killed = sweep.subprocess.Popen, []

    def launch(command, **options):
        if not killed:  # the first is killed before it has done anything
            process = popen([sys.executable, "-c", "import time; time.sleep(60)"], **options)
            killed.append(process.pid)
            os.kill(process.pid, signal.SIGKILL)
            return process
        return popen(command, **options)

    monkeypatch.setattr(sweep.subprocess, "Popen", launch)
    found = list(sweep.run_locally(tank, members, tmp_path / "out", workers=1, threads=1, device="cpu"))
    assert [(result.member.name, result.outcome) for result in found] == [("gravity=9", "done"), ("gravity=10", "done")]


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["--set", "spacing"], "PATH=VALUE"),
        (["--set", "spacing=-1,-2"], "must be more than 0"),
        (["--set", "nonsense=1,2"], "no such field"),
        (["--set", "gravity=9,9.0,9"], "is a value given twice"),
        (["--samples", "4", "--set", "gravity=9"], "needs a range"),
        (["--samples", "4", "--set", "gravity=9:8"], "must be less"),
        (["--samples", "99999999", "--set", "gravity=8:9"], "at most 10,000"),
        (["--scheduler", "tcp://127.0.0.1:1", "--set", "gravity=9,8"], "127.0.0.1"),
        (["--scheduler", "nonsense", "--set", "gravity=9,8"], "--scheduler nonsense: "),
    ],
)
def test_mistakes_are_one_line(tank, tmp_path, capsys, words, complaint):
    if "--scheduler" in words:
        pytest.importorskip("distributed")
    assert main(["sweep", str(tank), *words, "--out", str(tmp_path / "out")]) == INPUT
    assert complaint in capsys.readouterr().err.strip().splitlines()[-1]


def test_what_no_sweep_has_written_is_spared(tank, tmp_path, capsys):
    """Told before anything is run."""
    for name in ("sweep.csv", "sweep.json", "sweep.html"):
        folder = tmp_path / name.replace(".", "_")
        folder.mkdir()
        (folder / name).write_text("mine")
        assert main(["sweep", str(tank), "--set", "gravity=9,8", "--out", str(folder)]) == INPUT
        assert f"{name}: is there already, and was not written by a sweep" in capsys.readouterr().err
        assert [path.name for path in folder.iterdir()] == [name] and (folder / name).read_text() == "mine"


def test_members_are_countable_and_their_folders_have_names(tank):
    with pytest.raises(sweep.SweepError, match="1,000,000 combinations; 10,000 are the most"):
        sweep.product({name: ["1"] * 100 for name in "abc"})
    names = [member.name for member in sweep.members(tank, [{"title": "x" * 300}, {"title": "x" * 299 + "y"}])]
    assert len(set(names)) == 2 and max(map(len, names)) <= sweep.LONGEST_NAME


def test_an_interrupt_ends_the_members_too(tank, tmp_path, monkeypatch, capsys):
    popen, begun = sweep.subprocess.Popen, []

    def launch(_, **options):
        begun.append(popen([sys.executable, "-c", "import time; time.sleep(60)"], **options))
        return begun[-1]

    def interrupt(_):
        raise KeyboardInterrupt

    monkeypatch.setattr(sweep.subprocess, "Popen", launch)
    monkeypatch.setattr(sweep.time, "sleep", interrupt)
    words = ["sweep", str(tank), "--set", "gravity=9,8", "--out", str(tmp_path / "out"), "--workers", "1"]
    assert main(words) == STOPPED_EARLY
    assert [process.returncode for process in begun] == [-signal.SIGTERM]
    told = capsys.readouterr().err
    assert told == "stopped from the keyboard; the same command goes on with what is left of the sweep\n"


def test_a_full_disk_is_told_by_members_and_by_the_table(tank, tmp_path, monkeypatch, capsys):
    popen, full = (
        sweep.subprocess.Popen,
        "import sys; print('out: No space left on device', file=sys.stderr); sys.exit(4)",
    )
    monkeypatch.setattr(sweep.subprocess, "Popen", lambda _, **options: popen([sys.executable, "-c", full], **options))
    words = ["sweep", str(tank), "--set", "gravity=9", "--out", str(tmp_path / "out")]
    assert main(words) == MACHINE
    assert "tank: failed, out: No space left on device" in capsys.readouterr().err

    def refuse(path, _):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(sweep, "write_whole", refuse)
    assert main(words) == MACHINE
    assert capsys.readouterr().err.splitlines()[-1].endswith("sweep.csv: No space left on device")
