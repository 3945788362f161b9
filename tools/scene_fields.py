"""Write the tables of scenes/README.md that list the fields of a scene, from the descriptions in its own models.

A table stands between `<!-- fields of Scene -->` and `<!-- end -->`, and has a row for each field of that model. What
stands outside of such a pair is left alone.

    python tools/scene_fields.py            write the tables anew
    python tools/scene_fields.py --check    only tell whether they would change; 1 if so
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from warpsph.scene.fields import Part, part_types
from warpsph.scene.scene import Scene

MANUAL = Path(__file__).resolve().parents[1] / "scenes" / "README.md"
TABLE = re.compile(r"(<!-- fields of (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
# What a description may have in square brackets that is a unit, and not a point or a list.
UNIT = re.compile(
    r" \[((?:-|deg|degrees|steps|(?:k?g|m|s|N|J|Pa|rad|1)\d?(?:[ /](?:kg|m|s|N|J|Pa)\S*)*)(?:, degrees)?)\]"
)

# A greater bound only catches slips, and says nothing of what a field is for.
MOST_TOLD = 200


def models(model: type[Part] = Scene) -> dict[str, type[Part]]:
    """The models that make up a scene by their names, `model` first, each one before its own parts."""
    found = {model.__name__: model}
    for field in model.model_fields.values():
        for part in part_types(field.annotation):
            found |= {name: one for name, one in models(part).items() if name not in found}
    return found


def table(model: type[Part]) -> str:
    """The fields of a model as a table in Markdown."""
    rows = ["| field | unit | default | meaning |", "|---|---|---|---|"]
    for name, field in model.model_fields.items():
        unit, meaning = _unit_and_meaning(field)
        rows.append(f"| `{name}` | {f'{unit} ' if unit else ''}| {_default(field)} | {meaning} |")
    return "\n".join(rows) + "\n"


def _unit_and_meaning(field: FieldInfo) -> tuple[str, str]:
    """The first unit of a description, and the rest of the words, with the names that a field may have as code."""
    words = field.description or ""
    units = UNIT.findall(words)
    if units:
        words = UNIT.sub("", words, count=1)
    choices = _choices(field.annotation)
    words = re.sub(r"(?<![\w`\"])[a-z0-9]+(?:_[a-z0-9]+)+(?![\w`\"])", r"`\g<0>`", words)
    for choice in choices:
        # A word such as stress is a name where it comes first, and a word of English from then on.
        count = 0 if len(choice) == 1 else 1
        if f"`{choice}`" not in words:
            words = re.sub(rf"(?<![\w`\"]){re.escape(choice)}(?![\w`\"])", f"`{choice}`", words, count=count)
    if any(f"`{choice}`" not in words for choice in choices):
        words += " One of " + ", ".join(f"`{choice}`" for choice in choices) + "."
    words += _bounds(field)
    return "" if not units or units[0] == "-" else units[0], words


def _choices(annotation: Any) -> list[str]:
    """The names that a field takes, where it takes names."""
    if get_origin(annotation) is Literal:
        return [choice for choice in get_args(annotation) if isinstance(choice, str)]
    return [choice for argument in get_args(annotation) for choice in _choices(argument)]


def _bounds(field: FieldInfo) -> str:
    """From what to what a number may be, where it has an end on either side."""
    bounds = {
        name: getattr(one, name) for one in field.metadata for name in ("ge", "gt", "le", "lt") if hasattr(one, name)
    }
    low, high = bounds.get("ge", bounds.get("gt")), bounds.get("le", bounds.get("lt"))
    if low is None or high is None or high > MOST_TOLD:
        return ""
    return f" From {low:g} to {high:g}." if "ge" in bounds else f" More than {low:g}, at most {high:g}."


def _default(field: FieldInfo) -> str:
    """What a field is when it is left out."""
    if field.is_required():
        return "needed"
    value = field.default
    if isinstance(value, Part):
        return "below"
    if value is None or value in ((), ""):
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, str):
        return f"`{value}`"
    return f"`[{', '.join(f'{one:g}' for one in value)}]`" if isinstance(value, tuple) else f"{value:g}"


def renewed(text: str) -> str:
    """The manual with each of its tables made anew."""
    known = models()
    return TABLE.sub(lambda found: found[1] + table(known[found[2]]) + found[3], text)


def main(arguments: list[str]) -> int:
    """Write the manual, or with --check tell whether it is as it would be written."""
    text = MANUAL.read_text(encoding="utf-8")
    if arguments == ["--check"]:
        if renewed(text) != text:
            print(f"{MANUAL}: the tables of fields are old; python tools/scene_fields.py makes them anew")
            return 1
        return 0
    MANUAL.write_text(renewed(text), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
