"""Reading a whole log at once, as the tests need it."""

import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from davinci_forces.logs import open_log
from davinci_forces.logs.log import Log, Options

Samples = dict[str, NDArray[np.float64]]
Read = tuple[Log, Samples]


def whole(path: Path, options: Options = Options()) -> Read:  # noqa: B008 - frozen
    """The log, and all samples of all its channels that hold numbers or times."""
    log = open_log(path, options)
    names = [channel.name for channel in log.channels if channel.kind in ("number", "time")]
    samples: Samples = {}
    nulls, nans = {}, {}
    for together in log.by_clock(names).values():
        blocks = list(log.blocks(together))
        samples |= {name: np.concatenate([np.empty(0), *(block[name] for block in blocks)]) for name in together}
        nulls, nans = nulls | log.nulls, nans | log.nans
    log.nulls, log.nans = nulls, nans
    return log, {name: samples[name] for name in names}


def read(content: bytes, name: str = "log.lvm", options: Options = Options()) -> Read:  # noqa: B008 - frozen
    """The same of the content of a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        return whole(path, options)


def times_of(log: Log, name: str, samples: Samples) -> NDArray[np.float64]:
    """When the samples of a channel were taken, as the log says it of its clock."""
    [channel] = [channel for channel in log.channels if channel.name == name]
    if time := channel.time or log.time:
        return samples[time]
    assert log.clock is not None
    return log.clock.start + log.clock.step * np.arange(len(samples[name]))
