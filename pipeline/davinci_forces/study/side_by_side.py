"""Files that hold one signal each of the same recording: which belong together, and what each holds."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from davinci_forces.logs.joined import Joined
from davinci_forces.maths.signals import columns
from davinci_forces.study.guessing import SET, WORDS, Holding, Meaning, motion, samples_of

FORCE = ("force", "forces", "wrench", "ft", "m")  # files of recordings that hold no quantity of a joint


def grouped(files: Sequence[Path]) -> list[list[Path]]:
    """The files by the recording that they are of, in their order; alone where none shares the start of its name."""
    groups: dict[tuple[Path, str], list[Path]] = {}
    for file in files:
        start, signal = _split(file)
        groups.setdefault((file.parent, start if signal else file.name), []).append(file)
    together: list[list[Path]] = []
    for members in groups.values():
        symbols = {symbol_of(file.stem) for file in members}
        together += (
            [members] if len(members) > 1 and "q" in symbols and symbols & {"i", "tau"} else [[f] for f in members]
        )
    return sorted(together, key=lambda members: files.index(members[0]))


def symbol_of(stem: str) -> str:
    """The symbol that the signal in a file's name tells, or ""; what was only wanted tells none."""
    words = re.findall(r"[a-z]+", _split(Path(stem))[1].lower())
    return next((s for s, telling in WORDS.items() if words and words[0] in telling and not set(SET) & set(words)), "")


def start_of(file: Path) -> str:
    """What the names of files of one recording have in common."""
    return _split(file)[0]


def _split(file: Path) -> tuple[str, str]:
    """The start of a file's name, and the signal that it ends with: `run_`, `q_actual`."""
    name = file.name.partition(".")[0]
    known = {*FORCE, *(word for words in WORDS.values() for word in words)}
    for match in re.finditer(r"[_-]+", name):
        if name[match.end() :].lower().partition("_")[0] in known:
            return name[: match.start()], name[match.end() :]
    return name, ""


def guess_joined(log: Joined) -> Holding:
    """What the channels of joined files hold: joints in the order of columns, beside a time that rises throughout.

    Raises
    ------
    BadLog
        Where a file is damaged.
    """
    told: dict[str, Meaning] = {}
    samples = {}
    times = []
    for stem, part in log.parts.items():
        names = [c.name for c in part.channels if c.kind == "number" and not c.derived]
        values = samples_of(part, names)
        first = columns.rising([values[name] for name in names])
        times.append(first)
        left = [name for i, name in enumerate(names) if i != first]
        symbol = symbol_of(stem)
        if symbol and symbol not in {each.symbol for each in told.values()}:
            for k, name in enumerate(left):
                told[f"{stem}/{name}"] = Meaning(symbol, k, f"column {k + 1} of the signal that its file's name tells")
                samples[f"{stem}/{name}"] = values[name]
    joints = 1 + max((each.joint for each in told.values()), default=-1)
    found = Holding(told, joints)
    if len(set(times)) == 1 and times[0] is not None:
        found = replace(found, time=str(times[0]), why_time="a column that rises throughout in every file, in seconds")
    return motion(found, samples)
