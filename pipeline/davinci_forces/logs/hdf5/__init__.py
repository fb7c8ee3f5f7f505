"""HDF5 files: every dataset of numbers, named by its path, with the unit of its attribute `units`."""

from pathlib import Path

from davinci_forces.logs import isolated
from davinci_forces.logs.log import Log, Options

SIGNATURE = b"\x89HDF\r\n\x1a\n"
MAY_BEGIN_AT = (0, 512, 1024, 2048)  # [bytes], after a user block


def recognises(path: Path, head: bytes) -> bool:
    """Whether the signature stands at one of the allowed positions."""
    return any(head.startswith(SIGNATURE, at) for at in MAY_BEGIN_AT)


def read(path: Path, options: Options) -> Log:
    """Open the file and list its datasets.

    Raises
    ------
    BadLog
        If h5py is not installed, or the file cannot be read.
    """
    isolated.require(path, "h5py", "hdf5")
    return isolated.start(path, options, "davinci_forces.logs.hdf5.datasets")
