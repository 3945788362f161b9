"""Plots of records: what is drawn of which column, in colours that do not repeat."""

import numpy as np
import pytest
from PIL import Image

from warpsph.output import plots as preview
from warpsph.output.pages import plot
from warpsph.output.plots import RECORDS, Panel, Records, gauge_figure, gauge_picture, line_colors, small_plot


def test_gauges_are_drawn_with_the_amplitude_of_their_crests(tmp_path, monkeypatch):
    time = np.linspace(0.0, 2.0, 401)
    for name, amplitude in {"near": 0.0914, "far": 0.0832}.items():
        level = 0.15 + amplitude * np.exp(-(((time - 1.0) / 0.1) ** 2))
        lines = [f"{t:.6f},{z:.9g}" for t, z in zip(time, level, strict=True)]
        (tmp_path / f"{name}.csv").write_text("\n".join(["time [s],level [m]", *lines, ""]))
    (tmp_path / "empty.csv").write_text("time [s],level [m]\n")
    plots = []
    new_plots = preview.new_plots
    monkeypatch.setattr(preview, "new_plots", lambda *size: plots.append(new_plots(*size)) or plots[-1])
    gauge_picture([tmp_path / "near.csv", tmp_path / "far.csv", tmp_path / "empty.csv"], tmp_path / "gauges.png")
    (_, (axes,)) = plots[0]
    (legend,) = plots[0][0].legends
    assert [text.get_text() for text in legend.get_texts()] == ["near, crest 0.0914 m", "far, crest 0.0832 m"]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", "level − still level [m]")
    assert Image.open(tmp_path / "gauges.png").size == (810, 495)


@pytest.mark.parametrize("count", [1, 10, 11, 40])
def test_colours_do_not_repeat(count):
    assert len(set(line_colors(count))) == count


def test_a_new_kind_of_record_is_one_line(tmp_path):
    (tmp_path / "probes").mkdir()
    for name in ("toe", "crest"):
        (tmp_path / f"probes/{name}.csv").write_text("time [s],pressure [Pa],u [m/s],w [m/s]\n0,1,2,3\n1,2,3,4\n")
    kind = Records("Probes", "probes/*.csv")
    plots = dict(kind.plots(kind.read(tmp_path)))
    assert list(plots) == ["pressure over time", "u, w over time"]
    pressure, velocity = (figure.axes[0] for figure in plots.values())
    assert (pressure.get_ylabel(), velocity.get_ylabel()) == ("pressure [Pa]", "u, w [m/s]")
    assert [line.get_label() for line in pressure.lines] == ["crest", "toe"]
    assert [line.get_label() for line in velocity.lines] == ["crest, u", "crest, w", "toe, u", "toe, w"]


def test_a_body_is_drawn_by_its_path_and_force_in_both_dimensions():
    (bodies,) = (kind for kind in RECORDS if kind.heading == "Bodies")
    time = np.array([0.0, 1.0])
    for unit in ("N/m", "N"):
        columns = ("time [s]", "x [m]", "z [m]", f"force x [{unit}]", f"force z [{unit}]")
        record = {column: time + k for k, column in enumerate(columns)}
        plots = dict(bodies.plots({"box": record}))
        assert list(plots) == ["path: z over x", "z over time", "force x over time", "force z over time"]
        axes = plots["force x over time"].axes[0]
        assert (axes.get_ylabel(), axes.lines[0].get_ydata().tolist()) == (f"force x [{unit}]", [3.0, 4.0])
        assert plots["path: z over x"].axes[0].lines[0].get_xdata().tolist() == [1.0, 2.0]


def test_a_panel_without_its_columns_is_left_out():
    plots = Records("Bodies", "*", panels=(Panel(("z",)), Panel(("lift",)))).plots(
        {"a": {"time [s]": [0.0], "z [m]": [1.0]}}
    )
    assert [title for title, _ in plots] == ["z over time"]


def test_a_figure_drawn_upon_again_is_as_a_new_one():
    time = np.linspace(0.0, 2.0, 50)
    waves = {f"gauge {k}": {"time [s]": time, "level [m]": 0.1 * k * np.sin(time)} for k in range(1, 9)}
    paths = {"box": {"time [s]": time, "x [m]": 40.0 * time, "z [m]": time**2}}
    (bodies,) = (kind for kind in RECORDS if kind.heading == "Bodies")
    sheet, _ = small_plot()
    gauge_figure(waves, onto=sheet)
    again = [plot(figure) for _, figure in bodies.plots(paths, onto=sheet)]
    assert again == [plot(figure) for _, figure in bodies.plots(paths)]
    gauge_figure(waves, onto=sheet)
    assert plot(sheet) == plot(gauge_figure(waves)[0])
