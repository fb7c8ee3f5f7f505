"""TDMS files, the binary logs of LabVIEW and DIAdem."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.log import Block, Channel, Log, Options, read_ahead, row_count, unique
from davinci_forces.logs.tdms import samples
from davinci_forces.logs.tdms.clocks import Sampled, Waveforms, set_clocks
from davinci_forces.logs.tdms.metadata import COMPLEX, DAQMX_RAW, EPOCH, NUMBER_CODES, TIME, Objects, names
from davinci_forces.logs.tdms.samples import PIECE_ROWS, Index, pieces, rows_of, side_by_side
from davinci_forces.logs.tdms.walk import TAG, Walk
from davinci_forces.logs.timeline import Timeline, moment

UNIT_PROPERTIES = ("unit_string", "ni_unitdescription", "unit", "units")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins with the tag of a file segment, or has the suffix .tdms."""
    return head.startswith(TAG) or path.suffix.lower() == ".tdms"


def read(path: Path, options: Options) -> Log:
    """Open the file, and read its metadata; raises BadLog if it holds no channel, or one with an unknown scale."""
    warnings: list[str] = []
    index, waveforms = Index(), Waveforms()
    with open_file(path) as file:
        walk = Walk(file, path.stat().st_size, warnings.append)
        for region in walk.regions():
            index.add(region)
            waveforms.add(region, walk.objects.properties)
        stamps = [p for p, samples in walk.objects.latest.items() if samples.kind == TIME]
        origins = [_first_second(file, index, p) for p in stamps]
    paths = list(walk.objects.latest)
    if not paths:
        why = f" ({'; '.join(warnings)})" if warnings else ""
        raise BadLog(f"{path}: no channel can be read from this TDMS file{why}; record it again")
    channels = _channels(walk.objects, warnings)
    name = {p: channel.name for p, channel in zip(paths, channels, strict=True)}
    log = TdmsLog(
        path, "tdms", channels, warnings=warnings, cut=walk.cut, size=walk.end, index=index, names=name,
        origin=min((second for second in origins if second is not None), default=0),
    )  # fmt: skip
    _describe(log, walk, waveforms)
    return log


def _channels(objects: Objects, warnings: list[str]) -> tuple[Channel, ...]:
    full_names = ["/".join(names(path)) for path in objects.latest]
    written = unique(full_names)
    for name, channel in zip(full_names, written, strict=True):
        if name != channel:
            warnings.append(f"more than one channel is called {name!r}; one of them is read as {channel!r}")
    return tuple(
        Channel(name, _unit(objects.properties.get(path, {})), _kind(samples.kind))
        for name, (path, samples) in zip(written, objects.latest.items(), strict=True)
    )


def _kind(kind: int) -> str:
    if kind in NUMBER_CODES or kind == DAQMX_RAW:
        return "number"
    return "time" if kind == TIME else "complex numbers" if kind in COMPLEX else "text"


def _unit(properties: Mapping[str, Any]) -> str:
    lower = {name.lower(): value for name, value in properties.items()}
    return next((str(lower[name]) for name in UNIT_PROPERTIES if lower.get(name)), "")


@dataclass
class TdmsLog(Log):
    """An opened TDMS file.  Time stamps become seconds from the whole second of the first time stamp."""

    size: int = 0  # [bytes] of the file that can be read
    index: Index = field(default_factory=Index)
    names: dict[str, str] = field(default_factory=dict)  # of the channels, by path
    scaled: frozenset[str] = frozenset()  # paths of channels that npTDMS reads
    scales: dict[str, dict[str, Any]] = field(default_factory=dict)  # properties of other scaled channels, by path
    origin: int = 0  # [s] since 1904; the zero of time stamps
    made: dict[str, Timeline] = field(default_factory=dict)  # by name: derived time channels

    @cached_property
    def _paths(self) -> dict[str, str]:
        """The path of each channel by its name, once for all clocks."""
        return {name: path for path, name in self.names.items()}

    def _read(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples; shorter channels are filled up with NaN."""
        yield from read_ahead(self._timed(names))

    def _timed(self, asked_for: Sequence[str]) -> Iterator[Block]:
        timelines = {name: self.made[name] for name in asked_for if name in self.made}
        written = [name for name in asked_for if name not in timelines]
        row = 0
        for block in self._blocks(written) if written else _rows(timelines):
            count = row_count(block)
            block |= {name: timeline.times(row, count) for name, timeline in timelines.items()}
            yield {name: block[name] for name in asked_for}
            row += count

    def _blocks(self, asked_for: Sequence[str]) -> Iterator[Block]:
        paths = [self._paths[name] for name in dict.fromkeys(asked_for)]
        plain = self.index.groups([path for path in paths if path not in self.scaled])
        groups = plain + self.index.groups([path for path in paths if path in self.scaled])
        with open_file(self.path) as file:
            sources = [self._source(file, group) for group in groups]
            for block, lacking in side_by_side(sources, groups, rows_of(len(paths))):
                missing = {self.names[path]: count for path, count in lacking.items()}
                yield self.count_nans({self.names[path]: samples for path, samples in block.items()}, missing)

    def _source(self, file: BinaryIO, paths: Sequence[str]) -> Iterator[Block]:
        if paths[0] in self.scaled:
            chunk = max(kind.counts.get(paths[0], 0) for kind in self.index.kinds)  # as large for each of the group
            return self._said(samples.scaled_pieces(file, self.size, paths, chunk), paths[0])
        read = pieces(file, self.index.regions(paths[0]), paths, self.origin)
        scales = {path: self.scales[path] for path in paths if path in self.scales}
        return self._said(samples.apply_scales(read, scales), paths[0]) if scales else read

    def _said(self, read: Iterator[Block], path: str) -> Iterator[Block]:
        """Yield the blocks of npTDMS; an error of npTDMS becomes a `BadLog` that names the channel."""
        try:
            yield from read
        except Exception as error:
            raise self.bad(f"npTDMS cannot read channel {path} ({error})") from error


def _rows(timelines: Mapping[str, Timeline]) -> Iterator[Block]:
    """Yield blocks without samples, as long as the derived times."""
    rows = max((timeline.rows for timeline in timelines.values()), default=0)
    for first in range(0, rows, PIECE_ROWS):
        yield {"": np.empty(min(PIECE_ROWS, rows - first))}


def _describe(log: TdmsLog, walk: Walk, waveforms: Waveforms) -> None:
    properties, latest = walk.objects.properties, walk.objects.latest
    log.facts["segments"] = str(walk.file_segments)
    log.facts["layout"] = ", ".join(sorted(walk.layouts))
    log.facts |= {key: str(value) for key, value in properties.get("/", {}).items() if isinstance(value, str) and value}
    log.scaled = frozenset(p for p, s in latest.items() if s.kind == DAQMX_RAW)
    for path in latest:
        holders = (path, path[: path.find("'/'") + 1], "/")  # the channel itself, else its group, else the file
        scales = next((words for holder in holders if samples.is_scaled(words := properties.get(holder, {}))), {})
        if problem := samples.problem(scales):
            raise log.bad(f"channel {path} {problem}")
        if scales and path not in log.scaled:
            log.scales[path] = scales
    for path, first in walk.objects.revised.items():
        # The first property that changes the meaning of samples: a unit or a scale.
        word = next((word for word in first if word.lower() in UNIT_PROPERTIES or word.startswith("NI_Scal")), "")
        if word and path in latest:
            change = f"{word} = {first[word]!r} first and {properties[path][word]!r} in a later file segment"
            remedy = "so its samples mean two things; split the file, or record it again"
            log.unread[log.names[path]] = f"channel {log.names[path]!r} has {change}, {remedy}"
    sizes = {log.names[path]: sum(rows for rows, _ in waveforms.writes.get(path, ())) for path in latest}
    _describe_time(log, waveforms, properties, sizes)
    if len(set(sizes.values())) > 1:
        counts = ", ".join(f"{name}: {length}" for name, length in list(sizes.items())[:6])
        log.warnings.append(f"channels have different numbers of samples ({counts}); the shorter ones end in nulls")
    elif not any(sizes.values()):
        log.warnings.append("the file names channels but holds no samples: the recorder stopped before its first write")


def _describe_time(
    log: TdmsLog, waveforms: Waveforms, properties: Mapping[str, Mapping[str, Any]], sizes: Mapping[str, int]
) -> None:
    """Set the start of the log, and the clocks from time stamps and waveform properties."""
    stamped = moment(EPOCH, log.origin) if log.origin else None
    waves = (words for writes in waveforms.writes.values() for _, words in writes if words)
    started = stamped or next((words.start for words in waves if words.start), None)
    timelines = waveforms.timelines(started, properties)
    sampled = {
        channel.name: Sampled(names(path)[0], sizes[channel.name], channel.kind == "time", timelines.get(path))
        for path, channel in zip(log.names, log.channels, strict=True)
    }
    log.made = set_clocks(log, sampled)
    starts = (words.get("wf_start_time") for path, words in properties.items() if path in log.names)
    if started := started or next((start for start in starts if isinstance(start, datetime)), None):
        log.zone, log.started = "UTC", started.replace(tzinfo=None).isoformat()
    for name, timeline in log.made.items():
        if gaps := [f"{first}" for first in timeline.first[1:]]:
            some = ", ".join(gaps[:5]) + (" ..." if len(gaps) > 5 else "")
            restart = f"{name!r} begins anew at sample {some}"
            log.warnings.append(f"later writes give another start or sampling interval: {restart}")


def _first_second(file: BinaryIO, index: Index, path: str) -> int | None:
    """Return the whole second since 1904 of a channel's first time stamp."""
    stamps = (piece[path] for piece in pieces(file, index.regions(path), [path], 0))
    return next((int(np.floor(times[0])) for times in stamps if len(times)), None)
