"""Run Typst without files, system fonts, clock or packages; any warning is an error.  Draw equations as SVG."""

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from davinci_forces.errors import PipelineError

EPOCH = 0  # date that Typst writes into a file; constant, so that the same content gives the same bytes


class NotTypeset(PipelineError):
    """Typst refuses the report, or warns about it."""


def typeset(template: Path, content: Any, output: Literal["pdf", "svg"]) -> list[bytes]:
    """Compile a template that reads `content` as data, never as markup; one item per page of SVG, one for a PDF.

    Raises NotTypeset if Typst fails or warns, with its own message.
    """
    import matplotlib as mpl
    import typst

    # The fonts that figures are drawn with, the same on every machine.
    fonts: list[Any] = [Path(mpl.get_data_path()) / "fonts/ttf"] if output == "pdf" else []
    try:
        pages: Any
        pages, warnings = typst.compile_with_warnings(
            template.read_bytes(),
            format=output,
            ignore_system_fonts=True,
            font_paths=fonts,
            sys_inputs={"content": json.dumps(content, ensure_ascii=False)},
            timestamp=EPOCH,
        )
    except typst.TypstError as error:
        raise NotTypeset(f"{template.name}: {error}") from error
    if warnings:
        raise NotTypeset(f"{template.name}: " + "; ".join(str(warning) for warning in warnings))
    return pages if isinstance(pages, list) else [pages]


EQUATIONS_TEMPLATE = Path(__file__).parent / "templates/equations.typ"
SIZE = 10.0  # [pt] of the text in the template
STRUT = 20.0  # [pt] height of the strut that an inline formula stands on in the template; it marks the baseline
ROOM = 12.0  # [pt] of the strut that is shown; inline formulas are lower


class Formula(NamedTuple):
    """One formula: Typst's maths, and whether it has a line of its own."""

    typst: str
    display: bool


@dataclass(frozen=True)
class Drawing:
    """The inside of an SVG, its view box, and its size and depth below the baseline [em]."""

    body: str
    view: str
    width: float
    height: float
    depth: float


def draw_formulas(formulas: list[Formula]) -> tuple[dict[Formula, Drawing], str]:
    """Draw each formula; returns the drawings and the shapes of all letters, to be put into the page once."""
    distinct = sorted(set(formulas))
    if not distinct:
        return {}, ""
    pages = [page.decode() for page in _pages(distinct)]
    symbols = {name: symbol for page in pages for symbol, name in re.findall(r'(<symbol id="(\w+)".*?</symbol>)', page)}
    drawn = {formula: _drawing(formula, page) for formula, page in zip(distinct, pages, strict=True)}
    return drawn, "".join(symbols[name] for name in sorted(symbols))


def _pages(formulas: list[Formula]) -> list[bytes]:
    try:
        return typeset(EQUATIONS_TEMPLATE, [formula._asdict() for formula in formulas], "svg")
    except NotTypeset:
        for formula in formulas:  # names the wrong formula, which Typst does not
            try:
                typeset(EQUATIONS_TEMPLATE, [formula._asdict()], "svg")
            except NotTypeset as error:
                raise NotTypeset(f"the equation {formula.typst!r}: {error}") from error
        raise


def _drawing(formula: Formula, page: str) -> Drawing:
    tag, _, body = page.partition(">")
    width, height = (float(re.search(rf' {side}="([\d.]+)pt"', tag)[1]) for side in ("width", "height"))  # type: ignore[index]
    body = re.sub(r"<defs>.*?</defs>", "", body.removesuffix("</svg>"), flags=re.DOTALL).replace("xlink:href", "href")
    body = body.replace('"#000000"', '"currentColor"')
    top = 0.0 if formula.display else STRUT - ROOM
    depth = 0.0 if formula.display else height - STRUT
    view = f"0 {top:g} {width:g} {height - top:.4g}"
    return Drawing(body, view, width / SIZE, (height - top) / SIZE, depth / SIZE)
