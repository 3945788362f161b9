"""A scene file as plain data that remembers its lines: YAML, overrides, and where to point when something is wrong."""

from __future__ import annotations

import difflib
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

# An override has no line: it comes after every line of the file.
NO_LINE = float("inf")
# Longer lists of legal words than this are left to the manual.
MOST_WORDS = 8
# Longer words are not told whole.
LONGEST_SHOWN = 80
LONGEST_WORD = 300
# A text of more letters, or with more values when its anchors have been put in, is no scene.
MOST_LETTERS, MOST_VALUES = 1_000_000, 100_000
# A file of numbers of more letters is no record of an experiment.
MOST_LETTERS_OF_TABLES = 20_000_000
# One of more letters takes PyYAML more than a second.
LONG_TEXT = 100_000


class SceneError(Exception):
    """A scene that cannot be run. The text is one line that a user can act on, with file, line and path."""


@dataclass(frozen=True)
class SourceMap:
    """Where each path of a scene was written: `fluids[1].material` -> (31, "landslide.yaml:31").

    The number puts places in the order of the document.
    """

    # Not compared: two scenes are equal when their values are, wherever those were written.
    places: dict[str, tuple[float, str]] = field(default_factory=dict, compare=False)

    def place(self, path: str) -> tuple[float, str]:
        """The place of `path`, or of the nearest part around it that was written at all."""
        while path and path not in self.places:
            path = path[: max(path.rfind("."), path.rfind("["), 0)]
        return self.places.get(path, (0, ""))

    def error(self, path: str, message: str) -> SceneError:
        """The error that says `message` of `path`, for the caller to raise."""
        return SceneError(": ".join(word for word in (self.place(path)[1], shortened(path), message) if word))


def closest(word: object, names: Iterable[str]) -> str:
    """The one of `names` that was meant by `word`; nothing where none is like it."""
    folded = {name.casefold(): name for name in names}
    close = difflib.get_close_matches(str(word)[:LONGEST_SHOWN].casefold(), folded, n=1)
    return folded[close[0]] if close else ""


def nearest(word: object, names: Iterable[str], most: float = MOST_WORDS) -> str:
    """What to add to "no such word": `; did you mean 'water'?`, or a list of the legal names if they are few."""
    names = list(names)
    if close := closest(word, names):
        return f"; did you mean '{close}'?"
    return f"; it can be {', '.join(names)}" if 0 < len(names) <= most else ""


def show(value: object) -> str:
    """A value as the user would recognise it."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, (list, tuple)):
        return "a list"
    return shortened(repr(value))


def shortened(words: str, most: int = LONGEST_SHOWN) -> str:
    """The words, without their middle where they are more than `most` letters."""
    return words if len(words) <= most else f"{words[: most // 2]}...{words[-most // 4 :]}"


def readable(message: str) -> str:
    """A message without the middles of words, paths mostly, that nobody reads to their end."""
    return re.sub(r"\S+", lambda word: shortened(word[0], LONGEST_WORD), message)


def read_text(path: Path | str) -> str:
    """The text of the scene file at `path`. Raises SceneError when there is none to be had."""
    try:
        return _text_of(path, MOST_LETTERS, "scene")
    except FileNotFoundError:
        file = Path(path)
        close = difflib.get_close_matches(file.name, [other.name for other in file.parent.glob("*.yaml")], n=1)
        hint = f"; did you mean '{file.with_name(close[0])}'?" if close else ""
        raise SceneError(f"{path}: no such file{hint}") from None
    except ValueError as error:
        raise SceneError(str(error)) from None


def read_table_text(path: Path | str) -> str:
    """The text of a file of numbers that a scene names. Raises ValueError, of one line, when there is none."""
    if os.path.exists(path) and not os.path.isfile(path):  # a folder; or a device, which may have no end
        raise ValueError(f"{path}: is no file")
    try:
        return _text_of(path, MOST_LETTERS_OF_TABLES, "table")
    except FileNotFoundError:
        raise ValueError(f"{shortened(str(path))}: no such file") from None


def _text_of(path: Path | str, most: int, kind: str) -> str:
    """The text of a file. Raises ValueError, of one line, for any that is no `kind`, and FileNotFoundError."""
    try:
        with Path(path).open(encoding="utf-8-sig") as opened:
            text = opened.read(most + 1)
    except FileNotFoundError:
        raise
    except IsADirectoryError:
        raise ValueError(f"{path}: a folder, not a {kind} file") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not text in UTF-8") from None
    except OSError as error:
        raise ValueError(f"{shortened(str(path))}: cannot be read ({error.strerror})") from None
    if len(text) > most:
        raise ValueError(f"{path}: longer than {most:,} letters; is it a {kind}?")
    return text


def read_yaml(text: str, file: str) -> tuple[Any, SourceMap]:
    """The plain data of a YAML text, and where each path of it stands in `file`.

    Raises SceneError for a text that is not YAML, a key written twice, an anchor inside itself, a tag.
    """
    source = SourceMap()

    def note(path: str, mark: yaml.Mark) -> None:
        source.places[path] = (mark.line + 1, f"{file}:{mark.line + 1}")

    count = 0

    def plain(node: yaml.Node, path: str, above: tuple[yaml.Node, ...]) -> Any:
        nonlocal count
        count += 1
        if count > MOST_VALUES:
            raise SceneError(f"{file}: more than {MOST_VALUES:,} values; is it a scene?")
        if node in above:
            raise source.error(path, "refers to itself")
        if not node.tag.startswith("tag:yaml.org,2002:"):
            raise source.error(path, f"the tag {shortened(node.tag)} means nothing here")
        if isinstance(node, yaml.ScalarNode):
            return _scalar(node)
        above = (*above, node)
        if isinstance(node, yaml.SequenceNode):
            items = []
            for i, item in enumerate(node.value):
                note(f"{path}[{i}]", item.start_mark)
                items.append(plain(item, f"{path}[{i}]", above))
            return items
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = str(key_node.value)
            inner = f"{path}.{key}" if path else key
            first = source.places.get(inner)
            note(inner, key_node.start_mark)
            if first and key in data:
                raise source.error(inner, f"written twice; the first is at {first[1]}")
            data[key] = plain(value_node, inner, above)
        return data

    try:
        root = _compose(text)
        if root is None:
            return None, source
        note("", root.start_mark)
        return plain(root, "", ()), source
    except yaml.MarkedYAMLError as error:
        if "nesting depth" in str(error.problem):
            raise SceneError(f"{file}: nested too deeply to be a scene") from None
        line = f":{error.problem_mark.line + 1}" if error.problem_mark else ""
        raise SceneError(f"{file}{line}: not YAML: {shortened(str(error.problem), 200)}") from None
    except yaml.YAMLError as error:
        raise SceneError(f"{file}: not YAML: {shortened(' '.join(str(error).split()), 200)}") from None
    except RecursionError:
        raise SceneError(f"{file}: nested too deeply to be a scene") from None


def _compose(text: str) -> yaml.Node | None:
    """The nodes of a YAML text; by libyaml, where PyYAML has it, which is six times as fast as PyYAML itself.

    What it does not understand PyYAML reads again, whose words tell more, unless that would take seconds.
    """
    quick = getattr(yaml, "CSafeLoader", None)
    if quick is not None:
        try:
            return yaml.compose(text, Loader=quick)
        except (yaml.YAMLError, UnicodeError) as error:
            if isinstance(error, yaml.YAMLError) and len(text) > LONG_TEXT:
                raise
    return yaml.compose(text, Loader=yaml.SafeLoader)


def _scalar(node: yaml.ScalarNode) -> Any:
    """A scalar by the rules of YAML 1.2, whose 1e-3 is a number, whose 010 is ten and whose `no` is a word."""
    word = node.value
    if node.style:  # quoted; libyaml gives "" for a plain one
        return word
    if word in ("", "~", "null", "Null", "NULL"):
        return None
    if word.lower() in ("true", "false"):
        return word.lower() == "true"
    if re.fullmatch(r"[-+]?[0-9]{1,18}", word):
        return int(word)
    if re.fullmatch(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", word):
        return float(word)
    if re.fullmatch(r"[-+]?\.inf|\.nan", word.lower()):
        return float(word.replace(".", ""))
    return word


def apply_override(data: dict[str, Any], source: SourceMap, override: str) -> None:
    """Put the value of `path=value` into `data`, and note in `source` that it comes from `--set path=value`.

    Raises SceneError for an override without a value, or a path that cannot lead anywhere in `data`.
    """
    label = f"--set {shortened(override)}"
    path, equals, text = (part.strip() for part in override.partition("="))
    if not equals or not re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*|\[\d+\])*", path):
        raise SceneError(f"{label}: a path and a value are needed, such as fluids[0].hold=false")
    try:
        value = read_yaml(text, "")[0]
    except SceneError:
        raise SceneError(f"{label}: {path}: the value is not YAML") from None

    holder: Any = data
    walked = ""
    *inner_keys, last_key = (int(i) if i else name for name, i in re.findall(r"([A-Za-z_]\w*)|\[(\d+)\]", path))
    for key in inner_keys:
        _check_step(holder, key, walked, f"{label}: {path}")
        if walked == "materials" and key not in holder:
            raise SceneError(f"{label}: {path}: no material named '{key}'{nearest(key, holder)}")
        walked += f"[{key}]" if isinstance(key, int) else f".{key}" if walked else key
        if isinstance(key, str) and holder.get(key) is None:
            holder[key] = {}
            source.places[walked] = (NO_LINE, label)
        holder = holder[key]
    _check_step(holder, last_key, walked, f"{label}: {path}")
    holder[last_key] = value
    for inner in [inner for inner in source.places if inner.startswith((f"{path}.", f"{path}["))]:
        del source.places[inner]
    source.places[path] = (NO_LINE, label)


def _check_step(holder: Any, key: str | int, walked: str, label: str) -> None:
    """Refuse to look for `key` in what is at `walked`, if that has no such thing as keys, or as entries."""
    if isinstance(key, str) and not isinstance(holder, dict):
        raise SceneError(f"{label}: {walked} is not a mapping of fields")
    if isinstance(key, int) and not isinstance(holder, list):
        raise SceneError(f"{label}: {walked} is not a list")
    if isinstance(key, int) and key >= len(holder):
        entries = f"{len(holder)} {'entry' if len(holder) == 1 else 'entries'}"
        raise SceneError(f"{label}: {walked} has {entries}, counted from 0")
