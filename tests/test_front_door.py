"""The front door for a notebook: what `import warpsph` offers, a run folder read back, the page that tells of it."""

import logging
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import warpsph
from warpsph.cli import SCENES
from warpsph.output.records import read_record
from warpsph.output.run_folder import Table

PAGE = (Path(__file__).resolve().parents[1] / "warpsph" / "README.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """The folder in which the page's lines ran, and the names that they left."""
    (lines,) = (block.split("```")[0] for block in PAGE.split("```python\n")[1:])
    folder, names = tmp_path_factory.mktemp("notebook"), {}
    (folder / "scenes").mkdir()
    shutil.copy(SCENES / "landslide.yaml", folder / "scenes")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        logging.getLogger("warpsph").setLevel(logging.NOTSET)  # as a notebook has it
        exec(compile(lines, "warpsph/README.md", "exec"), names)
    return folder, names


def test_the_lines_of_the_page_run(told):
    folder, names = told
    assert "done" in (folder / "runs" / "notebook" / "log.txt").read_text(encoding="utf-8")
    assert names["run"].facts["outcome"] == "done"
    assert names["simulation"].time == pytest.approx(0.02)


def test_records_come_with_their_units(told):
    folder, names = told
    run, gauge = names["run"], names["gauge"]
    assert set(run) == {"energy", "left", "gauges/g12", "gauges/g17", "fluids/slide", "fluids/water"}
    assert gauge.units == {"time": "s", "level": "m"}
    written = read_record(folder / "runs" / "notebook" / "gauges" / "g17.csv")
    np.testing.assert_array_equal(gauge["level"], written["level [m]"])
    assert run["energy"].units["total"] == "J/m"


def test_records_come_as_a_frame(told):
    pandas = pytest.importorskip("pandas")
    gauge = told[1]["gauge"]
    frame = gauge.frame()
    assert isinstance(frame, pandas.DataFrame) and list(frame.columns) == ["level [m]"]
    np.testing.assert_array_equal(frame.index, gauge["time"])
    np.testing.assert_array_equal(frame["level [m]"], gauge["level"])


def test_a_heading_without_a_unit():
    table = Table({"qx": np.zeros(2), "force x [N/m]": np.ones(2)})
    assert table.units == {"qx": "", "force x": "N/m"} and len(table) == 2
    with pytest.raises(KeyError, match="no column 'force'; there are: qx, force x"):
        table["force"]


def test_what_is_not_there_is_named(told, tmp_path):
    with pytest.raises(KeyError, match="no record 'gauges/g18'; there are: energy"):
        told[1]["run"]["gauges/g18"]
    with pytest.raises(FileNotFoundError, match="not a run folder"):
        warpsph.read_run(tmp_path)
    with pytest.raises(AttributeError, match="no attribute 'load'"):
        warpsph.load  # noqa: B018


def test_the_front_door_opens_late():
    """`import warpsph` loads neither Warp nor pydantic, and names all that it offers."""
    words = "import sys, warpsph; assert not {'warp', 'pydantic', 'numpy'} & set(sys.modules); print(*dir(warpsph))"
    found = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True, cwd=SCENES.parent)
    assert {"load_scene", "Simulation", "Run", "read_run"} <= set(found.stdout.split())
    assert all(callable(getattr(warpsph, name)) for name in ("load_scene", "Simulation", "Run", "read_run"))
