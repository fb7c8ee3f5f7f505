"""Running Typst: no file, no system font, no clock, no package, and no warning goes unheard."""

import json
from pathlib import Path
from typing import Any, Literal

from davinci_forces.errors import PipelineError

EPOCH = 0  # the date that Typst puts in a file, so that the same content gives the same bytes


class NotTypeset(PipelineError):
    """Typst refuses the report, or warns about it."""


def _drawing_fonts() -> str:
    """The folder of the fonts that figures are drawn with, the same on every machine."""
    import matplotlib as mpl

    return str(Path(mpl.get_data_path()) / "fonts/ttf")


def typeset(template: Path, content: Any, output: Literal["pdf", "svg"]) -> list[bytes]:
    """Compile a template that reads `content` as data, never as markup; one item per page of SVG, one for a PDF.

    Raises
    ------
    NotTypeset
        If Typst fails or warns, with its own message.
    """
    import typst

    fonts: list[Any] = [_drawing_fonts()] if output == "pdf" else []
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
