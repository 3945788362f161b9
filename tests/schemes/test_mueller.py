"""Braga's scheme as a whole: his program step by step, what it conserves, his counts of particles, what it refuses."""

import re

import numpy as np
import pytest

from warpsph.cli import SCENES
from warpsph.output.checkpoint import write_checkpoint
from warpsph.placement.place import place
from warpsph.scene.loading import load_scene
from warpsph.scene.source import SceneError
from warpsph.simulation import BlowUpError, Simulation

BOX = SCENES / "braga_box.yaml"
# 36 particles.
COARSE = ["spacing=0.084", "fluids[0].lattice.origin=[-0.042, -0.042]", "run.time_step=0.0005"]


def program(x: np.ndarray, v: np.ndarray, h: float, dt: float, steps: int, k: float = 1000.0, mu: float = 0.1):
    """The program of the thesis, appendix A, in double precision: place and velocity [n, 2] after so many steps."""

    def density(mass: float) -> np.ndarray:
        z = np.maximum(h**2 - ((x[:, None] - x[None]) ** 2).sum(axis=2), 0.0)
        return 4 * mass / (np.pi * h**8) * (z**3).sum(axis=1)

    rho = density(1.0)
    mass = 1000.0 * rho.sum() / (rho**2).sum()
    half = v.copy()
    for step in range(steps):
        rho = density(mass)
        dx, dv = x[:, None] - x[None], v[:, None] - v[None]
        q = np.sqrt((dx**2).sum(axis=2)) / h
        np.fill_diagonal(q, 1.0)
        u = np.maximum(1.0 - q, 0.0)
        w0 = mass / (np.pi * h**4) * u / (rho[:, None] * rho[None])
        wp = w0 * 15 * k * (rho[:, None] + rho[None] - 2000.0) * u / q
        a = (wp[..., None] * dx - 40 * mu * w0[..., None] * dv).sum(axis=1) - [0.0, 9.8]
        half += a * (dt if step else 0.5 * dt)
        v = half + 0.5 * dt * a
        x = x + dt * half
        for one in zip(x, v, half, strict=True):
            for axis, barrier, beyond in ((0, 0.0, -1), (0, 1.0, 1), (1, 0.0, -1), (1, 1.0, 1)):
                if (one[0][axis] - barrier) * beyond > 0 and one[1][axis]:
                    bounce = (one[0][axis] - barrier) / one[1][axis]
                    one[0][:] -= one[1] * 0.25 * bounce
                    one[0][axis] = 2 * barrier - one[0][axis]
                    for velocity in one[1:]:
                        velocity[axis] *= -1.0
                        velocity *= 0.75
    return x, v, mass


def test_steps_are_those_of_the_program(device):
    """Through 60 steps, walls and all; rounding grows with every collision."""
    simulation = Simulation(load_scene(BOX, COARSE), device)
    start = simulation.state.snapshot()
    simulation.advance(60 * 0.0005)
    assert simulation.step_count == 60
    found = simulation.state.snapshot()
    x, v, mass = program(start.position[:, [0, 2]], np.zeros((len(start.id), 2)), 1.3 * 0.084, 0.0005, 60)
    assert simulation.model.parameters.mass.numpy()[0] == pytest.approx(mass, rel=1e-6)
    np.testing.assert_allclose(found.position[:, [0, 2]], x, atol=2e-6)
    np.testing.assert_allclose(found.velocity[:, [0, 2]], v, atol=2e-4)


def test_a_drop_falls_freely_until_it_touches(device):
    """g t^2 / 2 for its centre of mass, exactly, since pairs push each other alike."""
    simulation = Simulation(load_scene(SCENES / "braga_drop.yaml", [*COARSE[:2]]), device)
    at_rest = simulation.energy.measure()[1][0].center[2]
    simulation.advance(0.05)
    assert not simulation.state.wall_impulse.numpy().any()
    fallen = at_rest - simulation.energy.measure()[1][0].center[2]
    assert fallen == pytest.approx(0.5 * 9.8 * 0.05**2, rel=1e-5)


def test_momentum_is_the_impulse_of_walls_and_gravity(device):
    """Of two bodies of water that have fallen into each other, too: all particles have one mass."""
    disc = "{name: drop, material: water, clearance: 0.0, shape: {disc: {center: [0.3, 0.65], radius: 0.12}}}"
    box = "{name: water, material: water, clearance: 0.0, shape: {box: {min: [0.0, 0.0], max: [0.5, 0.5]}}}"
    simulation = Simulation(load_scene(BOX, [*COARSE, f"fluids=[{box}, {disc}]"]), device)
    assert len(set(simulation.model.parameters.mass.numpy())) == 1
    simulation.advance(0.2)
    state, dt = simulation.state, 0.0005
    mass = float(simulation.model.parameters.mass.numpy()[0])
    momentum = mass * state.half_velocity.numpy().astype(float).sum(axis=0)
    weight = mass * 9.8 * simulation.model.particle_count
    given = state.wall_impulse.numpy().sum(axis=0) - [0.0, 0.0, weight * (0.2 - 0.5 * dt)]
    assert np.abs(state.wall_impulse.numpy()).sum() > 0.1 * weight * 0.2
    np.testing.assert_allclose(momentum, given, atol=1e-6 * weight * 0.2)


def test_goes_on_with_the_same_bits(device, tmp_path, bits, resumed):
    scene = load_scene(BOX, COARSE)
    simulation = Simulation(scene, device)
    simulation.advance(0.05)
    write_checkpoint(tmp_path, simulation, "")
    new = resumed(simulation, tmp_path)
    for one in (simulation, new):
        one.advance(0.1)
    assert bits(simulation) == bits(new)


def test_too_long_a_step_explodes_as_in_4_7():
    """With a millisecond: by the first picture, named 0.01 s, which comes after a hundred steps, that is 0.1 s."""
    scene = load_scene(BOX, ["run.time_step=0.001"])
    (doubt,) = place(scene).warnings
    assert "run.time_step: 0.001 s is too long" in doubt
    assert place(load_scene(BOX)).warnings == ()
    simulation = Simulation(scene, "cpu")
    with pytest.raises(BlowUpError, match="faster than sound"):
        simulation.advance(0.1)


# By scene and spacing, as the thesis prints it; 4.1 has 169 and 503, 4.2 to 4.5 and 4.9 the others.
COUNTS = [
    ("tank", 0.0099999925, 1581),
    ("box", 0.0169230769, 900),
    ("box", 0.0384615385, 169),
    ("column", 0.0076923077, 4732),
    ("column", 0.0176923077, 920),
    ("drop", 0.0176923077, 628),
    ("pool", 0.0076923077, 12254),
    ("pool", 0.0176923077, 2339),
    ("pool", 0.0384615385, 503),
    ("collision", 0.0084615385, 10165),
    ("collision", 0.0099999925, 7371),
    ("collision", 0.0130769231, 4209),
    ("collision", 0.0146153846, 3410),
]


@pytest.mark.parametrize(("name", "spacing", "count"), COUNTS)
def test_counts_of_particles(name, spacing, count):
    path = SCENES / f"braga_{name}.yaml"
    corner = f"[{-0.5 * spacing}, {-0.5 * spacing}]"
    origins = [f"fluids[{i}].lattice.origin={corner}" for i, _ in enumerate(load_scene(path).fluids)]
    assert len(place(load_scene(path, [f"spacing={spacing}", *origins])).position) == count


@pytest.mark.parametrize(
    ("override", "path", "words"),
    [
        ("materials.water.rheology={law: newtonian, consistency: 1.0}", "materials.water", "leave one of the two out"),
        ("wall_model.force=radial", "wall_model.force", "the scheme mueller knows reflecting alone"),
        ("run.integrator=verlet", "run.integrator", "the scheme mueller knows leapfrog alone"),
        ("materials.water.state_equation=tait", "materials.water.state_equation", "knows linear alone"),
        ("xsph=0.5", "xsph", "the scheme mueller does not know this"),
        ("run.time_step=null", "run.time_step", "this field is missing: the scheme mueller has a fixed step"),
        ("walls[0]={name: tank, path: [[0.0, 1.0], [0.0, 0.0]]}", "walls", "needs one wall, a box"),
        (
            "bodies=[{name: disc, shape: {disc: {center: [0.8, 0.5], radius: 0.1}}, density: 500.0}]",
            "bodies",
            "not know",
        ),
        ("scheme=weakly_compressible", "run.time_step", "goes with the scheme mueller"),
        ("scheme=muller", "scheme", "did you mean 'mueller'?"),
    ],
)
def test_what_it_lacks_is_refused_with_one_line(override, path, words):
    with pytest.raises(SceneError, match=re.escape(words)) as caught:
        load_scene(BOX, [override])
    assert any(path in line for line in str(caught.value).splitlines())
    assert len(str(caught.value).splitlines()) == 1


def test_reflecting_walls_are_refused_elsewhere():
    with pytest.raises(SceneError, match="reflecting goes with the scheme mueller"):
        load_scene(SCENES / "dam_break.yaml", ["wall_model.force=reflecting"])
