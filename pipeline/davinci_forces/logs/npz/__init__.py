"""NumPy's files: an array (.npy), or several by name (.npz); fields of records and columns of matrices are channels."""

from pathlib import Path

from davinci_forces.logs import isolated
from davinci_forces.logs.log import Log, Options

NPY = b"\x93NUMPY"


def recognises(path: Path, head: bytes) -> bool:
    """Whether it begins as an array, or is a zip file whose first member is one."""
    return head.startswith(NPY) or (head.startswith(b"PK") and b".npy" in head[30:542])


def read(path: Path, options: Options) -> Log:
    """Open the file and list its arrays.

    Raises
    ------
    BadLog
        If it cannot be read.
    """
    return isolated.start(path, options, "davinci_forces.logs.npz.members")
