"""Changes since the baseline: an earlier report that the study names, of itself or of another study."""

import math
from collections.abc import Iterator, Mapping, Sequence

from davinci_forces.report.changes import Change, StatedValue, changes
from davinci_forces.report.content import Block, Listing, Number, OnScreen, Prose, Table, in_format, literal
from davinci_forces.report.context import Context, count
from davinci_forces.report.results import format_unit
from davinci_forces.report.sections.parts import PAPER, explanation, paper_or_screen, section_of

MAX_ROWS = 300  # of a table; `davinci-forces compare` prints all changes
PRINTED_CHANGES = 10  # of many changes, on paper


@section_of("Since the baseline", "baseline")
def section(context: Context) -> Iterator[Block]:
    """How many numbers changed, the largest changes, and the keys that came or went."""
    if context.baseline is not None:
        now = {key: StatedValue(r.value, r.std, r.unit) for key, r in context.results.items()}
        yield from blocks(context, context.baseline, changes(context.baseline, now))


def blocks(context: Context, before: Mapping[str, StatedValue], differences: Sequence[Change]) -> Iterator[Block]:
    """The section's content."""
    changed = sorted((c for c in differences if c.before and c.after), key=lambda c: c.weight, reverse=True)
    came, went = [c.key for c in differences if not c.before], [c.key for c in differences if not c.after]
    shared = sum(key in context.results for key in before)
    yield Prose(
        f"This report shares {count(shared, 'number')} with its baseline, `{literal(context.study.baseline)}`. "
        f"{len(changed)} of them changed. New numbers: {len(came)}; missing: {len(went)}. {explanation('baseline')}"
    )
    if changed:
        rows = [
            (literal(c.key), literal(_text(c.before)), context.number(c.key), in_format(c.z or math.nan, "+.1f"))
            for c in changed[:MAX_ROWS]
        ]
        header, tables = ("Number", "a, the baseline", "b, now", "Standard errors"), []
        for most, label in ((PRINTED_CHANGES, "baseline-first"), (MAX_ROWS, "baseline-changes")):
            which = f"The first {most} of " * (len(changed) > most) + count(len(changed), "change")
            caption = explanation("baseline-changes", which=which)
            tables.append(Table(caption, header, rows[:most], label, "lrrr"))
        yield from tables[:1] if len(rows) > PAPER else ()
        yield from paper_or_screen(tables[1], "Changes since the baseline")
    for keys, what, anchor in ((came, "new", "baseline-came"), (went, "missing", "baseline-went")):
        if keys:
            more = [f"and {len(keys) - MAX_ROWS} more"] if len(keys) > MAX_ROWS else []
            listed = Listing("\n".join([*keys[:MAX_ROWS], *more]))
            yield OnScreen(f"{count(len(keys), what + ' key')}", anchor, (listed,))


def _text(stated: StatedValue | None) -> str:
    assert stated  # of a number that both reports have
    if stated.number is None:
        return str(stated.value)
    return str(Number(stated.number, format_unit(stated.unit), stated.std))
