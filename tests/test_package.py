"""The package as a whole: its name, its version, and what a wheel of it holds."""

import importlib
import importlib.metadata
import runpy
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

import warpsph
import warpsph.kernels

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def package_folders() -> dict[str, Path]:
    """The folder of each package that a wheel holds."""
    setuptools = PROJECT["tool"]["setuptools"]
    return {name: ROOT / setuptools["package-dir"].get(name, name.replace(".", "/")) for name in setuptools["packages"]}


def test_kernels_refuse_another_name(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT))
    with pytest.raises(ImportError, match=r"imported as 'warpsph\.kernels'"):
        importlib.import_module("kernels")
    assert "kernels" not in sys.modules


def test_kernels_are_the_top_level_folder():
    assert Path(warpsph.kernels.__file__).resolve() == ROOT / "kernels" / "__init__.py"


def test_a_folder_that_hides_the_package_is_told_in_a_line(monkeypatch, capsys):
    """From the folder that holds a clone: Python takes the clone for a package without code."""
    hidden = ModuleType("warpsph")
    hidden.__path__ = ["/home/me/warpsph"]
    monkeypatch.setitem(sys.modules, "warpsph", hidden)
    with pytest.raises(SystemExit) as left:
        runpy.run_path(str(ROOT / "warpsph" / "__main__.py"), run_name="__main__")
    told = capsys.readouterr().err.strip()
    assert left.value.code == 2
    assert told.startswith("/home/me/warpsph: this folder hides the package") and "\n" not in told


def test_version_is_that_of_the_distribution():
    try:
        installed = importlib.metadata.version("warpsph-waves")
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("run from a checkout that is not installed")
    assert warpsph.__version__ == installed


def test_wheel_holds_every_module():
    tops = [ROOT / "warpsph", ROOT / "kernels"]
    modules = {path.resolve() for top in tops for path in top.rglob("*.py")}
    held = {path.resolve() for folder in package_folders().values() for path in folder.glob("*.py")}
    assert modules == held


def test_wheel_holds_every_data_file():
    folders = package_folders()
    patterns = PROJECT["tool"]["setuptools"]["package-data"]
    held = {path for name, globs in patterns.items() for glob in globs for path in folders[name].glob(glob)}
    data = {
        path for name in patterns for suffix in ("yaml", "csv", "jinja") for path in folders[name].rglob(f"*.{suffix}")
    }
    assert data == held


@pytest.mark.parametrize("name", PROJECT["tool"]["setuptools"]["packages"])
def test_package_folder_exists(name):
    assert package_folders()[name].is_dir()
