"""NumPy's files: an array (.npy), or several by name (.npz); fields of records and columns of matrices are channels."""

from pathlib import Path

from davinci_forces.logs.isolated import reader

NPY = b"\x93NUMPY"
read = reader("davinci_forces.logs.npz.members")


def recognises(path: Path, head: bytes) -> bool:
    """Whether it begins as an array, or is a zip file whose first member is one."""
    return head.startswith(NPY) or (head.startswith(b"PK") and b".npy" in head[30:542])
