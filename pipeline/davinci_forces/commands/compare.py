"""Compare the numbers of two reports: which changed, which were added and which were removed.

A number has changed from a to b if |b - a| > 2 sqrt(s_a^2 + s_b^2). If neither report has a standard error, a relative
difference above 1e-9 is a change, but not among numbers below 2.2e-308. Another unit is a change, too. Accuracy, of
which verdicts are made, is listed first, and what has no standard error last. The exit code is always 0.
"""

import json
import sys
from collections import Counter
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

from davinci_forces.commands import Reports
from davinci_forces.report.changes import RANKS, Change, StatedValue, by_joint, changes
from davinci_forces.runner.console import echo, table
from davinci_forces.runner.results import stated

LARGEST = 10  # changes of a joint that are listed


def run(
    a: Annotated[Path, Argument(help="A results.json, or a study, raw/<study>, that has one.")],
    b: Annotated[Path, Argument(help="The results.json or study to compare with it.")],
    reports: Reports = None,
    every: Annotated[bool, Option("--all", help="List every change, not the ten largest of each joint.")] = False,
    as_json: Annotated[bool, Option("--json", help="Print rows of key, a, b, std of b - a, and z as JSON.")] = False,
) -> None:
    """List what changed from A to B by joint: first what has a standard error, by subject, then what has none."""
    from davinci_forces.runner import runs

    files = runs.results_of(a, reports), runs.results_of(b, reports)
    before, after = (stated.read(file) for file in files)
    differing = changes(before, after)
    if as_json:
        echo(json.dumps([_row(change) for change in differing], indent=1, ensure_ascii=False, allow_nan=False))
        return
    arms = [stated.robot_of(file) for file in files]
    for name, file, numbers, arm in zip("ab", files, (before, after), arms, strict=True):
        echo(f"{name}: {file}, {len(numbers)} numbers{f' of robot {arm}' if arm else ''}")
    if all(arms) and arms[0] != arms[1] and not every:
        echo("these are different robots, so their numbers are not compared; --all compares those with the same key")
        return
    echo("\n".join(_lines(differing, before, after, sys.maxsize if every else LARGEST)))


def _row(change: Change) -> dict[str, Any]:
    """One change as JSON values: null for an absent number, text for NaN and infinity, which JSON does not have."""
    a, b = (_plain(number.value) if number else None for number in (change.before, change.after))
    return {"key": change.key, "a": a, "b": b, "std": _plain(change.std), "z": change.z}


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, float) and not isfinite(value) else value


def _lines(
    differing: list[Change], before: dict[str, StatedValue], after: dict[str, StatedValue], most: int
) -> list[str]:
    def counts(some: list[Change]) -> str:
        number = Counter(change.subject for change in some)
        return ": " + ", ".join(f"{number[about]} of {about}" for about in RANKS if number[about]) if some else ""

    changed = [change for change in differing if change.before and change.after]
    shared = [key for key in before if key in after]
    lines = [f"{len(changed)} of the {len(shared)} shared numbers changed{counts(changed)}"]
    if changed:
        with_error = sum(before[key].std is not None or after[key].std is not None for key in shared)
        chance = f"between independent recordings, about {0.05 * with_error:.0f} would by chance"
        lines += [f"{sum(c.z is not None for c in changed)} of the {with_error} with a standard error did; {chance}"]
    for joint, group in by_joint(changed, [*before, *after]).items():
        lines += ["", f"{joint or 'not of one joint'}: {len(group)} changed"]
        rows = [("", "key", "a", "b", "std", "z"), *map(_cells, group[:most])]
        lines += [f"  {line}" for line in table(rows, right_from=2)]
        lines += [f"  and{counts(group[most:])[1:]}: --all lists them"] if group[most:] else []
    removed, added = [c.key for c in differing if not c.after], [c.key for c in differing if not c.before]
    for verb, keys in (("removed", removed), ("added", added)):
        more = [f"  and {len(keys) - most} more: --all lists them"] if len(keys) > most else []
        lines += [f"{len(keys)} {verb}:", *(f"  {key}" for key in keys[:most]), *more] if keys else []
    return lines


def _cells(change: Change) -> tuple[str, ...]:
    assert change.before
    assert change.after
    std, z = (None if x is None else format(x, spec) for x, spec in ((change.std, ".2g"), (change.z, "+.1f")))
    return (change.subject, change.key, *_pair(change.before, change.after), std or "", z or "")


def _pair(a: StatedValue, b: StatedValue) -> tuple[str, str]:
    """Two values with their units, in at least 5 digits and as many as show the difference."""
    from davinci_forces.report.results import format_unit

    for digits in range(5, 18):
        texts = tuple(f"{x.value:.{digits}g}" if isinstance(x.value, float) else str(x.value) for x in (a, b))
        if texts[0] != texts[1]:
            break
    return f"{texts[0]} {format_unit(a.unit)}".rstrip(), f"{texts[1]} {format_unit(b.unit)}".rstrip()
