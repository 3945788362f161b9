"""Launching: every index once whatever the threads, replays, and devices that are not there."""

import threading

import numpy as np
import pytest
import warp as wp

from warpsph.device.launch import DeviceError, Launcher, available_cores, launch

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


@wp.kernel(enable_backward=False)
def turn_round(first: int, values: wp.array[int], values_out: wp.array[int]):
    i = first + wp.tid()
    values_out[i] = values[len(values) - 1 - i] + i % 3


@wp.kernel(enable_backward=False)
def count_down(first: int, left_inout: wp.array[int]):
    i = first + wp.tid()
    left_inout[i] = left_inout[i] - 1


@pytest.mark.parametrize("threads", [1, 2, 3, 7])
@pytest.mark.parametrize("count", [1, 2, 127, 128, 129, 1000])
def test_each_index_is_visited_once(device, threads, count):
    visits, index = (wp.zeros(count, dtype=int, device=device) for _ in range(2))
    Launcher(device, threads).record_in_order(count_visits, count, [visits, index])()
    np.testing.assert_array_equal(visits.numpy(), np.ones(count))
    np.testing.assert_array_equal(index.numpy(), np.arange(count))


def test_recorded_launch_is_replayed_on_the_arrays_as_they_are(device):
    visits, index = (wp.zeros(500, dtype=int, device=device) for _ in range(2))
    launch = Launcher(device, 2).record_in_order(count_visits, 500, [visits, index])
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
        launch = Launcher(device, threads).record_in_order(grow, 1234, [factor, values])
        for _ in range(20):
            launch()
        results.append(values.numpy())
    np.testing.assert_array_equal(results[0], results[1])
    np.testing.assert_array_equal(results[0], results[2])


def test_default_is_every_core():
    assert Launcher("cpu").threads == available_cores() >= 1


@pytest.mark.parametrize(
    ("quota", "cores"),
    [("max 100000", None), ("100000 100000", 1), ("150000 100000", 1), ("20000 100000", 1), ("", None)],
)
def test_a_container_may_have_less_time_than_cores(tmp_path, quota, cores):
    path = tmp_path / "cpu.max"
    path.write_text(quota)
    assert available_cores(path) == (cores or available_cores(tmp_path / "none"))


@pytest.mark.parametrize("name", ["cuda:99", "tpu"])
def test_no_such_device(name):
    with pytest.raises(DeviceError, match=rf"^no device named '{name}' here; Warp finds: cpu"):
        Launcher(name)


def test_threads_take_turns():
    """What costs more at one end is shared: either half of the range is split between the two."""
    count = 100_000
    visits, index = (wp.zeros(count, dtype=int, device="cpu") for _ in range(2))
    Launcher("cpu", 2).record_in_order(count_visits, count, [visits, index]).parts[0]()
    assert visits.numpy()[: count // 2].sum() == visits.numpy()[count // 2 :].sum() == count // 4


def turning(launcher: Launcher, count: int, turns: int):
    """A loop in which every thread needs what the others wrote last; its values, and what is left to do."""
    values, other = (wp.array(np.arange(count), dtype=int, device=launcher.device) for _ in range(2))
    left = wp.array([turns], dtype=int, device=launcher.device)
    there = launcher.record_in_order(turn_round, count, [values, other])
    back = launcher.record_in_order(turn_round, count, [other, values])
    down = launcher.record_in_order(count_down, 1, [left])
    return launcher.loop(left, lambda: [launch() for launch in (there, back, down)]), values, left


@pytest.mark.parametrize("threads", [1, 2])
def test_a_loop_stops_where_it_is_told_and_threads_meet_in_it(device, threads):
    launcher = Launcher(device, threads)
    if not launcher.can_loop:
        pytest.skip("threads without a core each take no loops")
    count, turns = 10_001, 500
    loop, values, left = turning(launcher, count, turns)
    loop()
    expected = np.arange(count)
    for _ in range(2 * turns):
        expected = expected[::-1] + np.arange(count) % 3
    np.testing.assert_array_equal(values.numpy(), expected)
    loop()  # there is nothing left to do
    np.testing.assert_array_equal(values.numpy(), expected)
    left.fill_(1)
    loop()
    assert left.numpy()[0] == 0 and np.any(values.numpy() != expected)


def test_an_interrupted_loop_leaves_no_thread_behind(monkeypatch):
    """One that waits for a thread which never comes would keep the program from ending."""
    launcher = Launcher("cpu", 2)
    if not launcher.can_loop:
        pytest.skip("threads without a core each take no loops")
    whole = wp.capture_launch

    def interrupted(graph):
        if threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt
        whole(graph)

    monkeypatch.setattr(wp, "capture_launch", interrupted)
    before = threading.active_count()
    loop, _, _ = turning(launcher, 10_001, 500)
    with pytest.raises(KeyboardInterrupt):
        loop()
    assert threading.active_count() == before


# ------------------------------------------------------------------------------------------------- binding by name


@wp.kernel(enable_backward=False)
def weigh(first: int, scale: float, values: wp.array[float], pairs: wp.array[wp.uint64], values_out: wp.array[float]):
    i = first + wp.tid()
    values_out[i] = scale * values[i] + 0.0 * float(pairs[i] == wp.uint64(0))


class Owner:
    """Something that has what kernels read, by name."""

    def __init__(self, **attributes: object) -> None:
        vars(self).update(attributes)


def test_arguments_are_found_by_name(device):
    vectors = wp.array(np.arange(6).reshape(2, 3), dtype=wp.vec3, device=device)
    packed, result = wp.zeros(3, dtype=wp.vec4, device=device), wp.zeros(6, dtype=float, device=device)
    owners = Owner(scale=2.0, unused=1), Owner(pairs=packed, scale=None)
    Launcher(device).record(weigh, 6, *owners, values=vectors, values_out=result)()
    np.testing.assert_array_equal(result.numpy(), 2.0 * np.arange(6))


@pytest.mark.parametrize(
    ("owners", "named", "says"),
    [
        ([], {}, "name .* in full"),  # one word for what is read and for what is written
        ([Owner(scale=1.0)], {"values": 1, "values_out": 2}, "Owner do not have 'pairs'"),
        ([Owner(scale=1.0), Owner(scale=2.0)], {"values": 1, "values_out": 2, "pairs": 3}, "do not agree on 'scale'"),
        ([Owner(scale=1.0)], {"values": 1, "values_out": 2, "pairs": 3, "parts": 4}, "no parameter.*parts"),
    ],
)
def test_a_name_that_leads_nowhere_is_an_error_when_recording(device, owners, named, says):
    with pytest.raises(TypeError, match=f"weigh: .*{says}"):
        Launcher(device).record(weigh, 6, *owners, **named)


def test_a_damaged_kernel_is_made_anew(tmp_path, monkeypatch):
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))

    @wp.kernel(enable_backward=False, module="unique")
    def treble(values_inout: wp.array[float]):
        i = wp.tid()
        values_inout[i] = 3.0 * values_inout[i]

    values = wp.ones(1, dtype=float, device="cpu")
    launch(treble, 1, [values], device="cpu")
    (code,), (facts,) = tmp_path.glob("*/*.o"), tmp_path.glob("*/*.meta")
    whole = code.read_bytes()
    for path, left in (code, b""), (code, whole[: len(whole) // 2]), (code, bytes(len(whole))), (facts, b'{"x'):
        path.write_bytes(left)
        treble.module.unload()
        values.fill_(1.0)
        launch(treble, 1, [values], device="cpu")
        assert values.numpy() == 3.0
        assert path.read_bytes() != left
