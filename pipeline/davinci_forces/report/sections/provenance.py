"""Where the numbers come from: files and their hashes, versions, settings."""

from collections.abc import Iterator
from dataclasses import asdict

from davinci_forces.records import LogSummary, by_name
from davinci_forces.records.record import as_list
from davinci_forces.report.content import Block, Listing, OnScreen, Prose, Table, literal
from davinci_forces.report.context import Context
from davinci_forces.report.sections.parts import explanation, paper_or_screen, section_of


@section_of("Provenance", "provenance")
def section(context: Context) -> Iterator[Block]:
    """Everything needed to check whether a report comes from these files and this code."""
    provenance, study = context.provenance, context.study
    yield Prose(explanation("provenance", version=provenance.version, code=provenance.code))
    raw = tuple((literal(file), f"`{sha[:16]}`") for file, sha in provenance.raw.items())
    caption = "Raw files, with the first 16 digits of their SHA-256."
    yield from paper_or_screen(Table(caption, ("File", "SHA-256"), raw, "raw-files", "ll"))
    versions = Table("Versions.", ("Package", "Version"), tuple(provenance.packages.items()), align="ll")
    yield OnScreen("Versions of packages", "versions", (versions,))
    yield Prose(explanation("settings"))
    yield Listing("\n".join(f"{name} = {value!r}" for name, value in asdict(study.settings).items()))
    if study.changed:
        yield Prose("Changes of the robot:")
        yield Listing("\n".join(f"{name}: {in_words(value)}" for name, value in study.changed.items()))
    reversed_by_log = {log.name: [c.quantity for c in log.channels if c.sign < 0] for log in study.logs}
    if turned := [f"{log}: {', '.join(quantities)}" for log, quantities in reversed_by_log.items() if quantities]:
        yield Prose("Quantities whose sign the study reverses (`sign = -1`):")
        yield Listing("\n".join(turned))
    if summaries := context.catalogue.records(LogSummary):
        for started, logs in by_name([of for of in summaries if of.started], "started").items():
            if len(logs) > 1 and not study.simulated:
                names = as_list([literal(of.log) for of in logs])
                yield Prose(explanation("same-start", logs=names, started=literal(started)))
        tables = (start_times(summaries), channels(summaries))
        yield OnScreen("Files, dates and channels of every log", "channels", tables)
    if provenance.study:
        yield OnScreen("The study file", "study-file", (Listing(provenance.study),))


def in_words(value: object) -> str:
    """A value of study.toml, or the keys and values of a table."""
    return ", ".join(f"{key} = {of!r}" for key, of in value.items()) if isinstance(value, dict) else str(value)


def channels(summaries: list[LogSummary]) -> Table:
    """The use of each channel of every log, without unused channels."""
    rows = tuple(
        (literal(summary.log), literal(summary.channel[i]), literal(summary.unit[i]) or "–", literal(summary.feeds[i]))
        for summary in summaries
        for i, feeds in enumerate(summary.feeds)
        if feeds
    )
    return Table("Channels that feed the analysis.", ("Log", "Channel", "Unit in the log", "Feeds"), rows)


def start_times(summaries: list[LogSummary]) -> Table:
    """Files of every log, and when it was started."""
    rows = []
    for summary in summaries:
        started = f"{literal(summary.started)} ({summary.zone or 'no zone given'})" if summary.started else "–"
        rows.append((literal(summary.log), literal(", ".join(summary.files)), started))
    caption = "Files of the logs, and the date and time of their first samples as they give it."
    return Table(caption, ("Log", "File", "Started"), tuple(rows))
