"""Figures inside a page: their SVG with ids of its own, and letters that all figures of the page share."""

import re

from pipeline.report.content import Figure, Figure3D
from pipeline.report.figures.svg import svg

LETTER = re.compile(r'<path id="(DejaVu[\w-]+)"[^>]*/>')
SYMBOLS = re.compile(r'(?:<use href="[^"]*" x="[^"]*" y="[^"]*" (style="[^"]*")/>)(?:<use [^>]* \1/>)+')


def inline_svg(figure: Figure | Figure3D, prefix: str, letters: dict[str, str]) -> str:
    """The SVG of a figure for HTML; the outlines of its letters go to `letters`, once for all figures of the page."""
    text = re.sub(r"<!--.*?-->|<defs>\s*<style.*?</style>\s*</defs>", "", svg(figure), flags=re.DOTALL)
    letters.update((match[1], match[0]) for match in LETTER.finditer(text))
    text = LETTER.sub("", text).replace("xlink:href", "href")
    text = _prefix_ids(text, prefix)
    text = re.sub(r"<defs>\s*</defs>", "", re.sub(r">\s+<", "><", text))
    text = SYMBOLS.sub(_group_symbols, text)
    return text.replace("<svg ", '<svg style="stroke-linejoin:round;stroke-linecap:butt" aria-hidden="true" ', 1)


def _prefix_ids(text: str, prefix: str) -> str:
    """Ids that something refers to get the prefix, others go; letters keep theirs."""
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', text))
    letters = {name for name in used if name.startswith("DejaVu")}

    def rename(match: re.Match[str]) -> str:
        return f' id="{prefix}-{match[1]}"' if match[1] in used else ""

    text = re.sub(r' id="([^"]+)"', rename, text)
    text = re.sub(r'href="#([^"]+)"', lambda m: m[0] if m[1] in letters else f'href="#{prefix}-{m[1]}"', text)
    return re.sub(r"url\(#([^)]+)\)", rf"url(#{prefix}-\1)", text)


def _group_symbols(symbols: re.Match[str]) -> str:
    """Symbols of one style, the style written once."""
    return f"<g {symbols[1]}>{symbols[0].replace(' ' + symbols[1], '')}</g>"
