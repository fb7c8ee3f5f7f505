"""The conic solver, so that the same problem has the same answer."""

from typing import Any


def settings(tolerance: float) -> Any:
    """Of Clarabel: no words, one thread, nothing removed beforehand, and gaps and residuals of at most `tolerance`."""
    import clarabel

    chosen = clarabel.DefaultSettings()
    chosen.verbose = False
    chosen.max_threads = 1
    chosen.presolve_enable = False
    chosen.tol_gap_abs = chosen.tol_gap_rel = chosen.tol_feas = tolerance
    return chosen
