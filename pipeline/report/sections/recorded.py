"""What was recorded, and what the readers noticed."""

from collections.abc import Iterator

from pipeline.records import Intake, Note, Signal
from pipeline.report.content import Block, Bullets, Prose, Section, Table, Verdict, literal
from pipeline.report.context import Context


def section(context: Context) -> Section | None:
    """One table over all logs, then each log's channels and remarks."""
    intakes = context.library.all(Intake)
    if not intakes:
        return None
    return Section("What was recorded", "recorded", tuple(blocks(context, intakes)))


def blocks(context: Context, intakes: list[Intake]) -> Iterator[Block]:
    """The section's content."""
    yield overview(context, intakes)
    for intake in intakes:
        yield verdict(intake)
    methods = sorted({(s.method, s.velocity) for s in context.library.all(Signal)})
    yield Prose("How the recordings were put on a uniform clock, and where their velocities come from:")
    yield Bullets(tuple(f"clock: {method}; velocity: {words(velocity, context)}" for method, velocity in methods))
    remarks = [
        literal(text)
        for note in context.library.all(Note)
        if note.stage in ("ingest", "resample", "average")
        for text in note.text
    ]
    if remarks:
        yield Prose("Remarks of the readers and of the first stages:")
        yield Bullets(tuple(remarks))
    yield Section("Channels", "channels", tuple(channels(intake) for intake in intakes))


def words(velocity: str, context: Context) -> str:
    """Where a velocity comes from."""
    cutoff = context.study.settings.lowpass
    derived = f"differences of the position after a zero-phase low-pass at {cutoff:g} Hz"
    return "as logged" if velocity == "logged" else derived


def overview(context: Context, intakes: list[Intake]) -> Table:
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
            context.number(f"period.{intake.log}", 6),
            context.count(f"period.{intake.log}.periods"),
        )
        for intake in intakes
    )
    header = ("Log", "Role", "Format", "Samples", "Rate", "Duration", "Clock jitter", "Period", "Periods")
    return Table("The logs of the study.", header, rows, label="recorded-table", align="lllrrrrrr")


def verdict(intake: Intake) -> Verdict:
    """Whether a log can be trusted."""
    started = f", started {literal(intake.started)} ({intake.zone or 'no zone given'})" if intake.started else ""
    if (
        not intake.warnings
        and not intake.dropped
        and intake.duplicates <= 0.1 * intake.rows
        and intake.jitter * intake.rate < 0.1
    ):
        return Verdict("good", f"**{literal(intake.log)}** reads without a remark{started}.")
    said = list(intake.warnings)
    if intake.dropped:
        said.append(f"{intake.dropped} rows could not be used")
    if intake.duplicates > 0.1 * intake.rows:
        said.append(f"{intake.duplicates} of {intake.rows} rows repeat the one before")
    if intake.jitter * intake.rate >= 0.1:
        said.append(f"the clock jitters by {intake.jitter * 1e3:.3g} ms")
    return Verdict("warn", f"**{literal(intake.log)}**{started}: {literal('; '.join(said))}.")


def channels(intake: Intake) -> Table:
    """What each channel of a log feeds."""
    used = [i for i, feeds in enumerate(intake.feeds) if feeds]
    rows = tuple((literal(intake.channel[i]), literal(intake.unit[i]) or "–", literal(intake.feeds[i])) for i in used)
    unused = len(intake.channel) - len(used)
    rest = f" {unused} other channels are not used." if unused else ""
    files = ", ".join(intake.files)
    return Table(
        f"Channels of **{literal(intake.log)}** ({literal(files)}) that feed the analysis.{rest}",
        ("Channel", "Unit in the log", "Feeds"),
        rows,
    )
