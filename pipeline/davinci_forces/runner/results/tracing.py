"""The way from a number of the report back to the raw files on which it rests."""

from collections.abc import Iterator
from difflib import get_close_matches

from davinci_forces.errors import BadRequest
from davinci_forces.runner.console import shorten
from davinci_forces.runner.ledger import Folders, Ledger
from davinci_forces.runner.results.dataframes import numbers_of

DIGITS = 16  # of a hash, as the report prints them


def trace(folders: Folders, key: str) -> Iterator[str]:
    """The lines that lead from a key of results.json to its record, the tasks behind it, and the raw files.

    Raises BadRequest if there is no such number; MissingRecord if the study has no report.
    """
    numbers = numbers_of(folders)
    if key not in numbers:
        alike = [name for name in numbers if name.split(".")[:2] == key.split(".")[:2]] or numbers
        near = " or ".join(get_close_matches(key, alike, 3))
        hint = f"did you mean {near}?" if near else f"{folders.reports / 'results.json'} lists the key of every number"
        raise BadRequest(f"the report of {folders.raw} has no number {key}; {hint}")
    number = numbers[key]
    file, _, place = number["source"].partition("#")
    error = "" if number["std"] is None else f" ± {number['std']:.2g}"
    yield f"{key} = {number['value']:.6g}{error} {number['unit']}"
    yield f"  it is {place} in {folders.file(file)} (SHA-256 {number['sha256'][:DIGITS]})"
    made = {name: entry for entry in Ledger(folders).entries() for name in entry.outputs}
    stages: dict[str, dict[str, None]] = {}
    raw: dict[str, tuple[bool, str]] = {}  # whether the file belongs to a log that the key names, and its hash
    waiting, seen = [file], {file}
    while waiting:
        if (entry := made.get(waiting.pop(0))) is None:
            continue
        stages.setdefault(entry.stage, {})[entry.task] = None
        for name, sha in entry.fingerprint["inputs"].items():
            raw |= {name: (entry.task in key.split("."), sha)} if name.startswith("raw/") else {}
            waiting += [name] if name not in seen else []
            seen.add(name)
    for stage, tasks in stages.items():
        yield f"  by {stage}: {shorten([*tasks])}"
    for name, (is_own, sha) in sorted(raw.items(), key=lambda item: (not item[1][0], item[0])):
        yield f"  from {folders.file(name)}{'' if is_own else ', for the model'} (SHA-256 {sha[:DIGITS]})"
