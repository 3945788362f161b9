"""Whether a run can go on as a scene that may have changed since."""

import logging
from pathlib import Path

import yaml

from warpsph.output.checkpoint import differences, find_checkpoint
from warpsph.output.claim import FolderError, digest, read_json
from warpsph.output.records import TIME_ROUNDING, last_time
from warpsph.output.run_folder import DONE
from warpsph.output.ticks import Ticks
from warpsph.scene.scene import Scene

log = logging.getLogger("warpsph")

# What may differ when a run goes on: nothing of it moves a particle.
SOUND = ("title", "source", "allow", "run.end_time", "run.max_steps", "output")
MOST_NAMED = 12  # A line of more fields that differ is not read to its end.


def refuse_unsound(scene: Scene, folder: Path) -> Scene:
    """Raise unless the run in `folder` can go on as `scene`, of which nothing was changed but outputs and the end.

    Nothing is touched. Returns the scene with the neighbours that the run has chosen.

    Raises:
        CheckpointError: there is none to go on from.
        FolderError: the run has come farther than that, or to its end, or the scene is another one.
        FileNotFoundError: a frame of the cache is missing.
    """
    reached = find_checkpoint(folder / "checkpoints")
    if reached.scene:
        if scene.neighbours == "auto":
            scene = scene.model_copy(update={"neighbours": yaml.safe_load(reached.scene)["neighbours"]})
        changed = differences(reached.scene, scene.resolved_yaml() + files_of(scene))
        unsound = [path for path in changed if not _is_sound(path, scene)]
        if unsound:
            named = "; ".join(f"{path} was {changed[path]}" for path in unsound[:MOST_NAMED])
            more = f"; and {len(unsound) - MOST_NAMED} more" if len(unsound) > MOST_NAMED else ""
            raise FolderError(f"{folder}: a run goes on as it began, but {named}{more}; set back, or run anew")
        for path in changed:
            log.log(
                logging.INFO if path == "run.end_time" else logging.WARNING,
                *("%s: goes on with %s, which was %s", folder, path, changed[path]),
            )
    else:
        log.warning("%s: does not tell its scene; whether that was changed since cannot be told", reached.path)
    end, facts = scene.run.end_time, read_json(folder / "run.json")
    now = max(reached.time, last_time(folder / "energy.csv"))
    if end < now - TIME_ROUNDING:
        raise FolderError(f"{folder}: has reached t = {now:g} s, which is beyond {end:g} s; give a later --until")
    if reached.time >= end and facts.get("outcome") == DONE:
        raise FolderError(f"{folder}: is done, at t = {now:g} s; a later --until goes on from there")
    if scene.run.max_steps is not None and reached.step >= scene.run.max_steps:
        raise FolderError(f"{folder}: has done {reached.step} steps, all that run.max_steps allows; give more")
    if scene.output.usd:
        from warpsph.output.usd import require_frames  # USD takes a while to load

        frames = Ticks(scene.output.frames_per_second, max(reached.time, 0.0), is_done=reached.time >= 0.0)
        require_frames(folder / "usd", frames.index)
    return scene


def files_of(scene: Scene) -> str:
    """What the files hold that a scene names, as one more field of its YAML: their digests by their paths."""
    parts = [*(part for body in scene.bodies for part in (body.shape.mesh, body.motion)), scene.wave_maker]
    paths = [Path(part.file) for part in parts if part is not None and part.file]
    known = {str(path): digest(path.read_bytes())[:12] if path.is_file() else "absent" for path in paths}
    return yaml.safe_dump({"files": known}) if known else ""


def _is_sound(path: str, scene: Scene) -> bool:
    """Whether a run can go on though the field at `path` differs: if it moves no particle, and breaks no sequence."""
    if path == "output.frames_per_second":
        return not (scene.output.pictures or scene.output.usd)  # the frames so far would be at other times
    if path == "output.usd":
        return not scene.output.usd  # the frames so far would be missing
    return any(path == sound or path.startswith((f"{sound}.", f"{sound}[")) for sound in SOUND)
