"""The fuzzer: the same members for the same seed, findings where there is something to find; a few dozen members."""

import fuzz
import pytest

from warpsph.scene.loading import load_scene
from warpsph.scene.source import SceneError


@pytest.fixture(scope="module")
def known():
    return fuzz.bases()


def test_mutated_scenes_are_refused_in_a_few_short_lines_or_load(known, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused = 0
    for number in range(60):
        text = fuzz.scene_text(1, number, known)
        with open("scene.yaml", "wb") as file:
            file.write(text.encode("utf-8", "surrogatepass"))
        try:
            load_scene("scene.yaml")
        except SceneError as error:
            refused += 1
            lines = str(error).splitlines()
            assert "scene.yaml" in lines[0] and len(lines) <= fuzz.MOST_LINES, number
            assert max(map(len, lines)) <= fuzz.MOST_LETTERS and "<" not in lines[0][:20], number
    assert 20 < refused < 60


def test_members_are_those_of_their_seed(known):
    assert fuzz.scene_text(3, 5, known) == fuzz.scene_text(3, 5, known) != fuzz.scene_text(4, 5, known)
    assert fuzz.command_line(3, 5) == fuzz.command_line(3, 5)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ({"code": 2, "stderr": "scene.yaml:3: spacing: must be more than 0, not -1\n"}, None),
        ({"code": 0, "stdout": "A tank\n"}, None),
        ({"code": 2, "stderr": "x" * 1000 + " scene.yaml"}, "1 lines of 1011 letters"),
        ({"code": 2, "stderr": "spacing is wrong"}, "names no file"),
        ({"code": 1, "stderr": "scene.yaml: oh"}, "exit code 1"),
        ({"code": -1, "traceback": "Traceback\nValueError: no"}, "traceback: ValueError: no"),
        ({"code": 0, "stderr": "a.py:3: RuntimeWarning: overflow"}, "noise"),
        ({"code": 2, "stderr": "scene.yaml:1: no", "wrote": ["run"]}, "refused, and wrote"),
    ],
)
def test_what_is_wrong_is_found(answer, words):
    found = fuzz.judge({"stderr": "", "stdout": "", "traceback": "", "wrote": []} | answer, "scene.yaml")
    assert (found == []) if words is None else any(one.startswith(words) for one in found)
