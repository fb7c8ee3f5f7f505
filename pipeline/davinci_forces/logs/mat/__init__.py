"""MATLAB files of versions 4 to 7.2, and of 7.3, which is HDF5: vectors, matrices and structs of them."""

from pathlib import Path

from davinci_forces.files import open_file
from davinci_forces.logs import isolated
from davinci_forces.logs.log import Log, Options


def recognises(path: Path, head: bytes) -> bool:
    """Whether the file begins with MATLAB's header, or has the suffix .mat and is not text."""
    return head.startswith(b"MATLAB ") or (path.suffix.lower() == ".mat" and b"\0" in head[:20])


def read(path: Path, options: Options) -> Log:
    """Open the file and list its variables; raises BadLog."""
    with open_file(path) as file:
        package = "h5py" if file.read(10) == b"MATLAB 7.3" else ""
    return isolated.read(path, options, reader="davinci_forces.logs.mat.variables", package=package)
