"""The same floating-point arithmetic in every process: BLAS with one thread and with kernels common to processors.

The last digits of sums of products depend on threads and kernels.  Numpy reads both once, so they are set before
numpy is loaded.
"""

import os
import platform
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path

THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
KERNELS = "Haswell"  # kernels of OpenBLAS for every processor of the last ten years that has AVX2
KERNEL_FEATURES = {"avx2", "fma"}  # processor features that these kernels need


@cache
def blas_variables() -> dict[str, str]:
    """Environment variables with which numpy has to be loaded on this machine, and in workers of a cluster."""
    lines: list[str] = []
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    features = {word for line in lines if line.startswith("flags") for word in line.split()}
    kernels = {"OPENBLAS_CORETYPE": KERNELS} if features >= KERNEL_FEATURES else {}
    return dict.fromkeys(THREADS, "1") | kernels


def pin() -> None:
    """Set threads and kernels for numpy, if it has not loaded yet, and for processes that this one starts."""
    global _loaded_unpinned
    _loaded_unpinned = not is_pinned()
    os.environ.update(blas_variables())


def is_pinned() -> bool:
    """Whether numpy has loaded, or will load, with these threads and kernels."""
    are_set = all(os.environ.get(name) == value for name, value in blas_variables().items())
    return not _loaded_unpinned and (are_set or "numpy" not in sys.modules)


def description() -> str:
    """A description of this process's arithmetic, for the report and to compare machines."""
    if not is_pinned():
        return "BLAS as it was loaded before davinci-forces was"
    kernels = blas_variables().get("OPENBLAS_CORETYPE", f"those for this {platform.machine()}")
    return f"BLAS with one thread, kernels: {kernels}"


@cache
def instructions() -> str:
    """The optional instruction sets that numpy uses, on which the last digits of sines depend."""
    import numpy as np

    return " ".join(np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", ()))


_loaded_unpinned = False  # numpy was loaded before `pin` was called, without these variables
