"""What a log is for, by words of its name and by how it moves."""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from davinci_forces.study.guessing import Holding

FREE = re.compile(r"no_?-?(weight|load|mass|contact)|unloaded|free", re.IGNORECASE)
HUNG = re.compile(r"weight|payload|(?<![a-z0-9])(\d+)(k?g)(?![a-z])", re.IGNORECASE)
TOUCHED = re.compile(r"contact|touch|push|collision", re.IGNORECASE)
HELD_OUT = re.compile(r"valid|(?<![a-z])test(?![a-z])", re.IGNORECASE)


class Role(NamedTuple):
    """A role, why it was chosen, and lines that say what else it could be."""

    role: str
    reason: str
    more: tuple[str, ...] = ()


def roles_of(names: Sequence[str], guesses: Sequence[Holding]) -> list[Role]:
    """The role of each log: by a word of its name, else by its motion among those of the others."""
    told = [_by_word(name) for name in names]
    repeating = [guess for guess, word in zip(guesses, told, strict=True) if not word and guess.repeats]
    covered = {joint for guess in repeating for joint in guess.moving}
    found = [word or _by_motion(guess, covered) for guess, word in zip(guesses, told, strict=True)]
    if any(role.role == "identification" for role in found) or not any(guess.moving for guess in guesses):
        return found
    return [*_one_identified(found, guesses)]


def _by_word(name: str) -> Role | None:
    if match := FREE.search(name):
        return Role("validation", f'"{match[0]}" in its name: free motion to judge by')
    if match := HUNG.search(name):
        mass = f"mass = {float(match[1]) * (1.0 if match[2].lower() == 'kg' else 1e-3):g}, " if match[1] else ""
        hint = f'# weight = {{ {mass}moves_with = "<joint>", position = [0.0, 0.0, 0.0] }}  # with role = "weight"'
        return Role("contact", f'"{match[0]}" in its name: "weight", where it is known what the mass hangs on', (hint,))
    if match := TOUCHED.search(name):
        return Role("contact", f'"{match[0]}" in its name')
    if match := HELD_OUT.search(name):
        return Role("validation", f'"{match[0]}" in its name')
    return None


def _by_motion(guess: Holding, covered: set[int]) -> Role:
    if guess.ranges and not guess.moving:
        return Role("contact", "no joint moves in it, so nothing can be identified from it")
    if guess.repeats:
        return Role("identification", "its motion repeats")
    if guess.steady and covered:
        return Role("friction", "its joint is held at velocity after velocity")
    if not covered:
        return Role("identification", "no log repeats")
    if new := set(guess.moving) - covered:
        which = ", ".join(str(joint + 1) for joint in sorted(new))
        return Role("identification", f"it moves joint {which}, which no log that repeats does")
    return Role("validation", "its motion does not repeat, and that of another log does")


def _one_identified(found: Sequence[Role], guesses: Sequence[Holding]) -> Iterator[Role]:
    """The same with the first log that moves as the one to identify from, as there is no other."""
    first = [bool(guess.moving) for guess in guesses].index(True)
    for i, role in enumerate(found):
        yield (
            Role("identification", f"{role.reason}; but there is no other log to identify from") if i == first else role
        )
