"""Tests of the memory that is told before it is taken, and of the line for a scene that does not fit."""

import gc
from types import SimpleNamespace

import pytest
import warp as wp

import warpsph.memory
from warpsph.cli import MACHINE, SCENES, main
from warpsph.memory import NoRoomError, counts_of, memory_of, refuse_too_big, rough_counts, with_neighbours
from warpsph.placement.place import place
from warpsph.scene.loading import load_scene
from warpsph.simulation import Simulation

COLUMN = str(SCENES / "column_3d.yaml")


def allocated() -> int:
    """Bytes of all arrays that there are."""
    gc.collect()
    arrays = (one for one in gc.get_objects() if isinstance(one, wp.array) and one.deleter)
    return sum({array.ptr: array.capacity for array in arrays}.values())


@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        ("column_3d", ["spacing=0.0125"]),
        ("column_3d", ["spacing=0.0125", "wall_model.force=radial", "neighbours=cells", "smoothing.ratio=1.2"]),
        ("floating_box_3d", []),
        ("landslide", []),
        ("viscous_dam_break", []),
        ("braga_pool", []),
    ],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_what_is_told_is_what_is_taken(name, overrides, device):
    scene = load_scene(SCENES / f"{name}.yaml", overrides)
    before = allocated()
    simulation = Simulation(scene, device)
    taken = allocated() - before
    told = memory_of(scene, counts_of(scene, place(scene)), shared=simulation.launcher.device.is_cpu)
    assert told.arrays == pytest.approx(taken, rel=0.1)


@pytest.mark.parametrize("name", ["column_3d", "landslide", "floating_box_3d", "poiseuille_plane"])
def test_counts_from_the_drawing_alone(name):
    scene = load_scene(SCENES / f"{name}.yaml")
    rough, counts = rough_counts(scene), counts_of(scene, place(scene))
    assert rough.particles == pytest.approx(counts.particles, rel=0.1)  # bodies are left out
    assert rough.walls == pytest.approx(counts.walls, rel=0.15)


@pytest.mark.parametrize(
    ("name", "free", "expected"),
    [
        ("column_3d", 1e12, "lists"),
        ("column_3d", 0.0, "lists"),
        ("column_3d", None, "cells"),
        ("couette", 0.0, "lists"),
    ],
)
def test_neighbours_are_chosen_by_memory(name, free, expected, monkeypatch):
    """Lists where they fit, and where nothing fits or cells will not do; cells where only these fit."""
    scene = load_scene(SCENES / f"{name}.yaml", ["wall_model.force=radial"] if name == "column_3d" else [])
    if free is None:
        hosts = [
            memory_of(scene.model_copy(update={"neighbours": way}), rough_counts(scene), shared=True).host
            for way in ("cells", "lists")
        ]
        free = sum(hosts) / 2
    monkeypatch.setattr(warpsph.memory, "free_memory", lambda device: free)
    assert with_neighbours(scene, wp.get_device("cpu")).neighbours == expected
    asked = scene.model_copy(update={"neighbours": "cells"})
    assert with_neighbours(asked, wp.get_device("cpu")) is asked


@pytest.mark.parametrize("command", ["check", "scene"])
def test_a_scene_that_does_not_fit_is_told_what_would(command, tmp_path, monkeypatch, capsys):
    free = warpsph.memory.PROGRAM + 20e6
    monkeypatch.setattr(warpsph.memory, "free_memory", lambda device: free)
    place_out = [] if command == "check" else ["--out", str(tmp_path / "run")]
    # The spacing that is told need not divide the tank: a fill fits it.
    fluid = "fluids=[{name: water, material: water, fill: {level: 0.2, above: tank}}]"
    overrides = ["--set", "spacing=0.0125", "--set", fluid]
    assert main([command, COLUMN, *overrides, *place_out]) == MACHINE
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("needs about ") and "this machine has 440 MB free; spacing=0.0" in line
    assert not (tmp_path / "run").exists()

    spacing = float(line.split("spacing=")[1].split()[0])
    fits = load_scene(COLUMN, [f"spacing={spacing}", fluid])
    told = memory_of(fits, counts_of(fits, place(fits)), shared=True)
    assert 0.9 * free < told.host <= free


def test_a_device_that_is_too_small():
    scene = load_scene(COLUMN)
    counts = counts_of(scene, place(scene))
    card = SimpleNamespace(is_cuda=True, free_memory=5e6)
    with pytest.raises(NoRoomError, match=r"needs about [\d.]+ MB, this device has 5 MB free; spacing=0\.0"):
        refuse_too_big(scene, counts, card)
    refuse_too_big(scene, counts, SimpleNamespace(is_cuda=True, free_memory=1e9))


@pytest.mark.parametrize(
    "error", [MemoryError(), RuntimeError("Failed to allocate 123 bytes on device 'cpu'")], ids=["host", "device"]
)
def test_no_more_memory_is_one_line(error, monkeypatch, capsys):
    def fail(*_):
        raise error

    monkeypatch.setattr("warpsph.simulation.State", fail)
    assert main(["check", COLUMN]) == MACHINE
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("out of memory: needs about ")


def test_other_errors_are_not_taken_for_it(monkeypatch):
    def fail(*_):
        raise RuntimeError("something else")

    monkeypatch.setattr("warpsph.simulation.State", fail)
    with pytest.raises(RuntimeError, match="something else"):
        main(["check", COLUMN])
