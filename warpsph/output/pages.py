"""HTML pages from the templates beside this file: numbers in words, plots inside, nothing else needed."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import jinja2
import matplotlib
from markupsafe import Markup, escape
from matplotlib.figure import Figure

from warpsph.output.claim import write_whole

NARROW_SPACE = "\u202f"  # which does not break
# Named in plots, for whatever reader has them; the first is the one that Matplotlib measures with.
FONTS = ["DejaVu Sans", "Verdana", "Segoe UI", "Helvetica", "Arial", "sans-serif"]
OURS = "<!-- written by warpsph -->"


class PageError(ValueError):
    """A page cannot be written; the text is one line for the user."""


def render(template: str, **values: Any) -> str:
    """The page of the template beside this file that is called `template`."""
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, undefined=jinja2.StrictUndefined)
    environment.filters["told"] = told
    text = Path(__file__).with_name(template).read_text(encoding="utf-8")
    return environment.from_string(text).render(**values)


def is_ours(page: Path) -> bool:
    """Whether a page is there, and is one of this kind."""
    return page.is_file() and OURS in page.read_text(encoding="utf-8", errors="replace")[:200]


def write_table(
    page: Path,
    *,
    title: str,
    words: Sequence[str],
    headings: Sequence[str],
    rows: Sequence[Sequence[Any]],
    links: Mapping[str, str],
    figures: Sequence[tuple[str, Figure]],
) -> None:
    """Write a page of one table and plots below it.

    Args:
        page: The file; one that is there is replaced if it is a page of this kind.
        title, words: What stands above the table.
        headings, rows: The table; columns that say nothing are left out.
        links: Where the entries of the first column lead, by what they say.
        figures: What each plot is called, and the plot.

    Raises:
        PageError: the file is there and is not ours.
    """
    if page.exists() and not is_ours(page):
        raise PageError(f"{page}: is there already, and was not written by warpsph; choose another --out")
    plots = [(caption, plot(figure)) for caption, figure in figures]
    shown = [column for column in range(len(headings)) if any(row[column] not in (None, "") for row in rows)]
    headings, rows = [headings[column] for column in shown], [[row[column] for column in shown] for row in rows]
    text = render("table.html.jinja", title=title, words=words, headings=headings, rows=rows, links=links, plots=plots)
    write_whole(page, text)


def plot(figure: Figure) -> str:
    """A plot as the source of an image."""
    picture = BytesIO()
    # The same plot gets the same names within, and the same bytes, wherever it is drawn. Letters stay letters: their
    # outlines would take half of the time.
    with matplotlib.rc_context({"svg.hashsalt": "warpsph", "svg.fonttype": "none", "font.sans-serif": FONTS}):
        figure.savefig(picture, format="svg", metadata={"Date": None})
    return embedded(picture.getvalue(), "image/svg+xml")


def embedded(data: bytes, kind: str) -> str:
    """A file as the source of an image or a film."""
    return f"data:{kind};base64,{b64encode(data).decode()}"


def told(value: Any) -> Markup | str:
    """A fact as it is read: digits in groups of three, numbers to four significant digits."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return f"{value:,}".replace(",", NARROW_SPACE)
    if isinstance(value, float):
        text = f"{value:,.0f}" if 1e4 <= abs(value) < 1e15 else f"{value:.4g}"
        return text.replace(",", NARROW_SPACE).replace("-", "−")
    if isinstance(value, Mapping):
        return Markup("<br>").join(Markup("{}: {}").format(str(key), told(part)) for key, part in value.items())
    if isinstance(value, (list, tuple)):
        return Markup("<br>").join(told(part) for part in value)
    return "–" if value is None else escape(str(value))
