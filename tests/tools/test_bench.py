"""The benchmark prints every figure that it promises, and its measures give known answers."""

import json
import math
import sys
import time

import bandwidth as bench_bandwidth
import bench
import cases as bench_cases
import lattices
import noise as bench_noise
import numpy as np
import peer as bench_peer
import pytest
import stages as bench_stages

NO_WALLS = np.empty((0, 3))
DX = 0.01  # [m]


def lattice(count: int) -> np.ndarray:
    """A square of count x count particles in the x-z plane [m]."""
    x, z = np.meshgrid(np.arange(count) * DX, np.arange(count) * DX, indexing="ij")
    return np.stack([x.ravel(), np.zeros(count**2), z.ravel()], axis=1)


def frame(position: np.ndarray) -> np.ndarray:
    """The outermost particles of a square, to be used as wall points: all that is left has 28 neighbours."""
    low, high = position.min(axis=0), position.max(axis=0)
    return position[np.any(((position == low) | (position == high))[:, [0, 2]], axis=1)]


# ------------------------------------------------------------------------------------------------------ pressure noise


def test_a_linear_pressure_is_not_noise():
    position = lattice(40)
    pressure = 3e4 * position[:, 0] - 9810.0 * position[:, 2]
    assert bench_noise.pressure_noise(position, pressure, frame(position), DX, 9810.0) < 1e-12
    # Without walls the third row from a surface is interior too, and one neighbour in 28 short.
    assert 1e-5 < bench_noise.pressure_noise(position, pressure, NO_WALLS, DX, 9810.0) < 1e-3


def test_alternating_columns_are_six_sevenths_noise():
    # Of the 28 neighbours 16 carry the sign of the particle's own column: their mean is 4/28 of its pressure.
    position = lattice(40)
    pressure = 50.0 * (-1.0) ** np.round(position[:, 0] / DX)
    noise = bench_noise.pressure_noise(position, pressure, frame(position), DX, 9810.0)
    assert noise == pytest.approx(50.0 * 6.0 / 7.0 / 9810.0, rel=1e-12)


def test_white_noise_on_a_slope_is_recovered():
    position = lattice(120)
    pressure = 9810.0 * (1.2 - position[:, 2]) + np.random.default_rng(1).normal(0.0, 100.0, len(position))
    noise = bench_noise.pressure_noise(position, pressure, NO_WALLS, DX, 9810.0)
    assert noise == pytest.approx(100.0 / 9810.0 * math.sqrt(1.0 + 1.0 / 28.0), rel=0.03)


def test_particles_near_walls_and_surfaces_do_not_count():
    position = lattice(40)
    left, top = position[:, 0] < 0.5 * DX, position[:, 2] > 38.5 * DX
    rough_wall = bench_noise.pressure_noise(position, np.where(left, 9810.0, 0.0), position[left], DX, 9810.0)
    assert rough_wall == 0.0  # from 4 dx on the wall's row is out of sight
    rough_surface = bench_noise.pressure_noise(position, np.where(top, 9810.0, 0.0), NO_WALLS, DX, 9810.0)
    assert 0.0 < rough_surface < 0.1  # seen in the mean of the third row only
    assert math.isnan(bench_noise.pressure_noise(position[:3], np.zeros(3), NO_WALLS, DX, 9810.0))


@pytest.mark.parametrize("dimensions", [2, 3])
def test_pairs_are_those_of_brute_force(dimensions):
    random = np.random.default_rng(2)
    points, others = random.uniform(-1.0, 1.0, (3000, 3)), random.uniform(-1.2, 0.9, (500, 3))
    if dimensions == 2:
        points[:, 1] = others[:, 1] = 0.0
    found = {pair for i, j in bench_noise.pairs(points, others, 0.13) for pair in zip(i, j, strict=True)}
    near = np.linalg.norm(points[:, None] - others, axis=2) <= 0.13
    assert found == set(zip(*np.nonzero(near), strict=True)) and len(found) > 100


def test_a_sample_is_enough(monkeypatch):
    position, random = lattice(120), np.random.default_rng(1)
    pressure = random.normal(0.0, 100.0, len(position))
    whole = bench_noise.pressure_noise(position, pressure, NO_WALLS, DX, 9810.0)
    monkeypatch.setattr(bench_noise, "ENOUGH", 5000)
    assert bench_noise.pressure_noise(position, pressure, NO_WALLS, DX, 9810.0) == pytest.approx(whole, rel=0.03)


def test_neighbours_on_a_lattice():
    assert bench_noise.lattice_neighbours(2) == 28 and bench_noise.lattice_neighbours(3) == 122


# -------------------------------------------------------------------------------------------------------- stages, bytes


def test_stages_are_timed_and_put_back():
    def rest() -> None:
        time.sleep(0.002)

    class Step:
        def __init__(self):
            self.stages = {"pair loop": rest, "walls": lambda: None}
            self.neighbours = type("Neighbours", (), {"rebuild": lambda self: time.sleep(0.001)})()
            self.calls, self.loops = 0, True

        def run(self, steps):
            assert steps == 1 and not self.loops, "a loop would not go through the stages"
            self.calls += 1
            self.neighbours.rebuild()
            if self.calls == 3:  # a list has grown: stages are recorded anew
                self.stages.update({"pair loop": rest})
            for stage in self.stages.values():
                stage()

    step = Step()
    before = dict(step.stages)
    milliseconds = bench_stages.stage_times(step, steps=5)
    assert step.loops
    assert list(milliseconds) == ["pair loop", "walls", bench_stages.LISTS, bench_stages.BETWEEN]
    assert milliseconds["pair loop"] > 1.5 and milliseconds[bench_stages.LISTS] > 0.9 > milliseconds["walls"]
    assert step.calls == 5 and step.stages == before and "rebuild" not in vars(step.neighbours)


def test_bytes_that_a_step_moves():
    case = bench_cases.dam_break(400)
    with bench_bandwidth.recorded_launches() as recorded:
        simulation = bench.ready(case.scene, "cpu", 1, None)
    moved = bench_bandwidth.step_bytes(simulation, recorded) / simulation.model.particle_count
    lists = 4.0 * simulation.step.neighbours.neighbour_count.numpy().mean() * simulation.step.sweeps
    assert lists + 100.0 < moved < lists + 1000.0
    assert bench_bandwidth.copy_bandwidth("cpu", 2**20) > 1e8
    assert bench_stages.bytes_per_particle(simulation) > 100.0
    share = bench.bandwidth_share(simulation, recorded, 1e6)
    assert share["share"] == pytest.approx(moved * 1e6 / share["copy bandwidth"])


# --------------------------------------------------------------------------------------------------------- the program


def test_small_dam_break(tmp_path, capsys):
    path = tmp_path / "bench.json"
    arguments = ["--particles", "1600", "400", "--threads", "1", "2", "--steps", "5", "--repeat", "2"]
    arguments += ["--diffusion", "fourtakas", "--set", "smoothing.ratio=1.4"]
    assert bench.main([*arguments, "--lattice-only", "--json", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "M particle-updates/s" in printed and "pair loop" in printed and "bytes a particle" in printed
    results = json.loads(path.read_text())
    assert [(r["particles"], r["threads"]) for r in results] == [(400, 1), (400, 2), (1600, 1), (1600, 2)]
    for result in results:
        low, high = result["on the lattice"]["range"]
        assert 0.0 < low <= result["on the lattice"]["updates per second"] <= high
        assert result["on the lattice"]["neighbours listed"] >= result["on the lattice"]["neighbours in support"] > 15.0
        assert any("pair loop" in name and spent > 0.0 for name, spent in result["milliseconds a step"].items())


def test_developed_flow_with_pressure_noise(monkeypatch, capsys):
    monkeypatch.setattr(bench, "DEVELOPED_TIME", 0.06)
    monkeypatch.setattr(bench, "NOISE_TIMES", [0.03, 0.05])
    assert bench.main(["--particles", "900", "--threads", "1", "--steps", "5"]) == 0
    printed = capsys.readouterr().out
    assert "developed flow" in printed and "of rho g H" in printed and "nan" not in printed


# ------------------------------------------------------------------------------------------------------------ the peer


def test_a_peer_that_is_not_installed_is_one_line(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    (tmp_path / "pysph").mkdir()
    (tmp_path / "pysph" / "__init__.py").write_text("raise ImportError('none here')")
    arguments = ["--particles", "400", "--threads", "1", "--steps", "2", "--lattice-only", "--peer", "pysph"]
    assert bench.main(arguments) == 1
    error = capsys.readouterr().err
    assert error.startswith("bench: PySPH cannot be imported by") and error.count("\n") == 1
    assert bench.main([*arguments, "--peer-python", str(tmp_path / "nowhere")]) == 1
    assert "nowhere" in capsys.readouterr().err


def test_pairs_with_a_peer(tmp_path, capsys, monkeypatch):
    stand_in = tmp_path / "stand_in.py"
    stand_in.write_text(
        "import json, os, sys, numpy\n"
        "case = numpy.load(sys.argv[1])\n"
        "assert len(case['x']) == len(case['rho']) == 400 and case['steps'] == 2\n"
        "print(json.dumps({'updates per second': 1e3 * int(os.environ['OMP_NUM_THREADS'])}))\n"
    )
    monkeypatch.setitem(bench_peer.PROGRAM, "pysph", stand_in)
    path = tmp_path / "bench.json"
    arguments = ["--particles", "400", "--threads", "2", "--steps", "2", "--lattice-only", "--peer", "pysph"]
    assert bench.main([*arguments, "--peer-python", sys.executable, "--json", str(path)]) == 0
    (result,) = json.loads(path.read_text())
    timed = result["on the lattice"]
    assert timed["peer updates per second"] == [2e3] * 3 and len(timed["ratios"]) == 3  # one for each pair
    assert timed["range"][1] == pytest.approx(2e3 * max(timed["ratios"]))
    assert capsys.readouterr().out.count("ours over theirs") == 3


def test_what_does_not_go_together_is_refused(capsys):
    for arguments in (
        ["--case", "landslide", "--particles", "10"],
        ["--case", "landslide", "--peer", "pysph"],
        ["--steps", "0"],
    ):
        with pytest.raises(SystemExit):
            bench.parse(arguments)
    capsys.readouterr()
    assert bench.parse(["--device", "cuda:0"]).threads == [1]
    assert bench.parse(["--case", "column_3d"]).particles == [100_000]


def test_a_lattice_stands_where_it_is_told_to():
    """Rows of a square lattice slide under pressure at h = 1.5 dx, and hardly at 1.4 dx."""
    square = lattices.LATTICES["square"]
    assert lattices.fastest_rate("wendland_c2", 1.5, square) == pytest.approx(0.0955, abs=2e-3)
    assert lattices.fastest_rate("wendland_c2", 1.4, square) < 0.03


@pytest.mark.parametrize("lattice", ["square", "cubic"])
def test_lattices_of_the_quintic_spline_neither_resist_nor_buckle(lattice):
    """Moduli of water are 0; Wendland's kernel over 1.4 dx is an elastic body, with 0.09 of the pressure."""
    basis = lattices.LATTICES[lattice]
    assert max(np.abs(lattices.moduli("quintic_spline", 1.42, basis))) < 0.012
    assert lattices.fastest_rate("quintic_spline", 1.42, basis) < 0.01
    assert max(lattices.moduli("wendland_c2", 1.4, lattices.LATTICES["square"])) == pytest.approx(0.091, abs=1e-3)
