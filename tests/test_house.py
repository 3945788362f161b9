"""The house: imports go down the staircase, in no circle; types are right; what its pages lead to is there."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def test_imports_go_down_the_staircase():
    pytest.importorskip("importlinter")
    # In a process of its own: it turns off the loggers of the one that it runs in.
    words = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    found = subprocess.run([sys.executable, "-c", words], cwd=ROOT, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout + found.stderr
    assert "4 kept, 0 broken" in found.stdout


def test_types_of_host_code_are_right():
    """All of them; a few rooms do not ask whether a scene has what they are entered for, see pyproject.toml."""
    pytest.importorskip("mypy")
    found = subprocess.run([sys.executable, "-m", "mypy"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert found.returncode == 0, found.stdout + found.stderr


def test_no_two_types_have_one_name():
    """The class of a scene's field ends in Field where the thing itself has the name."""
    places: dict[str, list[str]] = {}
    for path in [*ROOT.glob("warpsph/*.py"), *ROOT.glob("warpsph/[!k]*/*.py"), *ROOT.glob("kernels/*.py")]:
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert len(places) > 100
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


def test_pages_name_every_room():
    """The staircase and its wings in warpsph/README.md, the rooms of kernels in theirs."""
    page = (ROOT / "warpsph" / "README.md").read_text(encoding="utf-8")
    wings = dict(re.findall(r"^\| `(\w+)/` \| (.*) \|$", page, re.MULTILINE))
    rooms = {path.parent.name: set() for path in ROOT.glob("warpsph/[!_k]*/__init__.py")}
    for path in ROOT.glob("warpsph/[!_k]*/[!_]*.py"):
        rooms[path.parent.name].add(path.stem)
    assert rooms.keys() == wings.keys() - {"kernels"}
    assert {wing: found - set(re.findall(r"`(\w+)`", wings[wing])) for wing, found in rooms.items()} == {
        wing: set() for wing in rooms
    }
    assert {path.name for path in ROOT.glob("warpsph/[!_]*.py")} <= set(re.findall(r"`(\w+\.py)`", page))
    kernels = (ROOT / "kernels" / "README.md").read_text(encoding="utf-8")
    assert {path.name for path in ROOT.glob("kernels/[!_]*.py")} <= set(re.findall(r"`(\w+\.py)`", kernels))


@pytest.mark.parametrize(
    "page",
    sorted(ROOT.glob("*.md")) + sorted(ROOT.glob("[!.]*/**/README.md")),
    ids=lambda page: str(page.relative_to(ROOT)),
)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8"))
    missing = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert not missing


def test_figures_of_the_front_page_are_those_of_the_books():
    """The front page has eight at most, each of them told in full where all results or all speeds are."""
    front, results, speeds = (
        (ROOT / name / "README.md").read_text(encoding="utf-8") for name in (".", "warpsph/validation", "tools/bench")
    )
    rows = [row.split("|")[1:5] for row in front.split("| figure |")[1].split("\n\n")[0].splitlines()[2:]]
    assert 0 < len(rows) <= 8
    for _, measured, reference, command in rows:
        book = speeds if "bench.py" in command else results
        for cell in (measured, reference):
            for number in re.findall(r"\d[\d.]*", cell):
                assert re.search(rf"(?<![\d.]){re.escape(number)}(?![\d.])", book), f"{cell.strip()} is not told"
