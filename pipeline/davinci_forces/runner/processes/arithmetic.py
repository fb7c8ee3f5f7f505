"""One way of reckoning in every process: BLAS with one thread, and with kernels that processors share.

Sums of products come out differently in the last digits with other threads or kernels, so both are set before numpy
loads, which reads them once.
"""

import os
import platform
import sys
from functools import cache
from pathlib import Path

THREADS = ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
KERNELS = "Haswell"  # of OpenBLAS, for every processor of the last ten years that has AVX2
NEEDED = {"avx2", "fma"}


def wanted() -> dict[str, str]:
    """The environment that numpy is to be loaded in on this machine; workers of a cluster are started in it, too."""
    kernels = {"OPENBLAS_CORETYPE": KERNELS} if _features() >= NEEDED else {}
    return dict.fromkeys(THREADS, "1") | kernels


def pin() -> None:
    """Set threads and kernels for numpy, if it has not loaded yet, and for processes that this one starts."""
    global _as_it_was
    _as_it_was = not is_pinned()
    os.environ.update(wanted())


def is_pinned() -> bool:
    """Whether numpy has loaded, or will load, with these threads and kernels."""
    as_wanted = all(os.environ.get(name) == value for name, value in wanted().items())
    return not _as_it_was and (as_wanted or "numpy" not in sys.modules)


def described() -> str:
    """How this process reckons, for the report and to compare machines by."""
    if not is_pinned():
        return "BLAS as it was loaded before davinci-forces was"
    return f"BLAS with one thread, kernels: {wanted().get('OPENBLAS_CORETYPE', f'those for this {platform.machine()}')}"


@cache
def instructions() -> str:
    """The instruction sets that numpy computes with beyond the least: sines of two sets differ in the last digit."""
    import numpy as np

    return " ".join(np.show_config(mode="dicts").get("SIMD Extensions", {}).get("found", ()))


_as_it_was = False  # numpy loaded before `pin` was called


@cache
def _features() -> set[str]:
    """What the processor can do, where the system says so in a file."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return {word for line in lines if line.startswith("flags") for word in line.split()}
