"""Prescribed motions: tables from CSV, and what is refused of them with file and line."""

import math

import numpy as np
import pytest

from warpsph.bodies.motion import Motion, MotionTable, read_table

# Values are read as they are written: there is no tolerance but rounding.


@pytest.fixture
def write(tmp_path):
    """A function that writes a table and gives its path."""

    def make(text: str):
        path = tmp_path / "paddle.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return make


def test_table_is_read_in_any_order_of_columns(write):
    table = read_table(write("x [m], time [s], angle [deg]\n0, 0, 0\n\n0.1, 0.5, 90\n0.3, 2, -45\n"))
    np.testing.assert_array_equal(table.time, [0.0, 0.5, 2.0])
    np.testing.assert_array_equal(table.shift, [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.3, 0.0, 0.0]])
    np.testing.assert_allclose(table.angle, [0.0, math.pi / 2, -math.pi / 4])


def test_shifts_count_from_the_first_row(write):
    table = read_table(write("time,x,angle\n0,0.5,1\n1,0.75,3\n"))
    np.testing.assert_array_equal(table.shift[:, 0], [0.0, 0.25])
    np.testing.assert_array_equal(table.angle, [0.0, 2.0])
    assert table.first == (0.5, 0.0, 0.0, 1.0) and table.line == (2, 3)


@pytest.mark.parametrize(
    "text",
    [
        "time [s];x [m]\n0.0;0.0\n0.5;0.25\n",
        "time [s];x [m]\n0,0;0,0\n0,5;0,25\n",
        "time [s]\tx [m]\n0,0\t0\n5e-1\t0.25\n",
        '\ufefftime [s],x [m]\r\n0,0\r\n"0.5",0.25\r\n',
    ],
)
def test_a_spreadsheet_of_any_country_is_read(write, text):
    table = read_table(write(text))
    np.testing.assert_array_equal(table.time, [0.0, 0.5])
    np.testing.assert_array_equal(table.shift[:, 0], [0.0, 0.25])


def test_rates_are_those_of_fritsch_and_butland():
    """By hand, of slopes 1 and 2: 6 / (3 / 1 + 3 / 2) between, (3 - 2) / 2 and (6 - 1) / 2 at the ends."""
    rates, turning = MotionTable(np.arange(3.0), np.outer([0.0, 1.0, 3.0], [1.0, 0.0, -1.0]), np.arange(3.0)).rates()
    np.testing.assert_allclose(rates[:, 0], [0.5, 4.0 / 3.0, 2.5], rtol=1e-14)
    np.testing.assert_allclose(rates[:, 2], -rates[:, 0], rtol=1e-14)
    np.testing.assert_array_equal(rates[:, 1], 0.0)
    np.testing.assert_allclose(turning, 1.0, rtol=1e-14)


def test_a_motion_that_rests_between_uneven_rows_rests():
    """Rest for 1 s, a push within 0.1 s, rest: where parabolas swung 0.227 m backwards."""
    table = MotionTable(np.array([0.0, 1.0, 1.1, 3.0]), np.outer([0.0, 0.0, 0.1, 0.1], [1.0, 0.0, 0.0]), np.zeros(4))
    np.testing.assert_array_equal(table.rates()[0], 0.0)


def test_the_cubics_of_a_sine_are_close_to_it():
    time = np.linspace(0.0, 2.0, 81)
    rates, _ = MotionTable(time, np.outer(np.sin(np.pi * time), [1.0, 0.0, 0.0]), 0.0 * time).rates()
    np.testing.assert_allclose(rates[:, 0], np.pi * np.cos(np.pi * time), atol=0.02 * np.pi)


def test_the_fastest_step_of_a_table_is_found():
    table = MotionTable(
        np.array([0.0, 0.2, 0.2001, 1.0]), np.outer([0.0, 0.0, 0.05, 0.05], [1.0, 0.0, 0.0]), np.zeros(4)
    )
    speed, row = Motion("table", table=table).top_speed(0.0)
    assert speed == pytest.approx(500.0) and row == 2
    assert Motion("sine", direction=(0.3, 0.0, 0.4), turn=0.1, period=2.0).top_speed(5.0)[0] == pytest.approx(np.pi)
    assert Motion("ramp", direction=(2.0, 0.0, 0.0)).top_speed(9.0) == (2.0, 0)
    assert Motion("fixed").top_speed(1.0)[0] == 0.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,x\n0,0\n0.2,1\n0.1,2\n", r"paddle.csv:4: time goes back, from 0.2 s to 0.1 s"),
        ("time,x\n0,0\n\n0.2,1\n0.2,2\n", r"paddle.csv:5: time stands still"),
        ("time,x\n0,0\n0.1,one\n", r"paddle.csv:3: x is not a number: 'one'"),
        ("time,x\n0,0\n0.1,inf\n", r"paddle.csv:3: a number must be less than 1e\+08"),
        ("time;x\n0;0\n0.1;0,1,2\n", r"paddle.csv:3: x is not a number: '0,1,2'"),
        ("time,x\n0,0\n0.1\n", r"paddle.csv:3: 1 cells in a table of 2 columns"),
        ("time,speed\n0,0\n1,1\n", r"paddle.csv:1: no column is named 'speed'"),
        ("x,z\n0,0\n1,1\n", r"paddle.csv:1: there is no column named 'time'"),
        ("time [s],x [mm]\n0,0\n1,1\n", r"paddle.csv:1: x must be in m, not in mm"),
        ("time,x,x\n0,0,0\n1,1,1\n", r"paddle.csv:1: there are two columns named 'x'"),
        ("time,x\n0,0\n", r"paddle.csv: a motion needs two rows"),
        ("", r"paddle.csv: the table is empty"),
    ],
)
def test_bad_tables_are_refused_with_their_line(write, text, words):
    with pytest.raises(ValueError, match=words) as caught:
        read_table(write(text))
    assert "\n" not in str(caught.value)


def test_missing_table_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no such file"):
        read_table(tmp_path / "nowhere.csv")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"kind": "sinus"}, "no motion named 'sinus'; it can be fixed, constant, ramp, sine, table"),
        ({"kind": "sine", "period": 0.0}, "period of 0 s"),
        ({"kind": "table"}, "rows"),
        ({"kind": "constant", "axis": (0.0, 0.0, 0.0)}, "axis"),
    ],
)
def test_impossible_motions_are_refused(fields, words):
    with pytest.raises(ValueError, match=words):
        Motion(**fields)
