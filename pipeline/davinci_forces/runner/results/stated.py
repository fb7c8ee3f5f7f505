"""Read the numbers of a results.json of any study and version."""

import json
import math
from pathlib import Path
from typing import Any

from davinci_forces.errors import BadRequest
from davinci_forces.files import read_bytes
from davinci_forces.report.changes import StatedValue, Value


def read(file: Path) -> dict[str, StatedValue]:
    """Read the numbers of a results.json by key, in its order; raises BadRequest that names the first wrong number."""
    try:
        rows = json.loads(read_bytes(file))
    except OSError as error:
        raise BadRequest(f"{file}: {error.strerror}") from None
    except (ValueError, RecursionError) as error:
        raise BadRequest(f"{file} is no results.json: {error}") from None
    if not isinstance(rows, list):
        raise BadRequest(f"{file} is no results.json: it holds no list of numbers")
    numbers: dict[str, StatedValue] = {}
    for i, row in enumerate(rows, 1):
        key, problem = _problem(row)
        if key in numbers:
            problem = "the key appears twice"
        if problem:
            raise BadRequest(f"{file}: number {i}{f' ({key})' if key else ''}: {problem}")
        std = row.get("std")
        has_std = std is not None and not math.isnan(std)
        numbers[key] = StatedValue(row["value"], float(std) if has_std else None, row.get("unit") or "")
    return numbers


def robot_of(file: Path) -> str:
    """The robot that the summary.json beside a results.json names, or ""."""
    try:
        return str(json.loads(read_bytes(file.with_name("summary.json")))["robot"])
    except (OSError, ValueError, TypeError, LookupError):
        return ""


def _problem(row: Any) -> tuple[str, str]:
    """The key of a number, and what is wrong with it, or ""."""
    if not isinstance(row, dict) or not isinstance(row.get("key"), str):
        return "", 'it is not {"key": ..., "value": ..., "std": ...}'
    key: str = row["key"]
    if "value" not in row or not isinstance(row["value"], Value):
        return key, f"its value is {row.get('value')!r}, not a number"
    std, unit = row.get("std"), row.get("unit", "")
    if std is not None and (isinstance(std, bool) or not isinstance(std, int | float) or std < 0):
        return key, f"its std is {std!r}, neither null nor a number of at least 0"
    return key, "" if unit is None or isinstance(unit, str) else f"its unit is {unit!r}, not text"
