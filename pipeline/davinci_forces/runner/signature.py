"""Read from the signatures of a stage's functions which records its steps read and make."""

import ast
import re
import types
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from davinci_forces.logs.log import Log
from davinci_forces.records import KINDS, Record
from davinci_forces.robots.robot import Joint, Robot
from davinci_forces.stages import module
from davinci_forces.study import HapticScenario, LogEntry, Settings, Weighings

FUNCTIONS = ("run", "gather", "apply")  # functions that a stage may export, in the order of their steps
FUNCTION = re.compile(r"^def (\w+)\(", re.MULTILINE)
Kinds = tuple[type[Record], ...]
ARGUMENT_KINDS = {
    Log: "log", LogEntry: "entry", Joint: "joint", Robot: "robot", Weighings: "weighings", HapticScenario: "haptics",
}  # fmt: skip
SETTINGS = tuple(f.name for f in fields(Settings))
GENERIC = (Collection, Iterable, Iterator, Sequence)
TYPES = KINDS | {kind.__name__: kind for kind in (*GENERIC, *ARGUMENT_KINDS)} | {"Annotated": Annotated}


@dataclass(frozen=True)
class Declaration:
    """What a step reads, by parameter, and the kinds of record that it makes."""

    name: str  # of the step
    each: dict[str, Kinds]  # called once for each record of these kinds
    per_log: dict[str, Kinds]  # called once a log, with all its records of these kinds
    in_turn: set[str]  # parameters of `per_log` whose records are read one by one
    optional: dict[str, Kinds]  # the record about the same log and joint, or None
    every: dict[str, Kinds]  # all records about the same log and joint
    given: dict[str, str]  # parameter -> "log", "entry", "joint", "robot", "weighings" or "haptics"
    roles: dict[str, str]  # parameter -> role of the logs whose records it takes, if not of all logs
    settings: tuple[str, ...]
    makes: Kinds

    @property
    def reads(self) -> Kinds:
        """The kinds of record that must exist before the step runs."""
        groups = (self.each, self.per_log, self.optional, self.every)
        return tuple(dict.fromkeys(kind for group in groups for kinds in group.values() for kind in kinds))


@cache
def steps(stage: str) -> tuple[str, ...]:
    """The steps of a stage, one for each function that it exports: "tune" for `run`, "tune.gather", "tune.apply".

    They are read from the text of its module, since importing all stages takes longer than reading a log.
    """
    exported = set(FUNCTION.findall(_source(stage)))
    return tuple(stage if name == "run" else f"{stage}.{name}" for name in FUNCTIONS if name in exported)


def stage_of(step: str) -> str:
    """The stage of a step; the report is its own stage."""
    return step.partition(".")[0]


def function_of(step: str) -> Callable[..., Iterator[Record]]:
    """The function of a step."""
    stage, _, name = step.partition(".")
    function: Callable[..., Iterator[Record]] = getattr(import_module(module(stage)), name or "run")
    return function


@cache
def declaration(step: str) -> Declaration:
    """Read the signature of a step."""
    settings, hints = _signature(step)
    declared = Declaration(step, {}, {}, set(), {}, {}, {}, {}, settings, _kinds(*get_args(hints.pop("return"))))
    for parameter, hint in hints.items():
        if get_origin(hint) is Annotated:
            hint, declared.roles[parameter] = get_args(hint)
            declared.in_turn.add(parameter)
        if hint in ARGUMENT_KINDS:
            declared.given[parameter] = ARGUMENT_KINDS[hint]
        elif get_origin(hint) in (Sequence, Collection):
            declared.per_log[parameter] = _kinds(*get_args(hint))
            if get_origin(hint) is Collection:
                declared.in_turn.add(parameter)
        elif get_origin(hint) is Iterable:
            declared.every[parameter] = _kinds(*get_args(hint))
        elif type(None) in get_args(hint):
            declared.optional[parameter] = _kinds(hint)
        else:
            declared.each[parameter] = _kinds(hint)
    return declared


def _signature(step: str) -> tuple[tuple[str, ...], dict[str, Any]]:
    """The settings that a step takes, and the types of its parameters and result, from the text of its signature."""
    stage, _, name = step.partition(".")
    signature = re.search(rf"^def {name or 'run'}\(.*?:$", _source(stage), re.MULTILINE | re.DOTALL)
    [function] = ast.parse(f"{signature and signature[0]} ...").body
    assert isinstance(function, ast.FunctionDef)
    settings = tuple(argument.arg for argument in function.args.kwonlyargs)
    if unknown := sorted(set(settings) - set(SETTINGS)):
        raise TypeError(f"{step} takes settings that do not exist: {', '.join(unknown)}")
    hints = {a.arg: a.annotation for a in function.args.args} | {"return": function.returns}
    return settings, {name: eval(ast.unparse(hint), TYPES) for name, hint in hints.items() if hint}


def _source(stage: str) -> str:
    spec = find_spec(module(stage))
    return Path(str(spec and spec.origin)).read_text(encoding="utf-8")


def _kinds(hint: Any) -> Kinds:
    members = get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    return tuple(kind for kind in members if isinstance(kind, type) and issubclass(kind, Record))
