"""The log readers' work and their rivals', timed alike: from a file to Parquet, in this process."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from davinci_forces.logs import open_log

ROW_GROUP = 1 << 20
Report = Callable[[str], None]  # what shows a line


def parquet(path: Path, names: list[str]) -> pq.ParquetWriter:
    """A Parquet file as the store writes it: floats split by byte, compressed quickly, without dictionaries."""
    return pq.ParquetWriter(
        path, pa.schema([pa.field(name, pa.float64(), nullable=False) for name in names]), use_dictionary=False,
        column_encoding="BYTE_STREAM_SPLIT", compression="lz4", write_statistics=False,
    )  # fmt: skip


def ours(log: Path, target: Path) -> int:
    """Read a log and write it; the number of rows."""
    opened = open_log(log)
    names = [channel.name for channel in opened.channels if channel.kind == "number" and not channel.derived]
    rows = 0
    with parquet(target, names) as writer:
        for block in opened.blocks(names):
            writer.write_table(pa.table(block, schema=writer.schema), row_group_size=ROW_GROUP)
            rows += len(block[names[0]])
    return rows


def nptdms(log: Path, target: Path) -> int:
    """The same with npTDMS: the whole file at once."""
    from nptdms import TdmsFile

    with log.open("rb") as file:
        samples = {f"{c.name}": np.asarray(c[:], np.float64) for c in TdmsFile.read(file).groups()[0].channels()}
    with parquet(target, list(samples)) as writer:
        writer.write_table(pa.table(samples, schema=writer.schema), row_group_size=ROW_GROUP)
    return len(next(iter(samples.values())))


def ours_alone(log: Path) -> float:
    """Read all channels of a log, one clock after the other; the sum of all samples, so that each is read."""
    opened = open_log(log)
    names = [channel.name for channel in opened.channels if channel.kind == "number" and not channel.derived]
    groups = opened.by_clock(names).values()
    columns = (x for together in groups for block in opened.blocks(together) for x in block.values())
    return sum(float(x[x == x].sum()) for x in columns)  # a shorter channel ends in NaN


def nptdms_alone(log: Path) -> float:
    """The same with npTDMS."""
    from nptdms import TdmsFile

    with log.open("rb") as file:
        channels = (channel for group in TdmsFile.read(file).groups() for channel in group.channels())
        return sum(float(np.asarray(channel[:], np.float64).sum()) for channel in channels)


def seconds(*works: Callable[[], object], repeats: int = 5) -> list[float]:
    """The least times of the processor that some works take [s], in turn: what else the machine does can only add."""
    times: list[list[float]] = [[] for _ in works]
    for _ in range(repeats):
        for work, taken in zip(works, times, strict=True):
            start = time.process_time()
            work()
            taken.append(time.process_time() - start)
    return [min(taken) for taken in times]
