"""Records: what is written is read back, a resumed record goes on without a seam, and crests are found."""

import logging

import numpy as np
import pytest

from warpsph.output.records import Record, RecordError, find_crest, read_record, read_records

# Values are written with nine digits, times in microseconds.
TOLERANCE = 1e-8


@pytest.fixture
def path(tmp_path):
    return tmp_path / "gauge.csv"


def fill(record: Record, times: np.ndarray) -> None:
    for time in times:
        record.write(time, [np.sin(time), -1e5 * time])


def test_what_is_written_is_read(path):
    times = np.arange(20) / 30
    record = Record(path, ["level [m]", "energy [J]"])
    fill(record, times)
    record.close()
    columns = read_record(path)
    assert list(columns) == ["time [s]", "level [m]", "energy [J]"]
    np.testing.assert_allclose(columns["time [s]"], times, rtol=0, atol=1e-6)
    np.testing.assert_allclose(columns["level [m]"], np.sin(times), rtol=TOLERANCE)
    np.testing.assert_allclose(columns["energy [J]"], -1e5 * times, rtol=TOLERANCE)


def test_each_row_is_on_the_disk_at_once(path):
    record = Record(path, ["level [m]"])
    for rows in range(3):
        assert len(path.read_text().splitlines()) == 1 + rows
        record.write(0.1 * rows, [1.0])
    record.close()


def test_record_without_rows(path):
    Record(path, ["level [m]"]).close()
    assert [len(column) for column in read_record(path).values()] == [0, 0]


@pytest.mark.parametrize("killed_at", [11, 12, 17])
def test_resumed_record_is_the_whole_one(path, tmp_path, killed_at):
    """Rows after the checkpoint, which the killed run wrote, are written again and not twice; that at it is kept."""
    times, checkpoint = np.arange(20) / 30, 10
    whole = Record(tmp_path / "whole.csv", ["a", "b"])
    fill(whole, times)
    killed = Record(path, ["a", "b"])
    fill(killed, times[:killed_at])
    resumed = Record(path, ["a", "b"], resume_at=times[checkpoint])
    fill(resumed, times[checkpoint + 1 :])
    for record in (whole, killed, resumed):
        record.close()
    assert path.read_text() == (tmp_path / "whole.csv").read_text()


def test_record_begins_anew_without_a_resume(path):
    for level in (1.0, 2.0):
        record = Record(path, ["level [m]"])
        record.write(0.0, [level])
        record.close()
    assert read_record(path)["level [m]"].tolist() == [2.0]


def wave(time: np.ndarray, amplitude: float = 0.02, crest: float = 1.3) -> np.ndarray:
    """A level of 0.15 m with a solitary wave on it [m]."""
    return 0.15 + amplitude / np.cosh(4.0 * (time - crest)) ** 2


def test_crest_of_a_wave():
    """A parabola through the upper tenth of sech^2 is right to 1 % of the amplitude."""
    time = np.arange(0.0, 3.0, 0.005)
    amplitude, at = find_crest(time, wave(time))
    assert amplitude == pytest.approx(0.02, rel=0.01)
    assert at == pytest.approx(1.3, abs=1e-3)


def test_crest_of_a_parabola_is_exact():
    time = np.arange(0.0, 2.0, 0.01)
    level = 0.15 + np.maximum(0.03 - (time - 1.0043) ** 2, 0.0)
    assert find_crest(time, level) == pytest.approx((0.03, 1.0043), rel=1e-6)


def test_crest_of_a_rough_record():
    """The highest sample is one of the roughest; the fit is not."""
    time = np.arange(0.0, 3.0, 0.005)
    level = wave(time) + 1e-3 * np.random.default_rng(10).uniform(-1, 1, len(time)) * (time > 0)
    amplitude, at = find_crest(time, level)
    assert amplitude == pytest.approx(0.02, rel=0.03)
    assert at == pytest.approx(1.3, abs=0.02)
    assert level.max() - level[0] > 0.0205


@pytest.mark.parametrize(
    "level", [[1.0, 1.1, 1.3, 1.6], [1.6, 1.3, 1.1, 1.0], [1.0, 1.0, 1.0, 1.0], [1.0, 2.0, 1.0, 1.0]]
)
def test_crest_without_enough_around_it_is_the_highest_sample(level):
    time, level = np.arange(4.0), np.array(level)
    top = np.argmax(level)
    assert find_crest(time, level) == (level[top] - level[0], time[top])


@pytest.mark.parametrize("cut", ["0.2", "0.200000,", "0.200000,1.0,-2", "0.200000,x,y\n"])
def test_a_cut_row_is_dropped_and_told(path, cut, caplog, monkeypatch):
    """A kill or a full disk in the middle of a row; the number of its last cell may be cut, too."""
    monkeypatch.setattr(logging.getLogger("warpsph"), "propagate", True)  # the command line turns it off
    path.write_text("time [s],a,b\n0.000000,1,2\n0.100000,1,2\n" + cut)
    record = Record(path, ["a", "b"], resume_at=0.3)
    record.write(0.4, [3, 4])
    record.close()
    assert path.read_text() == "time [s],a,b\n0.000000,1,2\n0.100000,1,2\n0.400000,3,4\n"
    assert f"{path}: row 4 is cut or damaged, and is dropped" in caplog.text


def test_a_full_disk_takes_no_row_of_a_resumed_record(path, monkeypatch):
    path.write_text("time [s],a\n0.000000,1\n")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("warpsph.output.records.os.replace", full)
    with pytest.raises(OSError, match="No space"):
        Record(path, ["a"], resume_at=0.0)
    assert path.read_text() == "time [s],a\n0.000000,1\n"


def test_a_crest_is_within_the_record():
    """A run that ends on the way up: the parabola of what there is has its top a second after the last sample."""
    time = np.linspace(0.0, 1.0, 101)
    level = 4.0 - (time - 2.0) ** 2
    level[-1] -= 0.05  # rough, so that the highest sample is not the last
    assert find_crest(time, level) == (level[-2], time[-2])


def test_what_is_no_record_is_told_in_a_line_and_left_out(path, tmp_path, caplog, monkeypatch):
    """A user's own file among the gauges, an empty one, and one that a kill has cut."""
    monkeypatch.setattr(logging.getLogger("warpsph"), "propagate", True)
    path.write_text("time [s],level [m]\n0.0,1\n0.1,2\n0.2")
    np.testing.assert_array_equal(read_record(path)["level [m]"], [1.0, 2.0])
    for name, text in {"measured": "t;h\n0;1\n", "empty": "", "other": "time [s],x [m]\n0,1\n"}.items():
        (tmp_path / f"{name}.csv").write_text(text)
    with pytest.raises(RecordError, match=r"is no record of ours \(its first column is not 'time \[s\]'\)$"):
        read_record(tmp_path / "measured.csv")
    assert set(read_records(tmp_path.glob("*.csv"), "level [m]")) == {path.stem}
    for words in ("measured.csv: is no record", "empty.csv: is no record", "other.csv: has no column 'level [m]'"):
        assert words in caplog.text
