"""What a simulated study pushed, and the force at the tip compared with it: a part of the section on ground truth."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from davinci_forces.records import TipContact, TipForce
from davinci_forces.report.content import Block, Cell, Figure, Level, Line, OnScreen, Panel, Table, Verdict, literal
from davinci_forces.report.content.number import MINUS
from davinci_forces.report.context import Context, count, label
from davinci_forces.report.verdicts import NORMAL_95, WITHIN

SHAPES = {"triangle": ((0.0, 0.0), (0.5, 1.0), (1.0, 0.0)), "pulse": ((0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0))}
COMPONENTS = ("f_x", "f_y", "f_z")
Push = dict[str, Any]


def true_effort(pushes: list[dict[str, Any]], end: float) -> tuple[Any, Any]:
    """Times [s] and values (n,) of the corners of the effort that was exerted."""
    corners = [(0.0, 0.0)]
    for push in sorted(pushes, key=lambda p: float(p["start"])):
        span = push["end"] - push["start"]
        corners += [(push["start"] + x * span, y * push["peak"]) for x, y in SHAPES[push["shape"]]]
    corners.append((end, 0.0))
    return np.array([x for x, _ in corners]), np.array([y for _, y in corners])


def tip_forces(context: Context) -> Iterator[Block]:
    """The force at the tip, found and true; nothing of a study in which nothing pushed the tip."""
    pushed = {log["name"]: pushes for log in context.study.truth.get("log", []) if (pushes := at_the_tip(log))}
    found = [(contact, pushed[contact.log]) for contact in context.catalogue.all(TipContact) if contact.log in pushed]
    pairs = [
        (contact, i, push)
        for contact, pushes in found for i in range(len(contact)) for push in pushes if meet(contact, i, push)
    ]  # fmt: skip
    if pairs:
        yield compared(context, pairs)
        yield judged([size for pair in pairs for size in off(*pair)])
    forces = [force for force in context.catalogue.all(TipForce) if force.log in pushed]
    figures = [force_figure(force, pushed[force.log]) for force in forces]
    yield from figures[:1]
    if figures[1:]:
        yield OnScreen("Force at the tip, found and true, in other logs", "more-tip-truth", tuple(figures[1:]))


def at_the_tip(log: dict[str, Any]) -> list[Push]:
    """The pushes at the tip in one log, which have a direction."""
    return [push for push in log.get("push", []) if "direction" in push]


def meet(contact: TipContact, i: int, push: Push) -> bool:
    """Whether a contact and a push are at the same time."""
    return bool(contact.onset[i] < push["end"] and contact.release[i] > push["start"])


def force_of(push: Push) -> list[float]:
    """The components of a push where it is largest [N]."""
    return [push["peak"] * part for part in push["direction"]]


def off(contact: TipContact, i: int, push: Push) -> list[float]:
    """By how many of its standard deviations each component is off."""
    names = zip(COMPONENTS, force_of(push), strict=True)
    return [abs(float(getattr(contact, f)[i]) - true) / float(getattr(contact, f"{f}_std")[i]) for f, true in names]


def compared(context: Context, pairs: list[tuple[TipContact, int, Push]]) -> Table:
    """One row a push."""
    rows: list[tuple[Cell, ...]] = []
    for contact, i, push in pairs:
        true = (f"{x:.3g}".replace("-", MINUS) for x in force_of(push))
        numbers = (context.number(f"tip.{contact.log}.{i + 1}.{f}", 3) for f in COMPONENTS)
        rows.append((literal(contact.log), str(i + 1), *true, *numbers, f"{max(off(contact, i, push)):.1f}"))
    return Table(
        "The force at the tip where it is largest in each contact [N], true and found, and by how many of its standard "
        "deviations the worst component is off. The true one is the largest of the push, at its own time.",
        ("Log", "Contact", *(f"true ${f}$" for f in COMPONENTS), *(f"${f}$" for f in COMPONENTS), "Off"),
        tuple(rows),
        "tip-truth",
        "llrrrrrrr",
    )


def judged(errors: list[float]) -> Verdict:
    """Whether the stated deviations are what the errors are."""
    inside = sum(error <= NORMAL_95 for error in errors)
    said = f"{inside} of {count(len(errors), 'component')} lie within their 95 % interval"
    level: Level = "good" if max(errors) < WITHIN else "bad"
    return Verdict(level, f"**Force at the tip**: {said}; the worst is {max(errors):.1f} standard deviations off.")


def force_figure(force: TipForce, pushes: list[Push]) -> Figure:
    """The components of the force, found and true."""
    panels = []
    for k, name in enumerate(COMPONENTS):
        along = [push | {"peak": force_of(push)[k]} for push in pushes]
        t, true = true_effort(along, float(force.t[-1]))
        marks = (Line(force.t, getattr(force, name), "found", "vermillion"), Line(t, true, "true", "black"))
        panels.append(Panel(f"Along {name[-1]}0", "time [s]", label(force, name, "force"), marks))
    return Figure(
        f"{literal(force.log)}: force at the tip, found and true.",
        f"Components of the force at the tip over time in {literal(force.log)}, found and true.",
        tuple(panels),
        columns=3,
        height=42,
    )
