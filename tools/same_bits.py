"""Whether two checkouts compute the same bits: each runs scenes for some steps, and what they wrote is compared.

    python tools/same_bits.py OTHER                         every scene of scenes/, 200 steps
    python tools/same_bits.py OTHER still_water landslide   these alone
    python tools/same_bits.py OTHER landslide --steps 0     to the end

OTHER is a folder with another checkout, such as `git worktree add ../before REVISION` makes. Each runs its own file of
a scene, so that a renamed field is no difference. Compared are the records of gauges, bodies and energy, all frames of
the point cache, and the state at the end. Exit code 1 where anything differs.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pxr import Usd

HERE = Path(__file__).resolve().parents[1]
STOPPED = 5  # the exit code of a run that went no farther than it was told to
QUICK = ("output.pictures=false", "output.checkpoint_every=1.0e8")


def written(checkout: Path, scene: str, folder: Path, steps: int, overrides: list[str]) -> dict[str, bytes]:
    """All that a checkout computes of a scene, by name. Raises RuntimeError with its last words where it cannot."""
    settings = [*QUICK, *([f"run.max_steps={steps}"] if steps else []), *overrides]
    command = [sys.executable, "-m", "warpsph", "scene", str(checkout / "scenes" / f"{scene}.yaml")]
    command += ["--out", str(folder), "--threads", "1", *(word for one in settings for word in ("--set", one))]
    environment = os.environ | {"PYTHONPATH": str(checkout)}
    found = subprocess.run(command, cwd=checkout, env=environment, capture_output=True, text=True, check=False)
    if found.returncode not in (0, STOPPED):
        raise RuntimeError(f"{checkout}: exit code {found.returncode}: {found.stdout[-500:]}{found.stderr[-500:]}")
    return dict(_contents(folder))


def _contents(folder: Path) -> Iterator[tuple[str, bytes]]:
    """(name, bytes) of whatever a run computed."""
    for path in sorted(folder.rglob("*.csv")):
        yield str(path.relative_to(folder)), path.read_bytes()
    for path in sorted((folder / "checkpoints").glob("*.npz")):
        with np.load(path) as arrays:
            yield from ((f"{path.stem}: {name}", arrays[name].tobytes()) for name in arrays if name != "scene.yaml")
    for path in sorted((folder / "usd").rglob("*.usdc")):
        stage = Usd.Stage.Open(str(path))
        for prim in stage.TraverseAll():
            for attribute in prim.GetAttributes():
                values = [attribute.Get(time) for time in attribute.GetTimeSamples()] or [attribute.Get()]
                yield f"{path.name}: {attribute.GetPath()}", b"".join(np.asarray(v).tobytes() for v in values)


def compare(scene: str, one: Path, other: Path, steps: int, overrides: list[str]) -> bool:
    """Run a scene in both checkouts and print how it went; whether all is the same."""
    with tempfile.TemporaryDirectory() as folder:
        mine, theirs = (
            written(checkout, scene, Path(folder, str(i)), steps, overrides) for i, checkout in enumerate((one, other))
        )
    different = [name for name in mine if name in theirs and mine[name] != theirs[name]]
    alone = sorted(mine.keys() ^ theirs.keys())
    verdict = "the same" if not different else "DIFFERENT"
    print(f"{scene:28s} {verdict}: {len(mine)} records, frames and arrays", flush=True)
    for words, names in {"differs": different, "only one has": alone}.items():
        for name in names[:5]:
            print(f"    {words} {name}")
        if len(names) > 5:
            print(f"    {words} {len(names) - 5} more")
    return not different


def main() -> int:
    """The command line; returns the exit code."""
    parser = argparse.ArgumentParser(description="Whether two checkouts compute the same bits.")
    parser.add_argument("other", type=Path, help="a folder with another checkout")
    parser.add_argument("scenes", nargs="*", help="names of scenes; every one when absent")
    parser.add_argument("--steps", type=int, default=200, help="steps of each run; 0 for all of it")
    parser.add_argument("--set", action="append", default=[], dest="overrides", metavar="KEY=VALUE")
    given = parser.parse_args()
    scenes = given.scenes or sorted(path.stem for path in (HERE / "scenes").glob("*.yaml"))
    same = [compare(scene, HERE, given.other.resolve(), given.steps, given.overrides) for scene in scenes]
    return 0 if all(same) else 1


if __name__ == "__main__":
    sys.exit(main())
