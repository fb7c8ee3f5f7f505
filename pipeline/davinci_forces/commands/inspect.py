"""Show the contents of a log: channels, units, samples, clock, warnings and first rows."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from davinci_forces.files import json_number, visible
from davinci_forces.runner.console import echo, table

if TYPE_CHECKING:
    from davinci_forces.logs.log import Log, Options
    from davinci_forces.maths.signals.clock import ClockStatistics
    from davinci_forces.maths.signals.columns import Outline

BARS = "▁▂▃▄▅▆▇█"


def run(
    file: Annotated[Path, Argument(help="A log; `davinci-forces guide formats` lists the formats.")],
    head: Annotated[int, Option(min=0, help="Number of rows to show.")] = 5,
    as_json: Annotated[bool, Option("--json", help="Print the description as JSON.")] = False,
    dtype: Annotated[str | None, Option(help="Type of raw binary numbers: float64, '<int16' ...")] = None,
    columns: Annotated[
        str | None, Option(help="Columns of raw binary numbers: how many, or names, as in t,q,i.")
    ] = None,
) -> None:
    """Print the description of a log, as text or JSON."""
    from davinci_forces.logs.log import Options

    layout = int(columns) if columns and columns.isdecimal() else tuple(columns.split(",")) if columns else None
    description = describe(file, head, Options(dtype=dtype, columns=layout))
    if as_json:
        echo(json.dumps(description, indent=1, ensure_ascii=False, allow_nan=False))
    else:
        echo("\n".join(visible(line) for line in lines(description)))


@dataclass
class _Survey:
    """Statistics of the channels of one clock, from one pass over them."""

    statistics: "ClockStatistics"
    outlines: dict[str, "Outline"]
    first: dict[str, list[float]]  # rows of each channel
    rows: int = 0
    unusual: int = 0  # steps of the clock that go back or are gaps
    unusual_seconds: float = 0.0  # their sum [s]

    @property
    def rate(self) -> float:
        """Samples per second of the usual steps of the clock."""
        clock = self.statistics
        seconds = clock.last - clock.first - self.unusual_seconds
        return (clock.samples - 1 - self.unusual) / seconds if seconds > 0 else clock.rate


def describe(file: Path, head: int, options: "Options") -> dict[str, Any]:
    """Read a whole log, clock by clock, and describe it as JSON values, without NaN; raises BadLog if it is damaged."""
    from davinci_forces.logs import open_log
    from davinci_forces.study.timing import named_time

    log = open_log(file, options)
    names = [channel.name for channel in log.channels if channel.kind in ("number", "time")]
    source, warnings = named_time(log), list[str]()
    surveys: dict[str, _Survey] = {}
    nulls, nans = dict[str, int](), dict[str, int]()
    for clock, channels in sorted(log.by_clock(names).items(), key=lambda item: item[0] != "") or [("", names)]:
        surveys[clock] = _survey(log, clock or source, channels, head)
        warnings += [warning for warning in log.warnings if warning not in warnings]
        nulls, nans = nulls | log.nulls, nans | log.nans
    log.nulls, log.nans = nulls, nans
    outlines = {name: outline for survey in surveys.values() for name, outline in survey.outlines.items()}
    first = {name: rows for survey in surveys.values() for name, rows in survey.first.items()}
    rows = max(survey.rows for survey in surveys.values())
    first_clock = next(iter(surveys))  # the clock of the log, or the first if every channel has its own
    source, main = first_clock or source, surveys.pop(first_clock)
    return {
        "file": str(file), "format": log.format, "rows": rows,
        "started": log.started, "zone": log.zone, "clock": _clock(log, source, main),
        "clocks": [_clock(log, clock, s) | {"channels": [*s.first]} for clock, s in surveys.items()],
        "channels": [_channel(log, channel, outlines.get(channel.name)) for channel in log.channels],
        "facts": log.facts, "comments": log.comments, "dropped": log.dropped,
        "warnings": [*warnings, *_flags(source, main)],
        "head": {name: [json_number(value) for value in first[name]] for name in names},
    }  # fmt: skip


def _survey(log: "Log", source: str, names: list[str], head: int) -> _Survey:
    """Read the channels of one clock; channel `source`, if any, holds its times."""
    import numpy as np

    from davinci_forces.maths.signals.clock import ClockStatistics, interruptions
    from davinci_forces.maths.signals.columns import Outline
    from davinci_forces.maths.units import measures, size

    unit = next((channel.unit for channel in log.channels if channel.name == source), "")
    seconds = size(unit) if measures(unit) == "time" else 1.0
    kinds = {channel.name: channel.kind for channel in log.channels if not channel.derived}
    measured = [name for name in names if kinds.get(name) == "number" and name != source]
    survey = _Survey(ClockStatistics(), {name: Outline() for name in names}, {name: [] for name in names})
    for block in log.blocks(names):
        count = len(next(iter(block.values())))
        number = survey.rows + np.arange(count, dtype=float)  # counts samples where the log has no clock
        t = block.get(source, log.clock.start + number * log.clock.step if log.clock else number)
        unusual, lasting = interruptions(np.append([survey.statistics.last] * bool(survey.rows), seconds * t))
        survey.unusual, survey.unusual_seconds = survey.unusual + unusual, survey.unusual_seconds + lasting
        survey.statistics.update(seconds * t, [block[name] for name in measured])
        for name in names:
            survey.outlines[name].update(block[name])
            survey.first[name].extend(block[name][: max(0, head - survey.rows)].tolist())
        survey.rows += count
    return survey


def _clock(log: "Log", source: str, survey: _Survey) -> dict[str, Any]:
    clock = survey.statistics
    if not source and not log.clock:
        from davinci_forces.study.guessing import clock_hint

        hint = clock_hint(log.independent_copy())
        advice = "none: unless study.toml names a channel of times, add rate = ... [Hz] there"
        return {"source": f"{advice}, or {hint}" if hint else advice, "duplicates": clock.duplicates}
    return {
        "source": f"channel {source!r}" if source else "the log's own interval",
        "rate": json_number(survey.rate), "jitter": json_number(clock.jitter),
        "longest_gap": json_number(clock.longest_gap), "duration": json_number(clock.last - clock.first),
        "backward": clock.backward, "repeated": clock.repeated, "duplicates": clock.duplicates,
        "interruptions": survey.unusual,
    }  # fmt: skip


def _channel(log: "Log", channel: Any, outline: "Outline | None") -> dict[str, Any]:
    labels = {"name": channel.name, "unit": channel.unit, "kind": channel.kind, "derived": channel.derived}
    labels |= {"alias": channel.alias} if channel.alias else {}
    if outline is None:
        return labels
    values = {name: json_number(getattr(outline, name)) for name in ("samples", "least", "most", "mean")}
    counts = {"nulls": log.nulls.get(channel.name, 0), "nans": log.nans.get(channel.name, 0)}
    return labels | values | counts | {"course": [json_number(value) for value in outline.course.tolist()]}


def _flags(source: str, survey: _Survey) -> Iterator[str]:
    """Warnings about a clock: times that do not increase, repeated rows, jitter and gaps."""
    from davinci_forces.maths.signals import clock as clocks

    clock = survey.statistics
    if source and (clock.backward or clock.repeated):
        steps = f"goes back {clock.backward} times and repeats {clock.repeated} times, first in row {clock.bad_row + 1}"
        remedy = "name another time channel, or add rate = ... [Hz] for this log in study.toml"
        yield f"time {source!r} {steps}; {remedy}"
    yield from clocks.remarks(clock, survey.rate)


def lines(description: dict[str, Any]) -> Iterator[str]:
    """The description as lines of text."""
    from davinci_forces.logs.log import UNSET_START

    started = f", started {description['started']} ({description['zone']} time)" if description["started"] else ""
    if description["started"].startswith(UNSET_START):
        started = ", start unknown: the file has LabVIEW's zero, 1904-01-01"
    yield f"{description['file']}: {description['format']}, {description['rows']} rows{started}"
    yield from (f"  {key}: {value}" for key, value in description["facts"].items())
    clock = description["clock"]
    yield f"clock: {clock['source']}"
    if "rate" in clock:
        apart = "from the first to the last sample; between interruptions at" if clock["interruptions"] else "at"
        rate = f"{clock['rate']:.6g} Hz, jitter {clock['jitter'] * 1e3:.3g} ms (std)"
        yield f"  {clock['duration'] or 0:.6g} s {apart} {rate}"
        yield f"  longest gap {clock['longest_gap']:.3g} s; {clock['backward']} steps back, {clock['repeated']} of zero"
    yield f"  {clock['duplicates']} rows repeat the previous row"
    for extra in description["clocks"]:
        channels = ", ".join(map(repr, extra["channels"][:6])) + (" ..." if len(extra["channels"]) > 6 else "")
        yield f"another clock: {extra['source']}, {extra['rate']:.6g} Hz, of {channels}"
    yield "channels:"
    rows = [_row(i, channel) for i, channel in enumerate(description["channels"])]
    yield from (f"  {line}" for line in table(rows))
    if any(description["head"].values()):
        yield "first rows:"
        names = list(description["head"])
        head = [[_number(value) for value in row] for row in zip_longest(*description["head"].values())]
        yield from (f"  {line}" for line in table([names, *head]))
    for title in ("comments", "warnings"):
        if description[title]:
            yield f"{title}:"
            yield from (f"  {line}" for line in description[title])


def _row(number: int, channel: dict[str, Any]) -> list[str]:
    name = [f"{number}", channel["name"], channel["unit"] or "-"]
    if "samples" not in channel:
        return [*name, channel["kind"]]
    missing = ", ".join(f"{channel[kind]} {kind}" for kind in ("nulls", "nans") if channel[kind])
    span = f"{_number(channel['least'])} .. {_number(channel['most'])}"
    return [*name, span, sparkline(channel["course"]), missing or ("added by the reader" if channel["derived"] else "")]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.9g}" if abs(value) >= 1e5 else f"{value:.6g}"


def sparkline(course: list[float | None]) -> str:
    """Draw the values of a channel over time as a line of bars, low to high; a blank where there is no value."""
    values = [value for value in course if value is not None]
    if not values:
        return ""
    low, span = min(values), (max(values) - min(values)) or 1.0
    return "".join(" " if v is None else BARS[min(7, int(8 * (v - low) / span))] for v in course)
