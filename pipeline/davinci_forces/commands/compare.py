"""Compare the numbers of two reports: which changed, which were added and which were removed.

A number has changed from a to b if |b - a| > 2 sqrt(s_a^2 + s_b^2). Without a standard error in either report, it has
changed if the relative difference exceeds 1e-9. A number with another unit has changed, too. The exit code is always 0.
"""

import json
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from davinci_forces.runner.console import echo

if TYPE_CHECKING:
    from davinci_forces.report.changes import Change, StatedValue


def run(
    a: Annotated[Path, typer.Argument(help="A results.json, or a study, raw/<study>, that has one.")],
    b: Annotated[Path, typer.Argument(help="The results.json or study to compare with it.")],
    reports: Annotated[Path | None, typer.Option(help="Folder of reports, instead of reports/ next to raw/.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print rows of key, a, b, std and z as JSON.")] = False,
) -> None:
    """Print every number of B that differs from that of A, and the keys that only one of them has."""
    from davinci_forces.report.changes import changes
    from davinci_forces.runner import runs
    from davinci_forces.runner.results import stated

    files = runs.results_of(a, reports), runs.results_of(b, reports)
    before, after = (stated.read(file) for file in files)
    differing = changes(before, after)
    if as_json:
        echo(json.dumps([_row(change) for change in differing], indent=1, ensure_ascii=False, allow_nan=False))
        return
    for name, file, numbers in zip("ab", files, (before, after), strict=True):
        echo(f"{name}: {file}, {len(numbers)} numbers")
    echo("\n".join(_lines(differing, before, after)))


def _row(change: "Change") -> dict[str, Any]:
    """One change as JSON values: null for an absent number, text for NaN and infinity, which JSON does not have."""
    a, b = (_plain(number.value) if number else None for number in (change.before, change.after))
    return {"key": change.key, "a": a, "b": b, "std": _plain(change.std), "z": change.z}


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, float) and not isfinite(value) else value


def _lines(differing: list["Change"], before: dict[str, "StatedValue"], after: dict[str, "StatedValue"]) -> list[str]:
    """The comparison as lines of text."""
    changed = [change for change in differing if change.before and change.after]
    shared = [key for key in before if key in after]
    lines = [f"{len(changed)} of the {len(shared)} shared numbers changed"]
    if changed:
        lines += _table([("key", "a", "b", "std", "z"), *map(_cells, changed)])
        with_error = sum(before[key].std is not None or after[key].std is not None for key in shared)
        lines += [
            f"between independent recordings, about {0.05 * with_error:.0f} of the {with_error} numbers with a "
            "standard error would change by chance"
        ]
    removed, added = [c.key for c in differing if not c.after], [c.key for c in differing if not c.before]
    for verb, keys in (("removed", removed), ("added", added)):
        lines += [f"{len(keys)} {verb}:", *(f"  {key}" for key in keys)] if keys else []
    return lines


def _cells(change: "Change") -> tuple[str, ...]:
    assert change.before
    assert change.after
    return (change.key, *_pair(change.before, change.after), "" if change.std is None else f"{change.std:.2g}",
            "" if change.z is None else f"{change.z:+.1f}")  # fmt: skip


def _pair(a: "StatedValue", b: "StatedValue") -> tuple[str, str]:
    """Two values with their units, in at least 5 digits and as many as show the difference."""
    from davinci_forces.report.results import format_unit

    for digits in range(5, 18):
        texts = tuple(f"{x.value:.{digits}g}" if isinstance(x.value, float) else str(x.value) for x in (a, b))
        if texts[0] != texts[1]:
            break
    return f"{texts[0]} {format_unit(a.unit)}".rstrip(), f"{texts[1]} {format_unit(b.unit)}".rstrip()


def _table(rows: list[tuple[str, ...]]) -> list[str]:
    """Rows of a table, the first column aligned left and the others right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  "
        + "  ".join(c.rjust(w) if i else c.ljust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))).rstrip()
        for row in rows
    ]
