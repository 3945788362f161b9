"""The studies of Braga: their measures on runs that have hardly begun; the cases take longer."""

import json

import pytest

from warpsph.cli import SCENES
from warpsph.run import Run
from warpsph.scene.loading import load_scene
from warpsph.validation import as_dicts
from warpsph.validation.braga import STUDIES, measure, measure_ours

AT_ONCE = ["run.end_time=0.02", "output.pictures=false", "output.usd=false"]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A function of a study and settings that runs its scene for two hundredths of a second."""

    def execute(name: str, *settings: str) -> Run:
        scene = load_scene(SCENES / f"braga_{name}.yaml", [*settings, *AT_ONCE])
        run = Run(scene, tmp_path_factory.mktemp(name) / "run", threads=1)
        run.execute()
        return run

    return execute


def test_measures_of_runs_by_his_scheme(run, tmp_path):
    """A drop in the air is in free fall, has the momentum that gravity gave it, and too few particles."""
    coarse = ("spacing=0.05", "fluids[0].lattice.origin=[-0.025, -0.025]")
    results = {one.quantity: one for one in measure("drop")([run("drop", *coarse)], tmp_path)}
    json.dumps(as_dicts(list(results.values())))
    assert results["fall of the centre of mass against g t^2 / 2"].passed
    assert results["momentum less impulses, over that of gravity, N = 628"].passed
    assert not results["particles, N = 628"].passed


def test_what_gains_energy_diverges(run, tmp_path):
    """The same run twice: as one of his that settles and as one that diverges, it is right as one of them only."""
    one = run("column", "spacing=0.05")
    results = {found.quantity: found for found in measure("column")([one, one], tmp_path)}
    settles = results["mechanical energy above its least at the end, N = 4732"]
    diverges = results["mechanical energy has risen again, N = 920"]
    assert settles.measured == diverges.measured and settles.passed != diverges.passed
    json.dumps(as_dicts(list(results.values())))


def test_our_scheme_takes_the_same_drawing(run, tmp_path):
    results = {one.quantity: one for one in measure_ours("tank")([run("tank", *STUDIES["tank"].ours())], tmp_path)}
    assert results["density, farthest off at the end"].passed
    assert results["mechanical energy above its least at the end"].passed
