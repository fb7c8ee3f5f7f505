"""Figures as pictures of a page: SVG small enough to travel in it, which turns dark with the page."""

import re
from collections.abc import Collection
from urllib.parse import quote

from davinci_forces.report.figures.palette import COLOURS, PALETTE

NAMES = {light: name for name, light in COLOURS.items()}
FONT = "system-ui,-apple-system,'Segoe UI',Roboto,Arial,'DejaVu Sans',sans-serif"
# Characters that a data URL must escape as %XX.
ESCAPED = re.compile(r"[^ !&'()*+,./:;<=>?@\[\]_{|}~0-9A-Za-z-]+")


def looks(used: Collection[str]) -> tuple[str, ...]:
    """The used colours of marks and their surroundings as CSS variables, on a light page and on a dark page."""
    shown = [(name, pair) for name, pair in PALETTE.items() if name in used]
    return tuple(";".join(f"--{name}:{pair[page]}" for name, pair in shown) for page in (0, 1))


def address(svg: str) -> str:
    """The SVG as a data URL; in an attribute, `<` and `>` need no escape, but `&` does."""
    return "data:image/svg+xml," + ESCAPED.sub(lambda signs: quote(signs[0]), svg)


def shrink(svg: str) -> str:
    """The same picture in a third of the characters: styles as classes, and colours as variables."""
    styles: dict[str, str] = {}

    def shorten(tag: re.Match[str]) -> str:
        """A tag with a class for its style, and quotation marks that a data URL need not escape."""
        short = re.sub(
            r' style="([^"]*)"', lambda style: f' class="{styles.setdefault(style[1], f"c{len(styles)}")}"', tag[0]
        )
        return short.replace('"', "'")

    start, *rest = re.split("(?<=>)", re.sub(r"<[^<>]+>", shorten, svg), maxsplit=1)
    return start + _sheet(styles) + "".join(rest)


def _sheet(styles: dict[str, str]) -> str:
    """The style sheet of a picture: its classes, and its colours in light and dark."""
    classes = "".join(f".{name}{{{_declarations(style)}}}" for style, name in styles.items())
    light, dark = looks([name for name in NAMES.values() if f"var(--{name})" in classes])
    return (
        f"<style>:root{{{light}}}@media(prefers-color-scheme:dark){{:root{{{dark}}}}}"
        f"*{{stroke-linejoin:round;stroke-linecap:butt}}{classes}</style>"
    )


def _declarations(style: str) -> str:
    style = re.sub(r"font-family: [^;]*", f"font-family:{FONT}", style)
    style = re.sub("#[0-9a-f]{6}", lambda colour: f"var(--{NAMES[colour[0]]})", style)
    return re.sub(r"\s*([:;,])\s*", r"\1", style)
