"""Plain words for whatever is wrong with a field of a scene."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from warpsph.scene.fields import COLOR, NAME, Part, part_types
from warpsph.scene.source import closest, nearest, show

_NEEDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing_size": "a whole number",
    "bool_type": "true or false",
    "string_type": "text",
    "string_unicode": "text without half letters",
    "tuple_type": "a list",
    "dict_type": "a mapping",
    "model_type": "a mapping of fields",
    "finite_number": "a finite number",
}
_BOUNDS = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}
_PATTERNS = {NAME: "a name made of letters, digits and _ is needed", COLOR: 'a colour such as "#8a6a4a" is needed'}
# Below a bound as small as this a number is as good as none.
_NEXT_TO_NOTHING = 1e-3


def mistakes(error: ValidationError, whole: type[Part]) -> Iterator[tuple[str, str]]:
    """(path, message) of all mistakes that pydantic found in a `whole`, in our words."""
    found = error.errors(include_url=False)
    # A list counts as too short when its entries are wrong: the entries are what to name.
    found = [mistake for mistake in found if mistake["type"] != "too_short"] or found
    unknown = {(*mistake["loc"][:-1], _meant(mistake["loc"], whole)) for mistake in found if _is_unknown(mistake)}
    for mistake in found:
        # A key that is misspelt is named, rather than the field that it leaves missing.
        if mistake["type"] == "missing" and tuple(mistake["loc"]) in unknown:
            continue
        if mistake["type"] == "faults":
            yield from mistake["ctx"]["found"]
        else:
            yield _explain(mistake, whole)


def _is_unknown(mistake: Mapping[str, Any]) -> bool:
    return mistake["type"] == "extra_forbidden"


def _meant(loc: Sequence[Any], whole: type[Part]) -> str:
    """The field that an unknown key is close to; nothing where it is close to none."""
    return closest(loc[-1], _fields_at(loc, whole))


def _fields_at(loc: Sequence[Any], whole: type[Part]) -> list[str]:
    """The fields of the part of `whole` in which the last key of `loc` stands."""
    part = whole
    for key in loc[:-1]:
        if isinstance(key, str) and key in part.model_fields:
            part = next(part_types(part.model_fields[key].annotation), part)
    return list(part.model_fields)


def _explain(mistake: Mapping[str, Any], whole: type[Part]) -> tuple[str, str]:
    """(path, message) of one mistake that pydantic found, in our words."""
    path = ""
    for key in mistake["loc"]:
        if isinstance(key, int):
            path += f"[{key}]"
        elif not key.startswith(("<", "[key]")):  # pydantic's marks for "which of a union" and "the key itself"
            path += f".{key}" if path and key else key
    kind, value, context = mistake["type"], mistake["input"], mistake.get("ctx", {})
    if kind == "fault":
        inner = context["path"]
        return (f"{path}.{inner}" if path and inner else path + inner), context["message"]
    if _is_unknown(mistake):
        return path, f"no such field{nearest(mistake['loc'][-1], _fields_at(mistake['loc'], whole), most=math.inf)}"
    if kind == "missing":
        return path, "this field is missing"
    if kind in _NEEDS:
        return path, f"{_NEEDS[kind]} is needed, not {show(value)}"
    if kind in _BOUNDS:
        bound, words = _BOUNDS[kind]
        limit = context[bound]
        if bound == "ge" and 0 < limit <= _NEXT_TO_NOTHING and value <= 0:
            words, limit = "more than", 0
        return path, f"must be {words} {limit:g}, not {show(value)}"
    if kind == "literal_error":
        names = re.findall(r"[\w.]+", context["expected"].replace(" or ", " "))
        return path, f"{show(value)} is not known here{nearest(value, names)}"
    if kind == "string_pattern_mismatch":
        return path, f"{_PATTERNS[context['pattern']]}, not {show(value)}"
    if kind == "string_too_long":
        return path, f"is longer than {context['max_length']} letters"
    if kind == "too_short":
        return path, f"needs {context['min_length']} or more entries, not {context['actual_length']}"
    if kind == "too_long":
        return path, f"has more than {context['max_length']} entries, which is the most"
    return path, f"{show(value)} is not what is needed here"
