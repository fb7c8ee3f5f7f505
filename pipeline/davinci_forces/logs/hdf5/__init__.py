"""HDF5 files: every dataset of numbers, named by its path, with the unit of its attribute `units`."""

from functools import partial
from pathlib import Path

from davinci_forces.logs import isolated

read = partial(isolated.read, reader="davinci_forces.logs.hdf5.datasets", package="h5py")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the signature stands at the beginning, or after a user block of one of the allowed sizes."""
    return any(head.startswith(b"\x89HDF\r\n\x1a\n", at) for at in (0, 512, 1024, 2048))
