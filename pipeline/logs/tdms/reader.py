"""TDMS files, the binary logs of LabVIEW and DIAdem."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from pipeline.errors import BadLog
from pipeline.logs.blocks import ahead
from pipeline.logs.log import Block, Channel, Clock, Log, Options
from pipeline.logs.names import unique
from pipeline.logs.tdms import scaled
from pipeline.logs.tdms.metadata import DAQMX_RAW, EPOCH, NUMBERS, TIME, Objects, names
from pipeline.logs.tdms.samples import Queue, pieces, side_by_side
from pipeline.logs.tdms.walk import TAG, Walk

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
    shapes: set[frozenset[tuple[str, int]]] = set()
    lengths: dict[str, int] = {}
    with path.open("rb") as file:
        walk = Walk(file, path.stat().st_size, warnings.append)
        for region in walk.regions():
            shapes.add(frozenset(region.counts.items()))
            for channel, count in region.counts.items():
                lengths[channel] = lengths.get(channel, 0) + count * region.records
        origin = {p: _first_second(file, path, p) for p, s in walk.objects.latest.items() if s.kind == TIME}
    paths = list(walk.objects.latest)
    if not paths:
        why = f" ({'; '.join(warnings)})" if warnings else ""
        raise BadLog(f"{path}: no channel can be read from this TDMS file{why}; record it again")
    counts = {p: tuple(dict(shape).get(p, 0) for shape in shapes) for p in paths}
    log = TdmsLog(path, "tdms", _channels(walk.objects), warnings=warnings, size=walk.end, counts=counts, origin=origin)
    log.cut = walk.cut
    _describe(log, walk, lengths)
    return log


def _channels(objects: Objects) -> tuple[Channel, ...]:
    written = unique(["/".join(names(path)) for path in objects.latest])
    return tuple(
        Channel(name, _unit(objects.properties.get(path, {})), _kind(samples.kind))
        for name, (path, samples) in zip(written, objects.latest.items(), strict=True)
    )


def _kind(kind: int) -> str:
    return "number" if kind in NUMBERS or kind == DAQMX_RAW else "time" if kind == TIME else "text"


def _unit(properties: Mapping[str, Any]) -> str:
    lower = {name.lower(): value for name, value in properties.items()}
    return next((str(lower[name]) for name in UNITS if lower.get(name)), "")


@dataclass
class TdmsLog(Log):
    """An opened TDMS file.  Samples of a channel of time stamps are seconds since the first of them."""

    size: int = 0  # [bytes] of the file that can be read
    counts: dict[str, tuple[int, ...]] = field(default_factory=dict)  # by path: its samples in records of every shape
    scaled: frozenset[str] = frozenset()  # paths that npTDMS reads
    origin: dict[str, int] = field(default_factory=dict)  # [s] since 1904 of the first time stamp, by path

    def blocks(self, names: Sequence[str]) -> Iterator[Block]:
        """Read the samples of these channels, as `Log.blocks` says.

        Channels of unequal lengths are filled up with NaN behind their ends.
        """
        self._start_anew(names, kinds=("number", "time"))
        name = {path: channel.name for path, channel in zip(self.counts, self.channels, strict=True)}
        yield from ahead(self._blocks(names, name))

    def _blocks(self, names: Sequence[str], name: Mapping[str, str]) -> Iterator[Block]:
        with ExitStack() as stack:
            together = self._together([path for path in self.counts if name[path] in names])
            queues = [Queue(self._source(paths, stack), paths) for paths in together]
            for block, lacking in side_by_side(queues):
                for path, samples in block.items():
                    self.nulls[name[path]] += lacking[path]
                    self.nans[name[path]] += int(np.count_nonzero(np.isnan(samples))) - lacking[path]
                by_name = {name[path]: samples for path, samples in block.items()}
                yield {asked_for: by_name[asked_for] for asked_for in names}

    def _together(self, paths: Sequence[str]) -> list[list[str]]:
        """The channels that can be read in one go: those with as many samples as each other in every record."""
        groups: dict[tuple[int, ...] | str, list[str]] = {}
        for path in paths:
            groups.setdefault(path if path in self.scaled else self.counts[path], []).append(path)
        return list(groups.values())

    def _source(self, paths: Sequence[str], stack: ExitStack) -> Iterator[Block]:
        file = stack.enter_context(self.path.open("rb"))
        if paths[0] in self.scaled:
            return self._scaled(file, paths[0])
        return pieces(file, Walk(file, self.size, lambda _: None).regions(), paths, self.origin)

    def _scaled(self, file: BinaryIO, path: str) -> Iterator[Block]:
        try:
            yield from scaled.pieces(file, self.size, path)
        except Exception as error:
            raise BadLog(f"{self.path}: npTDMS cannot read channel {path} ({error})") from error


def _describe(log: TdmsLog, walk: Walk, lengths: Mapping[str, int]) -> None:
    """What the properties and the file segments say about the log."""
    properties = walk.objects.properties
    latest = walk.objects.latest
    log.facts["segments"] = str(walk.file_segments)
    log.facts["layout"] = ", ".join(sorted(walk.layouts))
    log.facts |= {key: str(value) for key, value in properties.get("/", {}).items() if isinstance(value, str) and value}
    log.scaled = frozenset(p for p, s in latest.items() if s.kind == DAQMX_RAW or _scales(properties, p))
    for path in log.scaled:
        if unknown := scaled.unknown_scales(_scales(properties, path)):
            raise BadLog(f"{log.path}: channel {path} has a scale of unknown kind: {', '.join(unknown)}")
    _describe_time(log, {path: properties.get(path, {}) for path in latest})
    sizes = {"/".join(names(path)): lengths.get(path, 0) for path in latest}
    if len(set(sizes.values())) > 1:
        counts = ", ".join(f"{name}: {length}" for name, length in list(sizes.items())[:6])
        log.warnings.append(f"channels have different numbers of samples ({counts}); the shorter end in nulls")
    elif not any(sizes.values()):
        log.warnings.append("the file names channels and holds no samples: the recorder stopped before its first write")


def _scales(properties: Mapping[str, dict[str, Any]], path: str) -> dict[str, Any]:
    """The properties that scale a channel: its own, else its group's, else the file's."""
    group = path[: path.find("'/'") + 1]
    candidates = (properties.get(p, {}) for p in (path, group, "/"))
    return next((candidate for candidate in candidates if scaled.is_scaled(candidate)), {})


def _describe_time(log: TdmsLog, properties: Mapping[str, Mapping[str, Any]]) -> None:
    """The clock that the waveform properties give, and when it started."""
    log.zone = "UTC"
    steps = {path: p["wf_increment"] for path, p in properties.items() if p.get("wf_increment")}
    if steps:
        path, step = next(iter(steps.items()))
        log.clock = Clock(float(step), float(properties[path].get("wf_start_offset", 0.0)))
        if len(set(steps.values())) > 1:
            log.warnings.append(
                f"channels have different sampling intervals ({_some(steps)}); the clock is the first one's"
            )
    starts = [p["wf_start_time"] for p in properties.values() if isinstance(p.get("wf_start_time"), datetime)]
    stamps = [channel.name for channel in log.channels if channel.kind == "time"]
    log.time = stamps[0] if stamps else ""
    if starts:
        log.started = starts[0].replace(tzinfo=None).isoformat()
    elif log.origin:
        log.started = (EPOCH + timedelta(seconds=min(log.origin.values()))).replace(tzinfo=None).isoformat()
    else:
        log.zone = ""


def _some(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{'/'.join(names(path))}: {value:g} s" for path, value in list(values.items())[:6])


def _first_second(file: BinaryIO, log: Path, path: str) -> int:
    """The whole second since 1904 of a channel's first time stamp."""
    regions = Walk(file, log.stat().st_size, lambda _: None).regions()
    for piece in pieces(file, regions, [path], {}):
        if len(piece[path]):
            return int(np.floor(piece[path][0]))
    return 0
