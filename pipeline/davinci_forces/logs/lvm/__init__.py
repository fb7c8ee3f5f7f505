"""LabVIEW measurement files (LVM), the text that LabVIEW writes with headers."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from davinci_forces.errors import BadLog
from davinci_forces.logs.lines import MARKS, Lines
from davinci_forces.logs.log import Block, Channel, Clock, Log, Options, ahead, unique
from davinci_forces.logs.lvm.header import FOR_PEOPLE, MAGIC, BadHeader, Layout, X
from davinci_forces.logs.lvm.rows import Reading
from davinci_forces.logs.lvm.walk import Run, Walk
from davinci_forces.logs.timeline import OwnClock, equal_columns

ROUNDING = 0.5e-6  # [s] LabVIEW writes six decimals
NOTICED = 1e-4


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins with LabVIEW's magic words."""
    for mark, encoding in MARKS.items():
        if head.startswith(mark):
            head = head[: len(head) // 4 * 4].decode(encoding, "ignore").lstrip("\ufeff").encode()
    return head.startswith(MAGIC)


def read(path: Path, options: Options) -> Log:
    """Open the file: its headers, wherever they stand, say what the log holds.

    Raises
    ------
    BadLog
        If a header is missing, is not ended, or contradicts itself.
    """
    lines, walk = Lines(path, options.encoding), Walk(options.encoding, lambda _: None)
    try:
        for block in lines.blocks():
            for _ in walk.runs(block, Run.looks_whole):
                pass
        walk.finish()
    except BadHeader as problem:
        raise BadLog(f"{path}:{walk.line}: {problem}") from None
    return _opened(path, options, walk)


def _opened(path: Path, options: Options, walk: Walk) -> "LvmLog":
    layouts = list(walk.met.values())
    one = layouts[0]
    units: dict[str, str] = {}
    for each in layouts:
        units |= {name: unit for name, unit in zip(each.names, each.units, strict=True) if name and not units.get(name)}
    extra = range(one.width, max(walk.wide, default=0))
    written = [Channel(name, unit) for name, unit in units.items()] + [Channel(f"column_{i}") for i in extra]
    names = [channel.name for channel in written]
    has_x = any(each.file.x_columns != "No" for each in layouts)
    dated = walk.file_segments > 1 and one.start is not None
    derived = unique(("write", "elapsed"), names)[: 1 + dated]
    clock = None if has_x or dated or one.step is None else Clock(one.step, one.x0)
    warnings = [_rounded(one)] if clock and _rounded(one) else []
    made = (Channel(name, "s" * (i == 1), derived=True) for i, name in enumerate(derived))
    log = LvmLog(
        path, "lvm", channels=(*written, *made), clock=clock, time=derived[1] if dated else X if has_x else "",
        started=one.started, zone="local" if one.started else "", facts=_facts(one, walk), warnings=warnings,
        options=options,
    )  # fmt: skip
    log.clocks = _own_clocks(log, walk, layouts)
    of = {name: own.time for own in log.clocks for name in (*own.channels, own.x)}
    times = (Channel(own.time, "s", "time", derived=True, time=own.time) for own in log.clocks)
    log.channels = (*(replace(c, time=of.get(c.name, "")) for c in log.channels), *times)
    return log


def _own_clocks(log: "LvmLog", walk: Walk, layouts: Sequence[Layout]) -> tuple[OwnClock, ...]:
    """The clocks of channels that were not sampled with the first."""
    x_of = {
        name: each.names[i - 1]
        for each in layouts if each.file.x_columns == "Multi"
        for i, name in enumerate(each.names) if i % 2
    }  # fmt: skip
    groups = walk.groups
    if len(columns := [*dict.fromkeys(x_of.values())]) > 1:
        aside = replace(log, warnings=[], comments=[], nulls=dict.fromkeys(columns, 0), nans=dict.fromkeys(columns, 0))
        same = equal_columns(columns, Reading(aside, log.options.encoding, tuple(columns)).blocks())
        number = {x: i for i, group in enumerate(same) for x in group}
        parts: dict[tuple[int, int], list[str]] = {}
        for i, group in enumerate(groups):
            for name in group:
                parts.setdefault((i, number.get(x_of.get(name, ""), -1)), []).append(name)
        groups = [*parts.values()]
    taken = [channel.name for channel in log.channels]
    others = [group for group in groups if layouts[0].measured not in group]
    times = unique([f"time of {group[0]}" for group in others], taken)
    return tuple(
        OwnClock(time, tuple(group), x_of.get(group[0], "")) for time, group in zip(times, others, strict=True)
    )


def _rounded(one: Layout) -> str:
    """What to say of a sampling interval that lost digits when it was written: 1/2048 s becomes 0.000488."""
    step, fixed = one.step or 0.0, "E" not in one.step_written.upper()
    whole_rate = step > 0 and abs(1 / step - round(1 / step)) < 1e-6 / step
    if not fixed or whole_rate or step <= 0 or ROUNDING / step < NOTICED:
        return ""
    return (
        f"line {one.line}: the interval of {one.step_written} s is rounded, the clock may be wrong by "
        f"{ROUNDING / step:.2%}; say rate = ... [Hz] for this log in study.toml"
    )


def _facts(one: Layout, walk: Walk) -> dict[str, str]:
    tags = {tag: one.file.tags[tag] for tag in FOR_PEOPLE if one.file.tags.get(tag)}
    delimiter = {b"\t": "tab", b",": "comma", b";": "semicolon"}.get(one.file.separator, one.file.separator.decode())
    return tags | {"delimiter": delimiter, "X_Columns": one.file.x_columns, "segments": str(walk.file_segments)}


@dataclass
class LvmLog(Log):
    """An opened LVM file.

    Besides the channels of the file it has `write`, which counts from 1 the writes that the rows came in, as far as
    they can be told apart (a new header, a blank line, an x that goes back or stands still); and, where several
    file segments have a date, `elapsed`: the time since the start of the first, from the start of the row's own file
    segment and its x.
    """

    options: Options = field(default_factory=Options)
    clocks: tuple[OwnClock, ...] = ()  # of channels that were not sampled with the first

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, as `Log.blocks` says.

        Where channels have clocks of their own, rows that hold nothing of theirs are none.
        """
        self._start_anew(names, kinds=("number", "time"))
        [clock] = self.by_clock(names) or [""]
        yield from ahead(Reading(self, self.options.encoding, tuple(names), self.clocks, clock).blocks())
