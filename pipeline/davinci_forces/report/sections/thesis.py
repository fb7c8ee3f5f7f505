"""The thesis chapter by chapter: where each table, figure and equation is here, and its numbers beside ours."""

from collections.abc import Iterator

from davinci_forces.report.content import Block, Prose, Table, literal, message
from davinci_forces.report.context import Context
from davinci_forces.report.sections.parts import section_of
from davinci_forces.simulation.thesis import chapters, in_words, numbers

STUDY = "davinci-thesis"  # of the thesis's identification


@section_of("The thesis, chapter by chapter", "thesis")
def section(context: Context) -> Iterator[Block]:
    """A table for each chapter, and one of the printed numbers; only in simulations of the thesis's experiments."""
    if not context.compares_with_thesis:
        return
    of_thesis = context.study.truth.get("scenario") == STUDY
    results = {key: (result.value, result.std or 0.0) for key, result in context.results.items() if of_thesis}
    compared = numbers(results)
    yield Prose(in_words(compared))
    for chapter in chapters():
        rows = tuple((literal(row.item), literal(row.shows), row.here, message(row.differs)) for row in chapter.rows)
        yield Table(f"Chapter {chapter.title}.", ("Item", "Shows", "Here", "Differs"), rows, align="llll")
    header = ("Item", "Numbers", "Printed", "Here", "Why")
    lines = tuple(
        (literal(x.item), literal(x.name), *map(message, (x.printed_text, x.here_text, x.why * bool(x.differ.any()))))
        for x in compared
    )
    yield Table("Numbers of the thesis, as printed and here.", header, lines, align="lllll")
