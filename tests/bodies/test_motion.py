"""Prescribed motions: tables from CSV, and what is refused of them with file and line."""

import math

import numpy as np
import pytest

from warpsph.bodies.motion import Motion, Table, read_table

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


def test_rates_of_a_parabola_are_exact():
    time = np.array([0.0, 0.1, 0.3, 0.4, 1.0])
    shift = np.stack([time, 2.0 - time**2, 3.0 * time**2], axis=1)
    rates, turning = Table(time, shift, 0.5 * time**2).rates()
    np.testing.assert_allclose(rates, np.stack([time**0, -2.0 * time, 6.0 * time], axis=1), atol=1e-12)
    np.testing.assert_allclose(turning, time, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,x\n0,0\n0.2,1\n0.1,2\n", r"paddle.csv:4: time goes back, from 0.2 s to 0.1 s"),
        ("time,x\n0,0\n\n0.2,1\n0.2,2\n", r"paddle.csv:5: time stands still"),
        ("time,x\n0,0\n0.1,one\n", r"paddle.csv:3: x is not a number: 'one'"),
        ("time,x\n0,0\n0.1,inf\n", r"paddle.csv:3: not a finite number"),
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
