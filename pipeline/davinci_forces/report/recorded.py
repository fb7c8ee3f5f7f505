"""What was recorded, and what the readers noticed: the beginning of the section on runs."""

from collections.abc import Iterator
from dataclasses import replace

from davinci_forces.records import Diagnostic, LogSummary, Signal
from davinci_forces.report.content import Block, Bullets, Number, Prose, Table, Verdict, literal
from davinci_forces.report.context import Context, count, listed


def recorded(context: Context, summaries: list[LogSummary]) -> Iterator[Block]:
    """One table over all logs, and what the readers and the first stages remarked."""
    if not summaries:
        return
    yield from listed(overview(context, summaries))
    clean = [summary for summary in summaries if not remarks(summary)]
    if clean:
        all_of_them = len(clean) == len(summaries)
        which = "Every log was" if all_of_them else f"{len(clean)} of {count(len(summaries), 'log')} were"
        yield Verdict("good", f"{which} read without a remark.")
    yield from (
        Verdict("warn", f"**{literal(summary.log)}**: {literal('; '.join(remarks(summary)))}.")
        for summary in summaries
        if remarks(summary)
    )
    methods = sorted({(s.method, s.velocity) for s in context.catalogue.all(Signal)})
    if methods:
        yield Prose("How the recordings were put on a uniform clock, and where their velocities come from:")
        yield Bullets(
            tuple(f"clock: {method}; velocity: {velocity_source(velocity, context)}" for method, velocity in methods)
        )
    remarks_of_stages = [
        literal(text)
        for diagnostic in context.catalogue.all(Diagnostic)
        if diagnostic.stage in ("ingest", "resample", "average")
        for text in diagnostic.text
    ]
    if remarks_of_stages:
        yield Prose("Remarks of the readers and of the first stages:")
        yield Bullets(tuple(remarks_of_stages))


def velocity_source(velocity: str, context: Context) -> str:
    """Where a velocity comes from."""
    cutoff = context.study.settings.lowpass
    derived = f"differences of the position after a zero-phase low-pass at {cutoff:g} Hz"
    return "as logged" if velocity == "logged" else derived


def overview(context: Context, summaries: list[LogSummary]) -> Table:
    """One row per log."""
    rows = tuple(
        (
            literal(summary.log),
            summary.role,
            summary.format,
            context.count(f"log.{summary.log}.rows"),
            context.number(f"log.{summary.log}.rate", 5),
            context.number(f"log.{summary.log}.duration", 5),
            context.number(f"log.{summary.log}.jitter", 2),
            period_length(context, summary),
            context.count(f"period.{summary.log}.periods"),
        )
        for summary in summaries
    )
    header = ("Log", "Role", "Format", "Samples", "Rate", "Duration", "Clock jitter", "Period", "Periods")
    return Table("The logs of the study.", header, rows, label="recorded-table", align="lllrrrrrr")


def period_length(context: Context, summary: LogSummary) -> Number | str:
    """The period of a log, without its standard error, which the section on averaging gives."""
    number = context.number(f"period.{summary.log}", 6)
    return number if isinstance(number, str) else replace(number, std=None)


def remarks(summary: LogSummary) -> list[str]:
    """What keeps a log from being trusted without a second look."""
    texts = list(summary.warnings)
    if summary.dropped:
        texts.append(f"{summary.dropped} rows could not be used")
    if summary.duplicates > 0.1 * summary.rows:
        texts.append(f"{summary.duplicates} of {summary.rows} rows repeat the one before")
    if summary.jitter * summary.rate >= 0.1:
        texts.append(f"the clock jitters by {summary.jitter * 1e3:.3g} ms")
    return texts
