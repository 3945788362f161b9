"""The report of a run: one page, complete in itself, from whatever the run folder holds."""

import json
import re
from base64 import b64decode
from html.parser import HTMLParser
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from warpsph.output.pages import told
from warpsph.output.report import ReportError, write_report

FACTS = {
    "title": "Slide <into> water",
    "source": "A book & its author",
    "outcome": "stopped",
    "why": "at t = 1 s, from the keyboard",
    "time [s]": 1.0,
    "provenance": {"warpsph": "0.1.0", "device": "cpu", "threads": 2},
    "counts": {"particles": 8022, "water": 7666},
    "conservation": {"mass / mass placed": 1.0},
    "gauges": {"g17": {"x [m]": 1.440192, "still level [m]": 0.15, "crest amplitude [m]": 0.0912345}},
    "warnings": ["fluids[0].shape: stands for an area 1.2 % off"],
    "speed": {"particle updates per second": 5123456, "seconds to the first step": None},
}


SCENE = """
title: Slide into water
spacing: 0.01
materials:
  water: {density: 1000.0, sound_speed: 30.0}
  rock: {density: 2500.0, sound_speed: 30.0, color: '#8a6a4a'}
walls: [{name: tank, box: {min: [0.0, 0.0], max: [2.0, 0.5]}}]
fluids:
  - {name: slide, material: rock, shape: {box: {min: [0.1, 0.2], max: [0.2, 0.3]}}}
  - {name: water, material: water, fill: {level: 0.15, above: tank}}
gauges: [{name: g17, x: 1.4, observed: {file: seen.csv, columns: [time, level]}}]
run: {end_time: 1.0}
"""


def write_record(path: Path, columns: dict[str, np.ndarray]) -> None:
    path.parent.mkdir(exist_ok=True)
    np.savetxt(path, np.stack(list(columns.values()), axis=1), delimiter=",", header=",".join(columns), comments="")


@pytest.fixture
def run_dir(tmp_path) -> Path:
    """A run folder with a file of every kind that the report reads."""
    (tmp_path / "run.json").write_text(json.dumps(FACTS))
    time = np.linspace(0.0, 1.0, 51)
    crest = 0.09 * np.exp(-(((time - 0.5) / 0.1) ** 2))
    write_record(tmp_path / "gauges/g17.csv", {"time [s]": time, "level [m]": 0.15 + crest})
    energy = {"kinetic [J/m]": time, "potential [J/m]": 300.0 - time, "total [J/m]": 300.0 + 0.0 * time}
    write_record(tmp_path / "energy.csv", {"time [s]": time, **energy})
    for fluid in ("slide", "water"):
        motion = {
            "x [m]": time,
            "z [m]": 0.1 - time,
            "u [m/s]": time,
            "w [m/s]": time,
            "front [m]": 2.0 * time,
            "top speed [m/s]": 2.0 * time,
        }
        write_record(tmp_path / f"fluids/{fluid}.csv", {"time [s]": time, **motion})
    (tmp_path / "preview").mkdir()
    for frame in range(20):
        Image.new("RGB", (64, 32), (frame, 0, 0)).save(tmp_path / f"preview/frame.{frame:05d}.png")
    (tmp_path / "preview/animation.mp4").write_bytes(b"a film")
    motion = {"x [m]": time, "z [m]": -time, "force x [N/m]": time, "force z [N/m]": 2.0 * time}
    write_record(tmp_path / "bodies/raft.csv", {"time [s]": time, **motion})
    write_record(tmp_path / "seen.csv", {"time [s]": np.array([0.4, 0.5]), "level [m]": np.array([0.04, 0.08])})
    (tmp_path / "scene.yaml").write_text(SCENE)
    return tmp_path


class Page(HTMLParser):
    """The tags that are open at the end, the sources of images, and the text of each heading and cell."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.open_tags: list[str] = []
        self.sources: list[str] = []
        self.links: list[str] = []
        self.texts: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attrs):
        if tag in ("img", "video"):
            self.sources.append(dict(attrs)["src"])
        if tag == "a":
            self.links.append(dict(attrs)["href"])
        if tag not in ("img", "meta", "br"):
            self.open_tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open_tags.pop() == tag

    def handle_data(self, data):
        if data.strip():
            self.texts.append(data.strip())

    def pictures(self) -> list[Image.Image]:
        return [
            Image.open(BytesIO(b64decode(source.split(",")[1]))) for source in self.sources if "image/png" in source
        ]


def test_the_page_is_whole_and_needs_nothing_else(run_dir):
    path = write_report(run_dir)
    assert path == run_dir / "report.html"
    page = Page(path)
    assert page.open_tags == []
    assert all(source.startswith("data:") for source in page.sources)
    assert not re.search(r"https?:|<script|<link|url\(", path.read_text())
    assert all((run_dir / href).exists() for href in page.links)
    assert {"gauges/g17.csv", "energy.csv", "fluids/slide.csv", "run.json", "scene.yaml"} <= set(page.links)


def test_the_page_holds_what_the_run_left(run_dir):
    page = Page(write_report(run_dir))
    for text in ("Slide <into> water", "A book & its author", FACTS["warnings"][0], "5\u202f123\u202f456"):
        assert text in page.texts
    assert "Outcome: stopped at t = 1 s, from the keyboard" in page.texts
    headings = ["Animation", "Wave gauges", "Bodies", "Energy", "Fluids", "Pictures", "Set-up", "The run"]
    assert [text for text in page.texts if text in headings] == headings
    # Six of twenty frames, the first and the last among them; their red is their number.
    assert [frame.getpixel((0, 0))[0] for frame in page.pictures()] == [0, 4, 8, 11, 15, 19]
    assert "t = 0.6333 s" in page.texts  # frame 19 of 30 a second
    assert len([source for source in page.sources if source.startswith("data:image/svg+xml")]) == 1 + 4 + 1 + 4
    assert [source[:22] for source in page.sources if "video" in source] == ["data:video/mp4;base64,"]


def test_the_page_tells_how_it_was_set_up(run_dir):
    texts = Page(write_report(run_dir)).texts
    values = dict(pairwise(texts))
    assert values["spacing [m]"] == "0.01"
    assert values["rows of water"] == "15" and values["rows of slide"] == "10"
    assert values["sound speed [m/s]"] == "30"
    assert values["sound speed / fastest particle"] == "15"
    again = next(text for text in texts if "python -m warpsph scene" in text)
    assert f"{run_dir.name}/scene.yaml" in again


def test_a_gauge_is_told_with_its_wave_and_what_was_observed(run_dir):
    texts = Page(write_report(run_dir)).texts
    values = dict(pairwise(texts))
    assert values["still level [m]"] == "0.15"
    assert float(values["crest [m]"]) == pytest.approx(0.09, rel=0.01)
    assert float(values["observed crest [m]"]) == 0.08
    assert float(values["off observed, root mean square [m]"]) == pytest.approx(0.01, rel=0.2)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (38.1234, "38.12"),
        (0.0902458, "0.09025"),
        (-0.024, "−0.024"),
        (5123456.0, "5\u202f123\u202f456"),
        (7062, "7\u202f062"),
        (True, "yes"),
        (None, "–"),
        ({"kernel": "c2", "order": 2}, "kernel: c2<br>order: 2"),
    ],
)
def test_numbers_have_four_significant_digits(value, text):
    assert str(told(value)) == text


def test_what_is_missing_is_left_out(tmp_path):
    (tmp_path / "run.json").write_text('{"outcome": "blew up"}')
    (tmp_path / "gauges").mkdir()
    (tmp_path / "gauges/g17.csv").write_text("time [s],level [m]\n")
    (tmp_path / "energy.csv").write_text("")
    page = Page(write_report(tmp_path))
    assert page.sources == []
    assert tmp_path.name in page.texts
    assert not {"Animation", "Wave gauges", "Pictures", "Energy", "Fluids", "Set-up"} & set(page.texts)


def test_fluids_are_drawn_without_the_scene_too(run_dir):
    for content in ("", "materials: [", "materials: {}\nfluids: [{name: water, material: water}]"):
        (run_dir / "scene.yaml").write_text(content)
        assert "Fluids" in Page(write_report(run_dir)).texts


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (None, "missing; a run writes it when it ends"),
        ('{"title": ', "cannot be read"),
        ("[]", "does not hold the facts"),
    ],
)
def test_a_folder_without_the_facts_is_refused_in_one_line(tmp_path, content, complaint):
    if content is not None:
        (tmp_path / "run.json").write_text(content)
    with pytest.raises(ReportError, match=complaint) as refused:
        write_report(tmp_path)
    assert "run.json" in str(refused.value)
    assert "\n" not in str(refused.value)
