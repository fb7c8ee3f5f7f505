"""Read every log into recordings, one per joint, in SI and at the joint's side of the gears; and what touched."""

from collections.abc import Iterator

from davinci_forces.files import visible
from davinci_forces.logs.log import Log
from davinci_forces.records import Diagnostic, LogSummary, Recording, Touch, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry
from davinci_forces.study.intake import Intake, mended
from davinci_forces.study.intake.summary import remarks, summary


def run(log: Log, entry: LogEntry, robot: Robot) -> Iterator[Recording | Touch | LogSummary | Diagnostic]:
    """Recordings and touches in consecutive blocks, then what the reader noticed.

    Raises
    ------
    BadLog
        If a channel is not there, its unit is unknown or contradicts the study, it holds what is not a number, time
        does not increase, or channels have clocks that do not go together.
    """
    intake = Intake(log, entry, robot)
    for block in mended(intake, intake.blocks()):
        yield from intake.recordings(block)
        if intake.ended:
            break
    yield summary(intake)
    noticed = [f"{entry.name}: {remark}" for remark in (*log.warnings, *remarks(intake))]
    for severity, said in (("warning", noticed), ("note", list(intake.clocks.note()))):
        if said:
            yield diagnostic("ingest", entry.name, severity, *map(visible, said))
