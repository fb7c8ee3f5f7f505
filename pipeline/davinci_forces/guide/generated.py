"""Pages of the reference that are made from code when they are asked for: fields of records, Python, and robots."""

import ast
import inspect
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from textwrap import dedent
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from davinci_forces.maths.models.terms import Term


def fields() -> str:
    """Every record with its fields, their units and meanings."""
    from davinci_forces.records import KINDS
    from davinci_forces.records.quantities import PER_ROW, QUANTITIES
    from davinci_forces.robots import load

    joints = {joint.kind: joint for joint in load("davinci", Path()).joints}  # one that turns, and one that slides
    words = {"": "–", "1": "–", PER_ROW: "by row"}
    blocks = []
    for kind in KINDS.values():
        rows = []
        for name in (*kind.scalars(), *kind.columns()):
            quantity = QUANTITIES[name]
            unit = " or ".join(dict.fromkeys(joint.unit(quantity.unit) for joint in joints.values()))
            unit = words.get(quantity.unit, unit)
            rows.append((f"`{name}`", "column" if name in kind.columns() else "single", unit, quantity.meaning))
        about = first_sentence(inspect.getdoc(kind))
        blocks += [f"## {kind.__name__}", about, table(("field", "holds", "unit", "is"), rows)]
    return "\n\n".join(blocks)


def python() -> str:
    """Every public name of the package, with its signature and docstring."""
    import davinci_forces
    from davinci_forces import arrays
    from davinci_forces.arrays.effort import ExternalEffort
    from davinci_forces.filters.online import OnlineEffort, Stream
    from davinci_forces.robots.robot import Robot

    blocks: list[str] = []
    for name in davinci_forces.__all__:
        blocks += document_function(f"davinci_forces.{name}", getattr(davinci_forces, name))
    for kind in (arrays.IdentifiedArm, ExternalEffort, Stream, OnlineEffort, Robot):
        blocks += [f"## {kind.__name__}", inspect.getdoc(kind) or ""]
        public = {
            name: member for name, member in vars(kind).items() if not name.startswith("_") and inspect.getdoc(member)
        }
        values = [
            f"- `{name}`: {first_sentence(of.__doc__)}" for name, of in public.items() if isinstance(of, property)
        ]
        blocks += ["\n".join(values)] * bool(values)
        for name, member in public.items():
            if inspect.isfunction(member):
                blocks += document_function(f"{kind.__name__}.{name}", member, level=3)
    return "\n\n".join(blocks)


def robots() -> str:
    """Every shipped robot with its joints, their limits and the terms of their models."""
    from davinci_forces.maths.constants import GRAVITY
    from davinci_forces.maths.models.terms import TERMS
    from davinci_forces.robots import ROBOTS, load

    blocks = []
    for name in ROBOTS:
        robot = load(name, Path())
        rows = [
            (f"`{joint.name}`", joint.kind.name.lower(), " to ".join(f"{q:g}" for q in joint.limits.q),
             ", ".join(term.name for term in joint.terms))
            for joint in robot.joints
        ]  # fmt: skip
        title = f"{robot.title}: {len(robot.joints)} joints."
        blocks += [f"## {name}", title, table(("joint", "kind", "limits [rad or m]", "terms of its own model"), rows)]
    about = f"Its effort is the parameter times the factor; g = {GRAVITY:g} m/s^2. Lifted mass: positive is downwards."
    own = [(f"`{name}`", factor(term)) for name, term in TERMS.items()]
    return "\n\n".join([*blocks, "## terms of a joint", about, table(("term", "factor"), own)])


def factor(term: "Term") -> str:
    """What a term multiplies its parameter by, in words of code."""
    parts = ["ddq"] * bool(term.a) + [name if c == 1.0 else f"{'-' * (c < 0)}g {name}" for name, c in term.b.items()]
    return " + ".join(parts).replace("+ -", "- ").replace("g 1", "g")


PAGES = {  # topic -> title, summary and body
    "fields": ("Fields of records", "Every field of every record, with its unit and meaning.", fields),
    "api": ("Python names", "Every public function and class, with its signature, units and errors.", python),
    "robots": ("Robots", "The robots that are shipped, with their joints.", robots),
}


def document_function(name: str, what: Callable[..., object], level: int = 2) -> Iterator[str]:
    """A function as a heading, its signature, and its docstring."""
    yield f"{'#' * level} {name}"
    yield f"```text\n{name}{signature(what)}\n\n{inspect.getdoc(what)}\n```"


def signature(function: Callable[..., object]) -> str:
    """Parameters and result with their types as the source states them: some fill a page once they are evaluated."""
    [definition] = ast.parse(dedent(inspect.getsource(function))).body
    assert isinstance(definition, ast.FunctionDef)
    arguments = definition.args
    arguments.args = [one for one in arguments.args if one.arg != "self"]
    return f"({ast.unparse(arguments)})" + (f" -> {ast.unparse(definition.returns)}" if definition.returns else "")


def first_sentence(doc: str | None) -> str:
    """The first paragraph of a docstring on one line."""
    return " ".join((doc or "").partition("\n\n")[0].split())


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table of Markdown."""
    lines = [header, ["---"] * len(header), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
