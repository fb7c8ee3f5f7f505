"""What was recorded, and what the readers noticed."""

from collections.abc import Iterator
from dataclasses import replace

from pipeline.records import Diagnostic, LogSummary, Signal
from pipeline.report.content import Block, Bullets, Number, Prose, Section, Table, Verdict, literal
from pipeline.report.context import Context


def section(context: Context) -> Section | None:
    """One table over all logs, then each log's channels and remarks."""
    intakes = context.catalogue.all(LogSummary)
    if not intakes:
        return None
    return Section("What was recorded", "recorded", tuple(blocks(context, intakes)))


def blocks(context: Context, intakes: list[LogSummary]) -> Iterator[Block]:
    """The section's content."""
    yield overview(context, intakes)
    clean = [intake for intake in intakes if not remarks(intake)]
    if clean:
        yield Verdict("good", f"Read without a remark: {', '.join(literal(intake.log) for intake in clean)}.")
    yield from (
        Verdict("warn", f"**{literal(intake.log)}**: {literal('; '.join(remarks(intake)))}.")
        for intake in intakes
        if remarks(intake)
    )
    methods = sorted({(s.method, s.velocity) for s in context.catalogue.all(Signal)})
    yield Prose("How the recordings were put on a uniform clock, and where their velocities come from:")
    yield Bullets(tuple(f"clock: {method}; velocity: {words(velocity, context)}" for method, velocity in methods))
    said = [
        literal(text)
        for note in context.catalogue.all(Diagnostic)
        if note.stage in ("ingest", "resample", "average")
        for text in note.text
    ]
    if said:
        yield Prose("Remarks of the readers and of the first stages:")
        yield Bullets(tuple(said))


def words(velocity: str, context: Context) -> str:
    """Where a velocity comes from."""
    cutoff = context.study.settings.lowpass
    derived = f"differences of the position after a zero-phase low-pass at {cutoff:g} Hz"
    return "as logged" if velocity == "logged" else derived


def overview(context: Context, intakes: list[LogSummary]) -> Table:
    """One row per log."""
    rows = tuple(
        (
            literal(intake.log),
            intake.role,
            intake.format,
            context.count(f"log.{intake.log}.rows"),
            context.number(f"log.{intake.log}.rate", 5),
            context.number(f"log.{intake.log}.duration", 5),
            context.number(f"log.{intake.log}.jitter", 2),
            length(context, intake),
            context.count(f"period.{intake.log}.periods"),
        )
        for intake in intakes
    )
    header = ("Log", "Role", "Format", "Samples", "Rate", "Duration", "Clock jitter", "Period", "Periods")
    return Table("The logs of the study.", header, rows, label="recorded-table", align="lllrrrrrr")


def length(context: Context, intake: LogSummary) -> Number | str:
    """The period of a log, without its deviation, which the section on averaging gives."""
    number = context.number(f"period.{intake.log}", 6)
    return number if isinstance(number, str) else replace(number, std=None)


def remarks(intake: LogSummary) -> list[str]:
    """What keeps a log from being trusted without a second look."""
    said = list(intake.warnings)
    if intake.dropped:
        said.append(f"{intake.dropped} rows could not be used")
    if intake.duplicates > 0.1 * intake.rows:
        said.append(f"{intake.duplicates} of {intake.rows} rows repeat the one before")
    if intake.jitter * intake.rate >= 0.1:
        said.append(f"the clock jitters by {intake.jitter * 1e3:.3g} ms")
    return said
