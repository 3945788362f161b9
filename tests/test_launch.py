"""Launching: every index once whatever the threads, replays, and devices that are not there."""

import numpy as np
import pytest
import warp as wp

from warpsph.launch import DeviceError, Launcher, available_cores

# Counts of threads are compared bit for bit: there is no tolerance.


@wp.kernel(enable_backward=False)
def count_visits(first: int, visits_inout: wp.array[int], index_out: wp.array[int]):
    i = first + wp.tid()
    visits_inout[i] = visits_inout[i] + 1
    index_out[i] = i


@wp.kernel(enable_backward=False)
def grow(first: int, factor: wp.array[float], values_inout: wp.array[float]):
    i = first + wp.tid()
    values_inout[i] = wp.sin(values_inout[i]) * factor[0] + 1.0 / float(i + 1)


@pytest.mark.parametrize("threads", [1, 2, 3, 7])
@pytest.mark.parametrize("count", [1, 2, 127, 128, 129, 1000])
def test_each_index_is_visited_once(device, threads, count):
    visits, index = (wp.zeros(count, dtype=int, device=device) for _ in range(2))
    Launcher(device, threads).run(count_visits, count, [visits, index])
    np.testing.assert_array_equal(visits.numpy(), np.ones(count))
    np.testing.assert_array_equal(index.numpy(), np.arange(count))


def test_recorded_launch_is_replayed_on_the_arrays_as_they_are(device):
    visits, index = (wp.zeros(500, dtype=int, device=device) for _ in range(2))
    launch = Launcher(device, 2).record(count_visits, 500, [visits, index])
    assert not visits.numpy().any()
    launch()
    launch()
    visits.fill_(40)
    launch()
    assert np.all(visits.numpy() == 41)


def test_same_bits_whatever_the_threads(device):
    results = []
    for threads in (1, 2, 5):
        values = wp.array(np.linspace(0.0, 9.0, 1234, dtype=np.float32), device=device)
        factor = wp.array([1.1], dtype=float, device=device)
        launch = Launcher(device, threads).record(grow, 1234, [factor, values])
        for _ in range(20):
            launch()
        results.append(values.numpy())
    np.testing.assert_array_equal(results[0], results[1])
    np.testing.assert_array_equal(results[0], results[2])


def test_default_is_every_core():
    assert Launcher("cpu").threads == available_cores() >= 1


@pytest.mark.parametrize("name", ["cuda:99", "tpu"])
def test_no_such_device(name):
    with pytest.raises(DeviceError, match=rf"^no device named '{name}' here; Warp finds: cpu"):
        Launcher(name)


def test_threads_take_turns():
    """What costs more at one end is shared: either half of the range is split between the two."""
    count = 100_000
    visits, index = (wp.zeros(count, dtype=int, device="cpu") for _ in range(2))
    Launcher("cpu", 2).record(count_visits, count, [visits, index]).parts[0]()
    assert visits.numpy()[: count // 2].sum() == visits.numpy()[count // 2 :].sum() == count // 4
