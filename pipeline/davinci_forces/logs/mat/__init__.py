"""MATLAB files of versions 4 to 7.2, and of 7.3, which is HDF5: vectors, matrices and structs of them."""

from pathlib import Path

from davinci_forces.logs.isolated import reader

read = reader("davinci_forces.logs.mat.variables")


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins with MATLAB's header, or has the suffix .mat and is not text."""
    return head.startswith(b"MATLAB ") or (path.suffix.lower() == ".mat" and b"\0" in head[:20])
