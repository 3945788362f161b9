"""The clock: ends exactly at its target, keeps to limits, waits for lists, and stops at the first absurd particle."""

import math

import numpy as np
import pytest
import warp as wp

from warpsph.device.blocks import blocks_of
from warpsph.kernels import clock as clock_kernels

# Steps and limits are in single precision.
TOLERANCE = 1e-6


class Clock:
    """The arrays of `advance_clock`, with one particle whose limit and fault can be set, and one block of cells."""

    def __init__(self, device: str, target: float, limit: float) -> None:
        self.device = device
        self.limit, self.fault, self.strain = self._array([limit]), self._array([0], int), self._array([0.0])
        self.block_limit, self.fault_slot = self._array([0.0]), self._array([0], int)
        self.work, self.total_work = self._array([[1.0, 2.0, 3.0]], wp.vec3), self._array([[0.0, 0.0, 0.0]], wp.vec3d)
        self.time, self.target = self._array([0.0], wp.float64), self._array([target], wp.float64)
        self.dt, self.dt_limit, self.steps = self._array([0.0]), self._array([limit]), self._array([0], int)
        self.last_step = self._array([1 << 30], int)
        self.stale, self.running = self._array([0], int), self._array([0], int)
        self.first_fault, self.first_fault_slot = self._array([0], int), self._array([0], int)
        self.aim()

    def _array(self, values: list, dtype: type = float) -> wp.array:
        return wp.array(values, dtype=dtype, device=self.device)

    def _launch(self, kernel: wp.Kernel, *arguments: object) -> None:
        wp.launch(kernel, dim=1, inputs=[0, *arguments], device=self.device)

    def aim(self) -> None:
        self._launch(
            *(clock_kernels.aim_clock, self.time, self.target, self.last_step, self.dt_limit, self.stale),
            *(self.first_fault, self.steps, self.dt, self.running),
        )

    def tick(self) -> None:
        watched = [self.limit, self.fault, self.work, self.total_work, self.block_limit, self.fault_slot]
        self._launch(clock_kernels.watch_blocks, blocks_of(1, wp.get_device(self.device))[0], *watched)
        self._launch(
            *(
                clock_kernels.advance_clock,
                1,
                1,
                self.block_limit,
                self.fault_slot,
                self.fault,
                self.strain,
                self.target,
            ),
            *(self.last_step, self.time, self.dt, self.steps, self.first_fault, self.first_fault_slot),
            *(self.dt_limit, self.stale, self.running),
        )


def value(array: wp.array) -> float:
    return float(array.numpy()[0])


@pytest.mark.parametrize("target", [0.1, 1.0 / 30.0, 1e-7])
def test_clock_ends_exactly_at_its_target(device, target):
    """In equal steps none of which is above the limit, and not in one step more than that takes."""
    clock, limit, steps = Clock(device, target, limit=3e-4), 3e-4, []
    while value(clock.dt) > 0.0:
        steps.append(value(clock.dt))
        clock.tick()
    assert value(clock.time) == target
    assert len(steps) == value(clock.steps) == max(1, math.ceil(target / limit))
    assert max(steps) <= limit * (1 + TOLERANCE)
    np.testing.assert_allclose(steps, target / len(steps), rtol=1e-3)  # the last of them made up the rounding


def test_clock_keeps_to_a_limit_that_changes(device):
    clock, random = Clock(device, 0.05, limit=3e-4), np.random.default_rng(6)
    limit = 3e-4
    while value(clock.dt) > 0.0:
        assert value(clock.dt) <= limit * (1 + TOLERANCE)
        limit = random.uniform(1e-4, 5e-4)
        clock.limit.fill_(limit)
        clock.tick()
        assert value(clock.dt_limit) == pytest.approx(limit, rel=TOLERANCE)
    assert value(clock.time) == 0.05


@pytest.mark.parametrize(("strain", "waits"), [(0.99, False), (1.01, True)])
def test_clock_waits_for_new_lists(device, strain, waits):
    """It knows the next step but does not run until the lists are good again."""
    clock = Clock(device, 0.1, limit=1e-3)
    clock.strain.fill_(strain)
    clock.tick()
    assert value(clock.dt) == pytest.approx(1e-3, rel=1e-2)
    assert (value(clock.stale), value(clock.running)) == (waits, not waits)
    clock.aim()
    assert value(clock.running) == (not waits)
    clock.stale.zero_()
    clock.aim()
    assert value(clock.running)


def test_clock_waits_after_the_last_step_that_it_may_do(device):
    """Without forgetting how long the next one is."""
    clock, running = Clock(device, 1.0, limit=0.1), []
    clock.last_step.fill_(2)
    for _ in range(3):
        running.append(value(clock.running))
        clock.tick()
    assert running == [1, 1, 0]
    assert value(clock.dt) == pytest.approx(0.1)
    clock.last_step.fill_(4)
    clock.aim()
    assert value(clock.running) == 1


def test_clock_stops_at_the_first_fault(device):
    clock = Clock(device, 0.1, limit=1e-3)
    clock.tick()
    clock.fault.fill_(clock_kernels.TOO_FAST)
    clock.tick()
    assert value(clock.dt) == 0.0 and value(clock.first_fault) == clock_kernels.TOO_FAST
    assert (value(clock.time), value(clock.steps)) == (pytest.approx(2e-3), 2)
    clock.fault.fill_(clock_kernels.OUTSIDE)
    clock.tick()
    assert value(clock.first_fault) == clock_kernels.TOO_FAST
    assert value(clock.steps) == 2


@pytest.mark.parametrize("interleaved", [False, True])
def test_blocks_are_watched_to_the_last_particle(device, make_blocks, interleaved):
    """Least limit, first fault and work of each block; the last block is a short one."""
    random, count, size = np.random.default_rng(7), 1000, 256
    limit = random.uniform(size=count).astype(np.float32)
    work = random.uniform(size=(count, 3)).astype(np.float32)
    fault = np.zeros(count, np.int32)
    fault[[300, 301, 998]] = [clock_kernels.TOO_LIGHT, clock_kernels.OUTSIDE, clock_kernels.TOO_FAST]
    least, slot = wp.zeros(4, dtype=float, device=device), wp.zeros(4, dtype=int, device=device)
    total = wp.full(4, wp.vec3d(1.0, 2.0, 3.0), dtype=wp.vec3d, device=device)
    arrays = [wp.array(limit, device=device), wp.array(fault, device=device), wp.array(work, wp.vec3, device=device)]
    blocks = make_blocks(count, size, interleaved)
    wp.launch(clock_kernels.watch_blocks, dim=4, inputs=[0, blocks, *arrays, total, least, slot], device=device)
    items = np.arange(count)
    members = [items[b::4] if interleaved else items[b * size : (b + 1) * size] for b in range(4)]
    np.testing.assert_array_equal(least.numpy(), [limit[mine].min() for mine in members])
    faulty = [mine[fault[mine] != 0] for mine in members]
    np.testing.assert_array_equal(slot.numpy(), [mine[0] if len(mine) else -1 for mine in faulty])
    done = [np.array([1.0, 2.0, 3.0]) + work[mine].astype(float).sum(axis=0) for mine in members]
    np.testing.assert_allclose(total.numpy(), done, rtol=1e-12)


def test_blocks_are_collected_to_the_last(device, make_blocks):
    limits = np.random.default_rng(5).uniform(1.0, 2.0, 11).astype(np.float32)
    slots = np.full(11, -1)
    slots[[5, 7, 10]] = 50, 70, 100
    arrays = wp.array(limits, dtype=float, device=device), wp.array(slots, dtype=int, device=device)
    least, slot = wp.zeros(3, dtype=float, device=device), wp.zeros(3, dtype=int, device=device)
    inputs = [0, make_blocks(11, 4), *arrays, least, slot]
    wp.launch(clock_kernels.collect_blocks, dim=3, inputs=inputs, device=device)
    np.testing.assert_array_equal(least.numpy(), [limits[:4].min(), limits[4:8].min(), limits[8:].min()])
    np.testing.assert_array_equal(slot.numpy(), [-1, 50, 100])
