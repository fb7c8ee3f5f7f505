"""TDMS files, the binary logs of LabVIEW and DIAdem."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file
from davinci_forces.logs.log import Block, Channel, Log, Options, ahead, unique
from davinci_forces.logs.tdms import samples
from davinci_forces.logs.tdms.clocks import Sampled, Waveforms, clocks_of
from davinci_forces.logs.tdms.metadata import COMPLEX, DAQMX_RAW, EPOCH, NUMBERS, TIME, Objects, names
from davinci_forces.logs.tdms.samples import ROWS, Index, Queue, pieces, rows_of, side_by_side
from davinci_forces.logs.tdms.walk import TAG, Walk
from davinci_forces.logs.timeline import Timeline, moment

UNITS = ("unit_string", "ni_unitdescription", "unit", "units")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins with the tag of a file segment, or is named as a TDMS file."""
    return head.startswith(TAG) or path.suffix.lower() == ".tdms"


def read(path: Path, options: Options) -> Log:
    """Open the file: walk its file segments and take in their metadata.

    Raises
    ------
    BadLog
        If it holds no channel, or one whose scale is not known.
    """
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
        path, "tdms", channels, warnings=warnings, size=walk.end, index=index, names=name,
        origin=min((second for second in origins if second is not None), default=0),
    )  # fmt: skip
    log.cut = walk.cut
    _describe(log, walk, waveforms)
    return log


def _channels(objects: Objects, warnings: list[str]) -> tuple[Channel, ...]:
    said = ["/".join(names(path)) for path in objects.latest]
    written = unique(said)
    for one, channel in zip(said, written, strict=True):
        if one != channel:
            warnings.append(f"a channel is called {one!r} like another; it is read as {channel!r}")
    return tuple(
        Channel(name, _unit(objects.properties.get(path, {})), _kind(samples.kind))
        for name, (path, samples) in zip(written, objects.latest.items(), strict=True)
    )


def _kind(kind: int) -> str:
    if kind in NUMBERS or kind == DAQMX_RAW:
        return "number"
    return "time" if kind == TIME else "complex numbers" if kind in COMPLEX else "text"


def _unit(properties: Mapping[str, Any]) -> str:
    lower = {name.lower(): value for name, value in properties.items()}
    return next((str(lower[name]) for name in UNITS if lower.get(name)), "")


@dataclass
class TdmsLog(Log):
    """An opened TDMS file.  Samples of channels of time stamps are seconds since the second of the first of all."""

    size: int = 0  # [bytes] of the file that can be read
    index: Index = field(default_factory=Index)
    names: dict[str, str] = field(default_factory=dict)  # of the channels, by path
    scaled: frozenset[str] = frozenset()  # paths that npTDMS reads
    scales: dict[str, dict[str, Any]] = field(default_factory=dict)  # of paths of other numbers, the properties
    origin: int = 0  # [s] since 1904 that time stamps are counted from
    made: dict[str, Timeline] = field(default_factory=dict)  # by name: derived channels of times
    mixed: dict[str, str] = field(default_factory=dict)  # by name: why the samples of a channel are not of one kind
    _paths: dict[str, str] = field(default_factory=dict)  # by name

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, as `Log.blocks` says.

        Channels of unequal lengths are filled up with NaN behind their ends.
        """
        self._start_anew(names, kinds=("number", "time"))
        if problem := next((self.mixed[name] for name in names if name in self.mixed), ""):
            raise BadLog(f"{self.path}: {problem}")
        yield from ahead(self._timed(names))

    def _timed(self, asked_for: Sequence[str]) -> Iterator[Block]:
        """The blocks with the times that are made."""
        made = {name: self.made[name] for name in asked_for if name in self.made}
        written = [name for name in asked_for if name not in made]
        row = 0
        for block in self._blocks(written) if written else _rows(made):
            count = len(next(iter(block.values())))
            block |= {name: timeline.at(row, count) for name, timeline in made.items()}
            yield {name: block[name] for name in asked_for}
            row += count

    def _blocks(self, asked_for: Sequence[str]) -> Iterator[Block]:
        path_of = self._paths = self._paths or {name: path for path, name in self.names.items()}
        paths = [path_of[name] for name in dict.fromkeys(asked_for)]
        plain = self.index.together([path for path in paths if path not in self.scaled])
        scaled = self.index.together([path for path in paths if path in self.scaled])
        with open_file(self.path) as file:
            queues = [Queue(self._source(file, group), group) for group in (*plain, *scaled)]
            for block, lacking in side_by_side(queues, rows_of(len(paths))):
                missing = {self.names[path]: count for path, count in lacking.items()}
                yield self.tallied({self.names[path]: samples for path, samples in block.items()}, missing)

    def _source(self, file: BinaryIO, paths: Sequence[str]) -> Iterator[Block]:
        if paths[0] in self.scaled:
            most = self.index.largest_chunk(paths)
            return self._said(samples.scaled_pieces(file, self.size, paths, most), paths[0])
        read = pieces(file, self.index.regions(paths[0]), paths, self.origin)
        scales = {path: self.scales[path] for path in paths if path in self.scales}
        return self._said(samples.applied(read, scales), paths[0]) if scales else read

    def _said(self, read: Iterator[Block], path: str) -> Iterator[Block]:
        """What npTDMS makes; whatever goes wrong in it is said to be of this channel."""
        try:
            yield from read
        except Exception as error:
            raise BadLog(f"{self.path}: npTDMS cannot read channel {path} ({error})") from error


def _rows(made: Mapping[str, Timeline]) -> Iterator[Block]:
    """Blocks of nothing, as long as the times that are made."""
    rows = max((timeline.rows for timeline in made.values()), default=0)
    for first in range(0, rows, ROWS):
        yield {"": np.empty(min(ROWS, rows - first))}


def _describe(log: TdmsLog, walk: Walk, waveforms: Waveforms) -> None:
    """What the properties and the file segments say about the log."""
    properties, latest = walk.objects.properties, walk.objects.latest
    log.facts["segments"] = str(walk.file_segments)
    log.facts["layout"] = ", ".join(sorted(walk.layouts))
    log.facts |= {key: str(value) for key, value in properties.get("/", {}).items() if isinstance(value, str) and value}
    log.scaled = frozenset(p for p, s in latest.items() if s.kind == DAQMX_RAW)
    for path in latest:
        if problem := samples.problem(said := _scales(properties, path)):
            raise BadLog(f"{log.path}: channel {path} {problem}")
        if said and path not in log.scaled:
            log.scales[path] = said
    for path, first in walk.objects.revised.items():
        # The first property that decides what a sample means.
        word = next((word for word in first if word.lower() in UNITS or word.startswith("NI_Scal")), "")
        if word and path in latest:
            log.mixed[log.names[path]] = (
                f"channel {log.names[path]!r} says {word} = {first[word]!r} first and {properties[path][word]!r} in a "
                "later file segment, so its samples are of two kinds; split the file, or record it again"
            )
    sizes = {log.names[path]: sum(rows for rows, _ in waveforms.writes.get(path, ())) for path in latest}
    _describe_time(log, waveforms, properties, sizes)
    if len(set(sizes.values())) > 1:
        counts = ", ".join(f"{name}: {length}" for name, length in list(sizes.items())[:6])
        log.warnings.append(f"channels have different numbers of samples ({counts}); the shorter end in nulls")
    elif not any(sizes.values()):
        log.warnings.append("the file names channels and holds no samples: the recorder stopped before its first write")


def _scales(properties: Mapping[str, dict[str, Any]], path: str) -> dict[str, Any]:
    """The properties that scale a channel: its own, else its group's, else the file's."""
    group = path[: path.find("'/'") + 1]
    candidates = (properties.get(p, {}) for p in (path, group, "/"))
    return next((candidate for candidate in candidates if samples.is_scaled(candidate)), {})


def _describe_time(
    log: TdmsLog, waveforms: Waveforms, properties: Mapping[str, Mapping[str, Any]], sizes: Mapping[str, int]
) -> None:
    """When the log started, and the clocks that time stamps and waveform properties give."""
    kinds = {channel.name: channel.kind for channel in log.channels}
    stamped = moment(EPOCH, log.origin) if log.origin else None
    started = stamped or waveforms.started
    timelines = waveforms.timelines(started, properties)
    sampled = {
        name: Sampled(names(path)[0], sizes[name], kinds[name] == "time", timelines.get(path))
        for path, name in log.names.items()
    }
    found = clocks_of(log.channels, sampled, log.cut)
    log.channels, log.clock, log.time, log.made = found.channels, found.clock, found.time, found.made
    said = (words.get("wf_start_time") for path, words in properties.items() if path in log.names)
    if started := started or next((start for start in said if isinstance(start, datetime)), None):
        log.zone, log.started = "UTC", started.replace(tzinfo=None).isoformat()
    for name, timeline in found.made.items():
        if gaps := [f"{first}" for first in timeline.first[1:]]:
            some = ", ".join(gaps[:5]) + (" ..." if len(gaps) > 5 else "")
            log.warnings.append(
                f"the file's later writes say another start or interval: {name!r} begins anew at sample {some}"
            )


def _first_second(file: BinaryIO, index: Index, path: str) -> int | None:
    """The whole second since 1904 of a channel's first time stamp."""
    for piece in pieces(file, index.regions(path), [path], 0):
        if len(piece[path]):
            return int(np.floor(piece[path][0]))
    return None
