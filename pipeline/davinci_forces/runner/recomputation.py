"""Whether raw/ gives a study's results once more: everything runs anew in a temporary folder, and is compared."""

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
from davinci_forces.runner.verification import listing

ROUNDING = 1e-9  # of a number, up to which it counts as the same
RELATIVE_LIMIT = 1e-6  # of a number without standard deviation, beyond which it is another
STD_LIMIT = 0.1  # of a number's standard deviation, beyond which it is another
ZERO = 1e-12  # in any unit: rounding, where a number would be 0
# Keys of results that a change of the last digit sends another way, so that they are not judged.  With other kernels of
# BLAS and without AVX2 in numpy, all other numbers of the demonstration, a UR10e and a dVRK are within the limits.
SEARCHED = re.compile(
    r"ekf-adaptive\..*"  # its noise follows its own innovations
    r"|.*\.pso\..*"  # a swarm follows whichever of its particles is the best
    r"|control\..*"  # an integrator chooses its steps
    r"|haptics\..*"  # bisection for the tissue at which a simulated hand begins to diverge
    r"|.*\.push_delay|tissue\..*\.onset"  # counted in samples, and a level is passed a sample earlier
)
DIFFERENT, FAR = "differ by more than 1e-9 of themselves", "differ by more than their standard deviation"
NOT_JUDGED = "differ, and are not judged, since a search or a count of samples gives them"
NEW, GONE, OTHER = "are not in results.json", "do not come from raw/", "are not what raw/ gives"


def has_same_environment(folders: Folders) -> bool:
    """Whether all results were made with the packages and on the kind of processor that this process has."""
    return {entry.environment for entry in Ledger(folders).entries()} == {reporting.environment()}


def recompute(folders: Folders, by_bytes: bool, jobs: int = 1) -> list[str]:
    """Run a study anew from raw/ in a temporary folder; compare files, or else numbers; what came of it, in words.

    Raises
    ------
    NotReproduced
        If a task fails that did not, or with the files or numbers that are not what raw/ gives.
    """
    with TemporaryDirectory(prefix="davinci-forces-") as home:
        anew = runs.folders(folders.raw, Path(home, "processed"), Path(home, "reports"))
        with redirect_stderr(StringIO()):  # what it warns of was said when the results were made
            runs.run(folders.raw, ALL, anew.processed.parent, anew.reports.parent, jobs=jobs, verbosity="quiet")
        stored, computed = Ledger(folders), Ledger(anew)
        known = {(entry.stage, entry.task) for entry in stored.entries() if entry.failed}
        failed = [entry for entry in computed.entries() if entry.failed and (entry.stage, entry.task) not in known]
        if failed:
            failures = (
                f"recomputed from raw/, {entry.stage} fails on {entry.task}: {entry.failed}" for entry in failed
            )
            raise NotReproduced("\n".join(failures))
        if by_bytes:
            return compare_files(stored, computed)
        stated = (json.loads(read_bytes(each.reports / "results.json")) for each in (folders, anew))
        return compare_numbers(*({row["key"]: row for row in rows} for rows in stated))


def compare_files(stored: Ledger, computed: Ledger) -> list[str]:
    """Compare all outputs by their hashes, in the order of the stages; raises as `recompute` does."""
    by_stage = (sorted(each.entries(), key=lambda e: ALL.index(stage_of(e.stage))) for each in (stored, computed))
    old, new = ({name: sha for e in entries for name, sha in e.outputs.items()} for entries in by_stage)
    different = [str(stored.folders.file(name)) for name in old | new if old.get(name) != new.get(name)]
    if different:
        count = f"{len(different)} of {len(old | new)} files are not, byte for byte, what raw/ gives"
        raise NotReproduced(f"{count}: {listing(different)}")
    return [f"recomputed from raw/: {len(new)} files are the same, byte for byte"]


def compare_numbers(old: dict[str, Any], new: dict[str, Any]) -> list[str]:
    """Compare results by key, as far as they are not searched; raises as `recompute` does."""
    groups: dict[str, list[str]] = {DIFFERENT: [], FAR: []}
    for key in old | new:
        for what in differences(key, old.get(key), new.get(key)):
            groups.setdefault(what, []).append(key)
    counts = (f"{len(keys)} {what}" + (f" ({listing(keys)})" if keys else "") for what, keys in groups.items())
    head = f"recomputed from raw/: other processor or packages, not compared by bytes; of {len(new)} numbers "
    if groups.keys() & {NEW, GONE, OTHER}:
        raise NotReproduced(head + "; ".join(counts))
    return [head + "; ".join(counts)]


def differences(key: str, old: dict[str, Any] | None, new: dict[str, Any] | None) -> Iterator[str]:
    """What there is to say of a number of results.json, with its unit and standard deviation."""
    if not old or not new:
        yield GONE if old else NEW
        return
    std, size = new["std"] or 0.0, abs(new["value"])
    difference = abs(old["value"] - new["value"])
    if difference > max(ROUNDING * size, ZERO):
        yield DIFFERENT
        if SEARCHED.fullmatch(key):
            yield NOT_JUDGED
    if 0 < std < difference:
        yield FAR
    deviates = abs((old["std"] or 0.0) - std) > STD_LIMIT * std
    differs = difference > (STD_LIMIT * std or max(RELATIVE_LIMIT * size, ZERO))
    if not SEARCHED.fullmatch(key) and (differs or deviates or old["unit"] != new["unit"]):
        yield OTHER
