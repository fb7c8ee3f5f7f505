"""Names of channels: unique within a log, and the units that people write into them."""

import re
from collections.abc import Iterable, Sequence

IN_BRACKETS = re.compile(r".*\S\s*[\[(]\s*([^\[\]()]*?)\s*[\])]\s*")


def unique(names: Sequence[str], taken: Iterable[str] = ()) -> tuple[str, ...]:
    """The names with `_1`, `_2` ... after those that came before, and `column_<number>` for empty ones."""
    seen: dict[str, None] = dict.fromkeys(taken)
    for column, name in enumerate(names):
        name = name or f"column_{column}"
        free, number = name, 0
        while free in seen:
            number += 1
            free = f"{name}_{number}"
        seen[free] = None
    return tuple(seen)[len(seen) - len(names) :]


def unit_in(name: str) -> str:
    """The unit of a name such as `q [rad]` or `q (rad)`, else ""."""
    unit = IN_BRACKETS.fullmatch(name)
    return unit.group(1) if unit else ""
