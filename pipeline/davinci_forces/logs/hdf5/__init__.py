"""HDF5 files: every dataset of numbers, by the path of its group; units by the attribute `units`."""

from pathlib import Path

from davinci_forces.logs import isolated
from davinci_forces.logs.log import Log, Options

SIGNATURE = b"\x89HDF\r\n\x1a\n"
MAY_BEGIN_AT = (0, 512, 1024, 2048)  # behind a block of the user's


def recognises(path: Path, head: bytes) -> bool:
    """Whether the signature stands where it may."""
    return any(head.startswith(SIGNATURE, at) for at in MAY_BEGIN_AT)


def read(path: Path, options: Options) -> Log:
    """Open the file: list its datasets.

    Raises
    ------
    BadLog
        If h5py is not installed, or the file cannot be read.
    """
    isolated.require(path, "h5py", "hdf5")
    return isolated.start(path, options, "davinci_forces.logs.hdf5.datasets")
