"""Recompute a study from raw/ in a temporary folder, and compare the results with the stored ones."""

import json
import re
from collections.abc import Iterator
from contextlib import redirect_stderr
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from davinci_forces.errors import NotReproduced
from davinci_forces.files import read_bytes
from davinci_forces.runner import ALL, reporting, runs
from davinci_forces.runner.ledger import Folders, Ledger
from davinci_forces.runner.signature import stage_of
from davinci_forces.runner.verification import shorten

MAX_ROUNDING = 1e-9  # relative change of a number that counts as unchanged
MAX_RELATIVE_CHANGE = 1e-6  # relative change of a number without standard deviation
MAX_CHANGE_BY_STD = 0.1  # change of a number, or of its standard deviation, over the standard deviation
MAX_ZERO = 1e-12  # in any unit: a number up to this size is a rounding error of 0
# Keys of results that depend strongly on the last digits of other numbers are not limited.  With other kernels of BLAS
# and without AVX2 in numpy, all other numbers of the demonstration, a UR10e and a dVRK are within the limits.
UNLIMITED = re.compile(
    r"ekf-adaptive\..*"  # the noise is tuned to innovations that depend on the noise
    r"|.*\.pso\..*"  # a swarm follows its best particle
    r"|control\..*"  # an integrator chooses its steps
    r"|(haptics|stability)\..*"  # bisection for the tissue at which a simulated hand begins to diverge
    r"|.*\.push_delay|tissue\..*\.onset"  # counted in samples until a level is passed
)
DIFFERENT, FAR = "differ by more than 1e-9 of their size", "differ by more than their standard deviation"
NOT_LIMITED = "differ without a limit, since they come from a search or a count of samples"
NEW, MISSING, WRONG = "are not in results.json", "are not computed from raw/", "do not agree with raw/"


def has_same_environment(folders: Folders) -> bool:
    """Whether all results were made with the packages and the kind of processor of this process."""
    return {entry.environment for entry in Ledger(folders).entries()} == {reporting.environment()}


def recompute(folders: Folders, by_bytes: bool, jobs: int = 1) -> list[str]:
    """Recompute a study from raw/ in a temporary folder, and compare files byte by byte, or else numbers.

    Raises NotReproduced if a task fails that did not fail before, or files or numbers do not agree.
    """
    with TemporaryDirectory(prefix="davinci-forces-") as home:
        new = runs.folders(folders.raw, Path(home, "processed"), Path(home, "reports"))
        with redirect_stderr(StringIO()):  # the warnings were printed when the results were made
            runs.run(folders.raw, ALL, new.processed.parent, new.reports.parent, jobs=jobs, verbosity="quiet")
        stored, computed = Ledger(folders), Ledger(new)
        before = {(entry.stage, entry.task) for entry in stored.entries() if entry.failed}
        failed = [e for e in computed.entries() if e.failed and (e.stage, e.task) not in before]
        if failed:
            lines = (f"recomputed from raw/, {e.stage} fails on {e.task}: {e.failed}" for e in failed)
            raise NotReproduced("\n".join(lines))
        if by_bytes:
            return compare_files(stored, computed)
        results = (json.loads(read_bytes(side.reports / "results.json")) for side in (folders, new))
        return compare_numbers(*({row["key"]: row for row in rows} for rows in results))


def compare_files(stored: Ledger, computed: Ledger) -> list[str]:
    """Compare all outputs by their hashes, in the order of the stages; raises as `recompute` does."""
    by_stage = (sorted(ledger.entries(), key=lambda e: ALL.index(stage_of(e.stage))) for ledger in (stored, computed))
    old, new = ({name: sha for e in entries for name, sha in e.outputs.items()} for entries in by_stage)
    different = [str(stored.folders.file(name)) for name in old | new if old.get(name) != new.get(name)]
    if different:
        count = f"{len(different)} of {len(old | new)} files differ from those recomputed from raw/"
        raise NotReproduced(f"{count}: {shorten(different)}")
    return [f"recomputed from raw/: {len(new)} files are the same, byte for byte"]


def compare_numbers(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """Compare results by key, within the limits; raises as `recompute` does."""
    groups: dict[str, list[str]] = {DIFFERENT: [], FAR: []}
    for key in old | new:
        for what in differences(key, old.get(key), new.get(key)):
            groups.setdefault(what, []).append(key)
    counts = (f"{len(keys)} {what}" + (f" ({shorten(keys)})" if keys else "") for what, keys in groups.items())
    head = "recomputed from raw/ with another processor or packages, so compared by number and not by byte"
    text = f"{head}: of {len(new)} numbers {'; '.join(counts)}"
    if groups.keys() & {NEW, MISSING, WRONG}:
        raise NotReproduced(text)
    return [text]


def differences(key: str, old: dict[str, Any] | None, new: dict[str, Any] | None) -> Iterator[str]:
    """How a number of results.json, its unit and its standard deviation differ from the recomputed ones."""
    if not old or not new:
        yield MISSING if old else NEW
        return
    std, size = new["std"] or 0.0, abs(new["value"])
    difference = abs(old["value"] - new["value"])
    if difference > max(MAX_ROUNDING * size, MAX_ZERO):
        yield DIFFERENT
        if UNLIMITED.fullmatch(key):
            yield NOT_LIMITED
    if 0 < std < difference:
        yield FAR
    deviates = abs((old["std"] or 0.0) - std) > MAX_CHANGE_BY_STD * std
    differs = difference > (MAX_CHANGE_BY_STD * std or max(MAX_RELATIVE_CHANGE * size, MAX_ZERO))
    if not UNLIMITED.fullmatch(key) and (differs or deviates or old["unit"] != new["unit"]):
        yield WRONG
