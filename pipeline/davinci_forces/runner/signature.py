"""What a stage asks for and promises, read from the signature of its `run`."""

import types
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cache
from importlib import import_module
from inspect import Parameter, signature
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from davinci_forces.logs.log import Log
from davinci_forces.records import Record
from davinci_forces.robots.robot import Joint, Robot
from davinci_forces.study import HapticScenario, LogEntry, Settings, Weighings

Kinds = tuple[type[Record], ...]
GIVEN = {
    Log: "log", LogEntry: "entry", Joint: "joint", Robot: "robot", Weighings: "weighings", HapticScenario: "haptics",
}  # fmt: skip
SETTINGS = tuple(f.name for f in fields(Settings))


@dataclass(frozen=True)
class Declaration:
    """What a stage reads, by parameter, and what it makes."""

    name: str
    each: dict[str, Kinds]  # called once for each record of these kinds
    per_log: dict[str, Kinds]  # called once a log, with all its records of these kinds
    in_turn: set[str]  # those of these parameters whose records are read when the stage comes to them
    optional: dict[str, Kinds]  # the record about the same, or None
    every: dict[str, Kinds]  # all records about the same
    given: dict[str, str]  # parameter -> "log", "entry", "joint", "robot", "weighings" or "haptics"
    roles: dict[str, str]  # parameter -> role of the logs whose records it holds, where not of all
    settings: tuple[str, ...]
    makes: Kinds

    @property
    def reads(self) -> Kinds:
        """The kinds of record that must exist before the stage runs."""
        groups = (self.each, self.per_log, self.optional, self.every)
        return tuple(dict.fromkeys(kind for group in groups for kinds in group.values() for kind in kinds))


@cache
def declaration(name: str) -> Declaration:
    """Read the signature of a stage."""
    run = import_module(f"davinci_forces.stages.{name}").run
    hints = get_type_hints(run, include_extras=True)
    makes = _kinds(_inner(hints.pop("return")))
    declared = Declaration(name, {}, {}, set(), {}, {}, {}, {}, _settings(name, run), makes)
    for parameter, hint in hints.items():
        if parameter in declared.settings:
            continue
        if get_origin(hint) is Annotated:
            hint, declared.roles[parameter] = get_args(hint)
        if hint in GIVEN:
            declared.given[parameter] = GIVEN[hint]
        elif get_origin(hint) in (Sequence, Collection):
            declared.per_log[parameter] = _kinds(_inner(hint))
            if get_origin(hint) is Collection:
                declared.in_turn.add(parameter)
        elif get_origin(hint) is Iterable:
            declared.every[parameter] = _kinds(_inner(hint))
        elif type(None) in get_args(hint):
            declared.optional[parameter] = _kinds(hint)
        else:
            declared.each[parameter] = _kinds(hint)
    return declared


def _settings(name: str, run: Any) -> tuple[str, ...]:
    asked = [p.name for p in signature(run).parameters.values() if p.kind is Parameter.KEYWORD_ONLY]
    unknown = sorted(set(asked) - set(SETTINGS))
    if unknown:
        raise TypeError(f"stage {name} asks for settings that do not exist: {', '.join(unknown)}")
    return tuple(asked)


def _inner(hint: Any) -> Any:
    return get_args(hint)[0] if get_origin(hint) in (Collection, Iterable, Iterator, Sequence) else hint


def _kinds(hint: Any) -> Kinds:
    members = get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    return tuple(kind for kind in members if isinstance(kind, type) and issubclass(kind, Record))
