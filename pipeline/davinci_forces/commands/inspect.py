"""Show what a log holds: channels, units, samples, clock, what is odd about it, and its first rows."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from davinci_forces.runner.console import echo

if TYPE_CHECKING:
    from davinci_forces.logs.log import Log, Options
    from davinci_forces.maths.signals.clock import ClockStatistics
    from davinci_forces.maths.signals.columns import Outline

BARS = "▁▂▃▄▅▆▇█"
MAX_SHARE = 0.1  # share of repeated rows, and of jitter in the sampling time, above which they are flagged


def run(
    file: Annotated[Path, typer.Argument(help="A log, of any format that the README lists.")],
    head: Annotated[int, typer.Option(min=0, help="Rows to show.")] = 5,
    as_json: Annotated[bool, typer.Option("--json", help="Print it for a program to read.")] = False,
    dtype: Annotated[str | None, typer.Option(help="Of raw binary numbers: float64, '<int16' ...")] = None,
    columns: Annotated[str | None, typer.Option(help="Of a row of them: their number, or names, as in t,q,i.")] = None,
) -> None:
    """Show what a log holds: channels, units, samples, clock, warnings, first rows."""
    from davinci_forces.logs.log import Options

    of = int(columns) if columns and columns.isdecimal() else tuple(columns.split(",")) if columns else None
    description = describe(file, head, Options(dtype=dtype, columns=of))
    if as_json:
        echo(json.dumps(description, indent=1, ensure_ascii=False, allow_nan=False))
    else:
        from davinci_forces.files import visible

        echo("\n".join(visible(line) for line in lines(description)))


@dataclass
class _Survey:
    """What one pass over the channels of one clock found."""

    statistics: "ClockStatistics"
    outlines: dict[str, "Outline"]
    first: dict[str, list[float]]  # rows of each channel
    rows: int = 0


def describe(file: Path, head: int, options: "Options | None" = None) -> dict[str, Any]:
    """Read a whole log, one clock after the other; what it holds, in plain values of which none is NaN.

    Raises
    ------
    BadLog
        If it cannot be read.
    """
    from davinci_forces.logs import open_log
    from davinci_forces.logs.log import Options
    from davinci_forces.study.guessing import named_time

    log = open_log(file, options or Options())
    names = [channel.name for channel in log.channels if channel.kind in ("number", "time")]
    source, warnings = named_time(log), list[str]()
    found: dict[str, _Survey] = {}
    nulls, nans = dict[str, int](), dict[str, int]()
    for own, together in sorted(log.by_clock(names).items(), key=lambda each: each[0] != "") or [("", names)]:
        found[own] = _survey(log, own or source, together, head)
        warnings += [warning for warning in log.warnings if warning not in warnings]
        nulls, nans = nulls | log.nulls, nans | log.nans
    log.nulls, log.nans = nulls, nans
    first_clock = next(iter(found))  # the log's own, or the first where every channel has another
    source, main = first_clock or source, found.pop(first_clock)
    outlines = {name: outline for each in (main, *found.values()) for name, outline in each.outlines.items()}
    first = {name: rows for each in (main, *found.values()) for name, rows in each.first.items()}
    return {
        "file": str(file), "format": log.format, "rows": max(each.rows for each in (main, *found.values())),
        "started": log.started, "zone": log.zone, "clock": _clock(log, source, main.statistics),
        "clocks": [_clock(log, own, each.statistics) | {"channels": [*each.first]} for own, each in found.items()],
        "channels": [_channel(log, channel, outlines.get(channel.name)) for channel in log.channels],
        "facts": log.facts, "comments": log.comments, "dropped": log.dropped,
        "warnings": [*warnings, *_flags(log, source, main.statistics)],
        "head": {name: [_plain(value) for value in first[name]] for name in names},
    }  # fmt: skip


def _survey(log: "Log", source: str, together: list[str], head: int) -> _Survey:
    """Read the channels of one clock, whose times `source` holds, if any does."""
    import numpy as np

    from davinci_forces.maths.signals.clock import ClockStatistics
    from davinci_forces.maths.signals.columns import Outline

    kinds = {channel.name: channel.kind for channel in log.channels if not channel.derived}
    measured = [name for name in together if kinds.get(name) == "number" and name != source]
    survey = _Survey(ClockStatistics(), {name: Outline() for name in together}, {name: [] for name in together})
    for block in log.blocks(together):
        count = len(next(iter(block.values())))
        number = survey.rows + np.arange(count, dtype=float)  # counts samples where the log has no clock
        t = block.get(source, log.clock.start + number * log.clock.step if log.clock else number)
        survey.statistics.update(t, [block[name] for name in measured])
        for name in together:
            survey.outlines[name].update(block[name])
            survey.first[name].extend(block[name][: max(0, head - survey.rows)].tolist())
        survey.rows += count
    return survey


def _clock(log: "Log", source: str, clock: "ClockStatistics") -> dict[str, Any]:
    if not source and not log.clock:
        from davinci_forces.study.guessing import clock_hint

        hint = clock_hint(log.apart())
        advice = "none: say rate = ... [Hz] for this log in study.toml" + (f", or {hint}" if hint else "")
        return {"source": advice, "duplicates": clock.duplicates}
    return {
        "source": f"channel {source!r}" if source else "the log's own interval",
        "rate": _plain(clock.rate), "jitter": _plain(clock.jitter), "longest_gap": _plain(clock.longest_gap),
        "duration": _plain(clock.last - clock.first), "backward": clock.backward, "repeated": clock.repeated,
        "duplicates": clock.duplicates,
    }  # fmt: skip


def _channel(log: "Log", channel: Any, outline: "Outline | None") -> dict[str, Any]:
    about = {"name": channel.name, "unit": channel.unit, "kind": channel.kind, "derived": channel.derived}
    about |= {"alias": channel.alias} if channel.alias else {}
    if outline is None:
        return about
    values = {name: _plain(getattr(outline, name)) for name in ("samples", "least", "most", "mean")}
    counts = {"nulls": log.nulls.get(channel.name, 0), "nans": log.nans.get(channel.name, 0)}
    return about | values | counts | {"course": [_plain(value) for value in outline.course.tolist()]}


def _flags(log: "Log", source: str, clock: "ClockStatistics") -> Iterator[str]:
    """What makes a recording doubtful though every cell of it can be read."""
    if clock.duplicates > MAX_SHARE * clock.samples:
        share = clock.duplicates / clock.samples
        yield f"{clock.duplicates} of {clock.samples} rows ({share:.0%}) repeat the one before in every channel"
    if not source:
        return
    if clock.backward or clock.repeated:
        yield (
            f"time {source!r} goes back {clock.backward} times and stands still {clock.repeated} times, first in row "
            f"{clock.bad_row + 1}; name another time channel, or say rate = ... [Hz] for this log in study.toml"
        )
    elif clock.jitter * clock.rate > MAX_SHARE:
        yield f"the clock is jittery: {clock.jitter * 1e3:.3g} ms around {1e3 / clock.rate:.3g} ms"
    if clock.longest_gap * clock.rate > 2.5:
        gap = clock.longest_gap
        yield f"the longest time between samples is {gap:.3g} s, {gap * clock.rate:.1f} samples"


def _plain(value: float) -> float | None:
    """JSON knows neither NaN nor infinity."""
    return value if abs(value) < float("inf") else None


def lines(description: dict[str, Any]) -> Iterator[str]:
    """The same for people."""
    started = f", started {description['started']} ({description['zone']} time)" if description["started"] else ""
    yield f"{description['file']}: {description['format']}, {description['rows']} rows{started}"
    yield from (f"  {key}: {value}" for key, value in description["facts"].items())
    clock = description["clock"]
    yield f"clock: {clock['source']}"
    if "rate" in clock:
        yield f"  {clock['duration'] or 0:.6g} s at {clock['rate']:.6g} Hz, jitter {clock['jitter'] * 1e3:.3g} ms (std)"
        yield f"  longest gap {clock['longest_gap']:.3g} s; {clock['backward']} steps back, {clock['repeated']} of zero"
    yield f"  {clock['duplicates']} rows repeat the one before"
    for other in description["clocks"]:
        whose = ", ".join(repr(name) for name in other["channels"][:6]) + (" ..." if len(other["channels"]) > 6 else "")
        yield f"another clock: {other['source']}, {other['rate']:.6g} Hz, of {whose}"
    yield "channels:"
    yield from _table([_row(i, channel) for i, channel in enumerate(description["channels"])])
    if any(description["head"].values()):
        yield "first rows:"
        names = list(description["head"])
        rows = zip_longest(*description["head"].values())
        yield from _table([names, *([_number(value) for value in row] for row in rows)])
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
    return [*name, span, sparkline(channel["course"]), missing or ("made by the reader" if channel["derived"] else "")]


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.9g}" if abs(value) >= 1e5 else f"{value:.6g}"


def _table(rows: list[list[str]]) -> Iterator[str]:
    widths = [max(len(row[i]) for row in rows if i < len(row)) for i in range(max(map(len, rows), default=0))]
    for row in rows:
        yield "  " + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)).rstrip()


def sparkline(course: list[float | None]) -> str:
    """The course of a channel in one line of bars, low to high; a blank where it has no value."""
    values = [value for value in course if value is not None]
    if not values:
        return ""
    low, span = min(values), (max(values) - min(values)) or 1.0
    return "".join(" " if v is None else BARS[min(7, int(8 * (v - low) / span))] for v in course)
