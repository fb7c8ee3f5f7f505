"""MATLAB files of versions 4 to 7.2, and of 7.3, which is HDF5: vectors, matrices and structs of them."""

from pathlib import Path

from davinci_forces.files import open_file
from davinci_forces.logs.isolated import require, start
from davinci_forces.logs.log import Log, Options


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins with MATLAB's header, or has the suffix .mat and is not text."""
    return head.startswith(b"MATLAB ") or (path.suffix.lower() == ".mat" and b"\0" in head[:20])


def read(path: Path, options: Options) -> Log:
    """Open the file and list its variables; raises BadLog."""
    with open_file(path) as file:
        if file.read(512).startswith(b"MATLAB 7.3"):
            require(path, "h5py", "hdf5")
    return start(path, options, "davinci_forces.logs.mat.variables")
