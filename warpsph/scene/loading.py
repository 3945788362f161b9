"""From a scene file to a scene, or to plain words for whatever is wrong with it.

A scene is one YAML file. `load_scene` reads it into frozen models, which are also the JSON Schema that an editor
completes from: `scene`, whose fields are in `whole`, and their parts in the files beside it. Every mistake ends as a
`SceneError` whose text is the finished line for the user, all that are found at once a line each:

    landslide.yaml:31: fluids[1].material: no material named 'watr'; did you mean 'water'?

SI units throughout, z up, angles in degrees. A point is [x, z], in a 3-D scene [x, y, z].
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from warpsph.scene.mistakes import mistakes
from warpsph.scene.scene import Scene
from warpsph.scene.source import SceneError, apply_override, read_text, read_yaml, show

# More mistakes than this are not read to their end.
MOST_MISTAKES = 12


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a scene file, for editors."""
    return Scene.model_json_schema()


def load_scene(path: Path | str, overrides: Sequence[str] = ()) -> Scene:
    """Read the scene file at `path`, with `overrides` such as `materials.water.alpha=0.03` on top.

    Raises SceneError for a file that cannot be read, is not YAML, or is not a scene: for all its mistakes, a line each,
    in the order of the file.
    """
    data, source = read_yaml(read_text(path), str(path))
    if data is None:
        raise SceneError(f"{path}: the file is empty")
    if not isinstance(data, dict):
        raise source.error("", f"a scene is a mapping of fields, not {show(data)}")
    for override in overrides:
        apply_override(data, source, override)
    _find_files(data, Path(path).parent)
    try:
        scene = Scene.model_validate(data)
    except ValidationError as error:
        found = sorted(mistakes(error, Scene), key=lambda mistake: source.place(mistake[0])[0])
        lines = [str(source.error(*mistake)) for mistake in found[:MOST_MISTAKES]]
        if len(found) > MOST_MISTAKES:
            lines.append(f"and {len(found) - MOST_MISTAKES} mistakes more")
        raise SceneError("\n".join(lines)) from None
    scene._source = source
    return scene


def _find_files(data: dict[str, Any], folder: Path) -> None:
    """Make the paths of files that a scene names absolute, so that the scene of the run folder finds them too."""
    for kind in ("gauges", "probes"):
        parts = data.get(kind)
        for part in parts if isinstance(parts, list) else ():
            seen = part.get("observed") if isinstance(part, dict) else None
            if isinstance(seen, dict) and isinstance(seen.get("file"), str):
                seen["file"] = os.path.abspath(folder / seen["file"])
    maker = data.get("wave_maker")
    if isinstance(maker, dict) and isinstance(maker.get("file"), str):
        maker["file"] = os.path.abspath(folder / maker["file"])
    bodies = data.get("bodies")
    for body in bodies if isinstance(bodies, list) else ():
        shape = body.get("shape") if isinstance(body, dict) else None
        for part in (
            shape.get("mesh") if isinstance(shape, dict) else None,
            isinstance(body, dict) and body.get("motion"),
        ):
            if isinstance(part, dict) and isinstance(part.get("file"), str):
                part["file"] = os.path.abspath(folder / part["file"])
