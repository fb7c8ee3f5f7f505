"""Compare the numbers of two reports: what changed, what came and what went.

A number b has changed from a where |b - a| > 2 sqrt(s_a^2 + s_b^2), or, where neither states a standard error, by more
than 1e-9 of it; and where its unit has. The exit code is 0 whether anything changed or not.
"""

import json
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from davinci_forces.runner.console import echo

if TYPE_CHECKING:
    from davinci_forces.report.changes import Change, Stated


def run(
    a: Annotated[Path, typer.Argument(help="A results.json, or a study, raw/<study>, that has one.")],
    b: Annotated[Path, typer.Argument(help="The one that is compared with it.")],
    reports: Annotated[Path | None, typer.Option(help="Folder for reports, where not beside raw/.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print rows of key, a, b, std and z as JSON.")] = False,
) -> None:
    """Name every number of B that is not that of A, and the keys that only one of them has."""
    from davinci_forces.report.changes import changes
    from davinci_forces.runner import runs
    from davinci_forces.runner.results import stated

    files = runs.results_of(a, reports), runs.results_of(b, reports)
    before, after = (stated.read(file) for file in files)
    found = changes(before, after)
    if as_json:
        echo(json.dumps([_row(each) for each in found], indent=1, ensure_ascii=False, allow_nan=False))
        return
    for name, file, numbers in zip("ab", files, (before, after), strict=True):
        echo(f"{name}: {file}, {len(numbers)} numbers")
    echo("\n".join(_lines(found, before, after)))


def _row(each: "Change") -> dict[str, Any]:
    """A difference for a program: null where there is nothing; what is not finite in words, as JSON has none of it."""
    a, b = (_plain(one.value) if one else None for one in (each.before, each.after))
    return {"key": each.key, "a": a, "b": b, "std": _plain(each.std), "z": each.z}


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, float) and not isfinite(value) else value


def _lines(found: list["Change"], before: dict[str, "Stated"], after: dict[str, "Stated"]) -> list[str]:
    """What there is to say, for people."""
    both = [each for each in found if each.before and each.after]
    shared = [key for key in before if key in after]
    lines = [f"{len(both)} of the {len(shared)} numbers that both have changed"]
    if both:
        lines += _table([("key", "a", "b", "std", "z"), *map(_cells, both)])
        erring = sum(before[key].std is not None or after[key].std is not None for key in shared)
        lines += [
            f"of recordings that share nothing, about {0.05 * erring:.0f} of the {erring} numbers with a standard "
            "error would change by chance"
        ]
    for what, keys in (
        ("went", [d.key for d in found if not d.after]),
        ("came", [d.key for d in found if not d.before]),
    ):
        lines += [f"{len(keys)} {what}:", *(f"  {key}" for key in keys)] if keys else []
    return lines


def _cells(each: "Change") -> tuple[str, ...]:
    assert each.before
    assert each.after
    return (each.key, *_pair(each.before, each.after), "" if each.std is None else f"{each.std:.2g}",
            "" if each.z is None else f"{each.z:+.1f}")  # fmt: skip


def _pair(a: "Stated", b: "Stated") -> tuple[str, str]:
    """Two values with their units, in as many digits as tell them apart, at least 5."""
    from davinci_forces.report.results import format_unit

    for digits in range(5, 18):
        texts = tuple(f"{one.value:.{digits}g}" if isinstance(one.value, float) else str(one.value) for one in (a, b))
        if texts[0] != texts[1]:
            break
    return f"{texts[0]} {format_unit(a.unit)}".rstrip(), f"{texts[1]} {format_unit(b.unit)}".rstrip()


def _table(rows: list[tuple[str, ...]]) -> list[str]:
    """Rows below each other, the keys to the left and all else to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  "
        + "  ".join(c.rjust(w) if i else c.ljust(w) for i, (c, w) in enumerate(zip(row, widths, strict=True))).rstrip()
        for row in rows
    ]
