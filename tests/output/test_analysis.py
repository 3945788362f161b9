"""What run.json tells of instruments and of made waves, of records that are written here."""

import csv
import math

import numpy as np
import pytest

from scenes import pool, scene, tank
from warpsph.output.analysis import analysis, instrument_plots
from warpsph.theory.waves import wavelength

FLUME = scene(
    "A flume",
    0.02,
    [tank(9.6, 0.5, left=-0.6, name="flume")],
    [pool(0.3, "flume", between=[0.0, 9.0])],
    "wave_maker: {waves: regular, x: 0.0, depth: 0.3, height: 0.02, period: 1.2}",
    "gauges: [{name: a, x: 2.0}, {name: b, x: 2.2}, {name: c, x: 2.55}]",
    "probes: [{name: p, at: [1.0, 0.1]}]",
    "run_up: [{name: end, wall: flume}]",
    end_time=20.0,
)


@pytest.fixture
def write(tmp_path):
    """A function that writes a record by its path and its columns."""

    def make(name: str, **columns: np.ndarray) -> None:
        path = tmp_path / f"{name}.csv"
        path.parent.mkdir(exist_ok=True)
        with path.open("w", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(columns)
            writer.writerows(zip(*columns.values(), strict=True))

    make.folder = tmp_path
    return make


def test_a_train_that_is_known(make_scene, write):
    """Waves that are 5 % too low, a tenth of which comes back."""
    scene, time, omega = make_scene(FLUME), np.arange(0.0, 20.0, 0.02), 2.0 * math.pi / 1.2
    k = 2.0 * math.pi / wavelength(1.2, depth=0.3)
    for gauge in scene.gauges:
        eta = 0.0095 * np.cos(omega * time - k * gauge.x) + 0.00095 * np.cos(omega * time + k * gauge.x + 1.0)
        write(f"gauges/{gauge.name}", **{"time [s]": time, "level [m]": 0.3 + eta})
    found = analysis(scene, write.folder)["wave train"]
    assert found["asked for"]["wavelength [m]"] == pytest.approx(2.0 * math.pi / k)
    assert found["reflection"]["incident height [m]"] == pytest.approx(0.019, rel=1e-3)
    assert found["reflection"]["coefficient"] == pytest.approx(0.1, rel=0.01)
    heights = [gauge["height / asked for"] for gauge in found["gauges"].values()]
    assert all(0.95 * 0.89 < height < 0.95 * 1.11 for height in heights)
    assert set(found["between gauges"]) == {"a to b", "b to c"}


def test_a_record_that_is_too_short_is_told(make_scene, write):
    scene, time = make_scene(FLUME), np.arange(0.0, 3.0, 0.02)
    for gauge in scene.gauges:
        write(f"gauges/{gauge.name}", **{"time [s]": time, "level [m]": 0.3 + 0.0 * time})
    assert analysis(scene, write.folder)["wave train"]["gauges"].startswith(
        "too short a record: waves have come to all"
    )


def test_a_solitary_wave(make_scene, write):
    scene = make_scene(FLUME, "wave_maker={waves: solitary, x: 0.0, depth: 0.3, height: 0.06}")
    time, c = np.arange(0.0, 6.0, 0.01), 1.9
    for gauge in scene.gauges:
        eta = 0.06 / np.cosh(3.0 * (gauge.x - c * (time - 1.0))) ** 2
        write(f"gauges/{gauge.name}", **{"time [s]": time, "level [m]": 0.3 + eta})
    found = analysis(scene, write.folder)["wave train"]
    assert found["between gauges"]["a to b"]["celerity [m/s]"] == pytest.approx(c, rel=2e-3)
    assert found["gauges"]["c"]["height / asked for"] == pytest.approx(1.0, rel=0.01)


def test_extremes_pass_over_what_is_not_a_number(make_scene, write):
    time = np.array([0.0, 0.1, 0.2, 0.3])
    write("probes/p", **{"time [s]": time, "pressure [Pa]": [0.0, 5.0, -1.0, 2.0], "u [m/s]": [np.nan] * 4})
    z = np.array([np.nan, 0.3, 0.42, 0.35])
    write("run_up/end", **{"time [s]": time, "x [m]": z, "z [m]": z, "length [m]": [np.nan, 1.0, 1.4, 1.1]})
    found = analysis(make_scene(FLUME), write.folder)["instruments"]
    assert found["probes/p"]["pressure [Pa]"] == {
        "least": -1.0,
        "least at [s]": 0.2,
        "greatest": 5.0,
        "greatest at [s]": 0.1,
    }
    assert "u [m/s]" not in found["probes/p"]
    assert found["run_up/end"]["run-up [m]"] == pytest.approx(0.12)
    assert found["run_up/end"]["run-up along the wall [m]"] == pytest.approx(0.4)


def test_what_was_observed_is_compared_and_drawn(make_scene, write):
    file = write.folder / "seen.csv"
    file.write_text("t [s],level [mm]\n" + "".join(f"{t},{10.0 * t}\n" for t in range(5)), encoding="utf-8")
    scene = make_scene(FLUME, f"gauges[0].observed={{file: {file}, columns: [t, level]}}")
    (write.folder / "scene.yaml").write_text(scene.resolved_yaml(), encoding="utf-8")
    time = np.linspace(0.0, 4.0, 41)
    write("gauges/a", **{"time [s]": time, "level [m]": 0.3 + 0.011 * time})
    found = analysis(scene, write.folder)["observed"]["gauges/a"]
    assert found["bias [m]"] == pytest.approx(0.002) and found["rms [m]"] == pytest.approx(0.001 * math.sqrt(6.0))
    write("probes/p", **{"time [s]": time, "pressure [Pa]": time, "u [m/s]": time, "w [m/s]": time})
    file.write_text("t [s],p [kPa]\n0,0\n1,1\n2,2\n", encoding="utf-8")
    scene = make_scene(FLUME, f"probes[0].observed={{file: {file}, columns: [t, p]}}")
    assert [caption for caption, _ in instrument_plots(write.folder, scene)] == ["p, computed and observed"]
