"""Names of channels: unique within a log, and the units that people write into them."""

import re
from collections.abc import Iterable, Sequence

# What a terminal or a page would obey or hide instead of showing it.
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]")
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


def visible(text: str) -> str:
    """Text of a log with its control characters written out, as in `\\x1b`, for people to read."""
    return CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def renamed(written: Sequence[str], names: Sequence[str]) -> list[str]:
    """What to say of channels that had to be renamed, because they are called like another."""
    return [
        f"column {i} is called {own!r} like another; it is read as {name!r}"
        for i, (own, name) in enumerate(zip(written, names, strict=True))
        if own and own != name
    ]
