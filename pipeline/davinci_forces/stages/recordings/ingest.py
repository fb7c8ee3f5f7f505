"""Read every log, convert it to the joint side in SI units, and write one recording for each of its joints."""

from collections.abc import Iterator

from davinci_forces.files import visible
from davinci_forces.logs.log import Log
from davinci_forces.records import Diagnostic, LogSummary, Recording, Touch, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry
from davinci_forces.study.intake import Intake, without_clock_jumps
from davinci_forces.study.intake.summary import remarks, summary


def run(log: Log, entry: LogEntry, robot: Robot) -> Iterator[Recording | Touch | LogSummary | Diagnostic]:
    """Read recordings and touches in consecutive blocks, then a summary and the remarks of the reader.

    Raises BadLog if a channel is missing, holds something that is not a number, or has a unit that is unknown or
    contradicts the study. It also does if time does not increase or the clocks of channels do not go together.
    """
    intake = Intake(log, entry, robot)
    for block in without_clock_jumps(intake, intake.clocks.blocks()):
        yield from intake.recordings(block)
        if intake.ended:
            break
    yield summary(intake)
    noticed = [f"{entry.name}: {remark}" for remark in (*log.warnings, *remarks(intake))]
    for severity, texts in (("warning", noticed), ("note", list(intake.clocks.note()))):
        if texts:
            yield diagnostic("ingest", entry.name, severity, *map(visible, texts))
