"""Figures as pictures of a page: SVG small enough to travel in it, which turns dark with the page."""

import re
from collections.abc import Callable, Collection
from urllib.parse import quote

from davinci_forces.report.figures.palette import COLOURS, DARK, SURROUNDINGS

NAMES = {light: name for name, light in COLOURS.items()} | {light: name for name, (light, _) in SURROUNDINGS.items()}
FONT = "system-ui,-apple-system,'Segoe UI',Roboto,Arial,'DejaVu Sans',sans-serif"
# Characters that a data URL must escape as %XX.
ESCAPED = re.compile(r"[^ !&'()*+,./:;<=>?@\[\]_{|}~0-9A-Za-z-]+")


def looks(used: Collection[str]) -> tuple[str, ...]:
    """The used colours of marks and their surroundings as CSS variables, on a light page and on a dark page."""
    light = COLOURS | {name: pair[0] for name, pair in SURROUNDINGS.items()}
    dark = DARK | {name: pair[1] for name, pair in SURROUNDINGS.items()}
    return tuple(";".join(f"--{name}:{side[name]}" for name in side if name in used) for side in (light, dark))


def address(svg: str) -> str:
    """The SVG as a data URL; in an attribute, `<` and `>` need no escape, but `&` does."""
    return "data:image/svg+xml," + ESCAPED.sub(lambda signs: quote(signs[0]), svg)


def shrink(svg: str) -> str:
    """The same picture in a third of the characters: styles as classes, colours as variables, no unused names."""
    svg = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<defs>\s*<style.*?</style>\s*</defs>", "", svg, flags=re.DOTALL)
    svg = svg.replace("xlink:href", "href").replace(' xmlns:xlink="http://www.w3.org/1999/xlink"', "")
    svg = re.sub(r">\s+<", "><", svg)
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', svg))
    styles: dict[str, str] = {}
    svg = _in_tags(svg, lambda tag: _short_tag(tag, used, styles))
    svg = _without_empty_groups(svg)
    svg = re.sub(r"(<svg [^>]*>)", lambda tag: tag[1] + _sheet(svg, styles), svg, count=1)
    return _in_tags(svg, lambda tag: tag.replace('"', "'"))  # which a data URL need not escape


def _in_tags(svg: str, change: Callable[[str], str]) -> str:
    """Apply a change to the tags of an SVG, not to its text; in text, `<` is escaped."""
    return re.sub(r"<[^<>]+>", lambda tag: change(tag[0]), svg)


def _short_tag(tag: str, used: set[str], styles: dict[str, str]) -> str:
    def name_class(style: re.Match[str]) -> str:
        return f' class="{styles.setdefault(style[1], _letters(len(styles)))}"'

    tag = re.sub(r' id="([^"]+)"', lambda name: name[0] if name[1] in used else "", tag)
    tag = re.sub(r' transform="rotate\(-0 [^"]*"', "", tag)
    return re.sub(r' style="([^"]*)"', name_class, tag).replace("\n", " ")


def _letters(number: int) -> str:
    """The name of a class: a, b, ..., z, ba, bb, ..."""
    name = ""
    while not name or number:
        name, number = chr(97 + number % 26) + name, number // 26
    return name


def _without_empty_groups(svg: str) -> str:
    """The SVG without groups that have no attributes."""
    before = ""
    while before != svg:
        before, svg = svg, re.sub(r"<g>((?:(?!</?g\b).)*)</g>", r"\1", svg, flags=re.DOTALL)
    return svg.replace("<defs></defs>", "").replace("<defs/>", "")


def _sheet(svg: str, styles: dict[str, str]) -> str:
    """The style sheet of a picture: its classes, and its colours in light and dark."""
    classes = "".join(f".{name}{{{_declarations(style)}}}" for style, name in styles.items())
    light, dark = looks([name for name in NAMES.values() if f"var(--{name})" in classes])
    return (
        f"<style>:root{{{light}}}@media(prefers-color-scheme:dark){{:root{{{dark}}}}}"
        f"*{{stroke-linejoin:round;stroke-linecap:butt}}{classes}</style>"
    )


def _declarations(style: str) -> str:
    def name_colour(colour: re.Match[str]) -> str:
        return f"var(--{NAMES[colour[0]]})" if colour[0] in NAMES else colour[0]

    style = re.sub(r"font-family: [^;]*", f"font-family:{FONT}", style)
    style = re.sub(r"#[0-9a-f]{6}", name_colour, style)
    return re.sub(r"\s*([:;,])\s*", r"\1", style).strip(";")
