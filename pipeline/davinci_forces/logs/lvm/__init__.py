"""LabVIEW measurement files (LVM): text with headers."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from davinci_forces.errors import BadLog
from davinci_forces.logs.lines import MARKS, Lines
from davinci_forces.logs.log import BadContent, Channel, Clock, Log, Options, unique
from davinci_forces.logs.lvm.header import FOR_PEOPLE, MAGIC, Layout, X
from davinci_forces.logs.lvm.rows import LvmLog
from davinci_forces.logs.lvm.walk import Run, Walk
from davinci_forces.logs.timeline import OwnClock, equal_columns

STEP_ROUNDING = 0.5e-6  # [s] LabVIEW writes six decimals
MIN_CLOCK_ERROR = 1e-4  # relative; a larger error is reported


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins with the words `LabVIEW Measurement`."""
    for mark, encoding in MARKS.items():
        if head.startswith(mark):
            head = head[: len(head) // 4 * 4].decode(encoding, "ignore").lstrip("\ufeff").encode()
    return head.startswith(MAGIC)


def read(path: Path, options: Options) -> Log:
    """Open the file, and find its headers; raises BadLog if one is missing, has no end, or contradicts itself."""
    lines, walk = Lines(path, options.encoding), Walk(options.encoding, lambda _: None)
    try:
        for block in lines.blocks():
            for _ in walk.runs(block, Run.looks_whole):
                pass
        walk.finish()
    except BadContent as problem:
        raise BadLog(f"{path}:{walk.line}: {problem}") from None
    layouts = list(walk.met.values())
    first = layouts[0]
    units: dict[str, str] = {}
    for layout in layouts:
        pairs = zip(layout.names, layout.units, strict=True)
        units |= {name: unit for name, unit in pairs if name and not units.get(name)}
    extra = range(first.width, max(walk.wide, default=0))
    written = [Channel(name, unit) for name, unit in units.items()] + [Channel(f"column_{i}") for i in extra]
    names = [channel.name for channel in written]
    has_x = any(layout.file.x_columns != "No" for layout in layouts)
    dated = walk.file_segments > 1 and first.start is not None
    elapsed = unique(["elapsed"], names)[:dated]
    clock = None if has_x or dated or first.step is None else Clock(first.step, first.x0)
    warnings = [*filter(None, [_rounded(first)])] if clock else []
    new = (Channel(name, "s", derived=True) for name in elapsed)
    facts = {tag: first.file.tags[tag] for tag in FOR_PEOPLE if first.file.tags.get(tag)}
    mark = first.file.separator.decode()
    delimiter = {"\t": "tab", ",": "comma", ";": "semicolon"}.get(mark, mark)
    facts |= {"delimiter": delimiter, "X_Columns": first.file.x_columns, "segments": str(walk.file_segments)}
    log = LvmLog(
        path, "lvm", channels=(*written, *new), clock=clock, time=elapsed[0] if dated else X if has_x else "",
        started=first.started, zone="local" if first.started else "", facts=facts, warnings=warnings,
        options=options,
    )  # fmt: skip
    log.clocks = _own_clocks(log, walk, layouts)
    time_of = {name: c.time for c in log.clocks for name in (*c.channels, c.x)}
    times = (Channel(c.time, "s", "time", derived=True, time=c.time) for c in log.clocks)
    log.channels = (*(replace(c, time=time_of.get(c.name, "")) for c in log.channels), *times)
    return log


def _own_clocks(log: LvmLog, walk: Walk, layouts: Sequence[Layout]) -> tuple[OwnClock, ...]:
    """Find the clocks of channels that were not sampled with the first channel."""
    x_of = {
        name: layout.names[i - 1]
        for layout in layouts if layout.file.x_columns == "Multi"
        for i, name in enumerate(layout.names) if i % 2
    }  # fmt: skip
    groups = walk.groups
    if len(columns := [*dict.fromkeys(x_of.values())]) > 1:
        number = equal_columns(columns, log.independent_copy().blocks(columns))
        parts: dict[tuple[int, int], list[str]] = {}
        for i, group in enumerate(groups):
            for name in group:
                parts.setdefault((i, number.get(x_of.get(name, ""), -1)), []).append(name)
        groups = [*parts.values()]
    taken = [channel.name for channel in log.channels]
    others = [group for group in groups if layouts[0].first_channel not in group]
    times = unique([f"time of {group[0]}" for group in others], taken)
    timed = zip(times, others, strict=True)
    return tuple(OwnClock(time, tuple(group), x_of.get(group[0], "")) for time, group in timed)


def _rounded(layout: Layout) -> str:
    """Warn of a sampling interval that lost digits when it was written, as 1/2048 s becomes 0.000488; else ""."""
    step, fixed = layout.step or 0.0, "E" not in layout.step_written.upper()
    whole_rate = step > 0 and abs(1 / step - round(1 / step)) < 1e-6 / step
    if not fixed or whole_rate or step <= 0 or STEP_ROUNDING / step < MIN_CLOCK_ERROR:
        return ""
    doubt = f"is rounded, so the clock may be wrong by {STEP_ROUNDING / step:.2%}"
    remedy = "set rate = ... [Hz] for this log in study.toml"
    return f"line {layout.line}: the sampling interval of {layout.step_written} s {doubt}; {remedy}"
