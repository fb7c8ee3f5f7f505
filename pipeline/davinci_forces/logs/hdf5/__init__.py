"""HDF5 files: every dataset of numbers, named by its path, with the unit of its attribute `units`."""

from functools import partial
from pathlib import Path

from davinci_forces.logs import isolated

SIGNATURE = b"\x89HDF\r\n\x1a\n"
MAY_BEGIN_AT = (0, 512, 1024, 2048)  # [bytes], after a user block
read = partial(isolated.read, reader="davinci_forces.logs.hdf5.datasets", package="h5py")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the signature stands at one of the allowed positions."""
    return any(head.startswith(SIGNATURE, at) for at in MAY_BEGIN_AT)
