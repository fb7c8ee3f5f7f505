"""Friction over velocity, measured and modelled, in both directions.  Fig 6.21"""

from collections.abc import Iterator

import numpy as np

from davinci_forces.records import FrictionMap
from davinci_forces.report.content import Figure, Panel
from davinci_forces.report.content.marks import Colour, Line, Points
from davinci_forces.report.context import Context, label, name_in_sentence, title

MAX_PANELS = 6  # maps in a figure
BRANCHES: tuple[tuple[int, str, Colour], ...] = ((1, "gaining speed", "blue"), (0, "losing speed", "vermillion"))


def friction_maps(context: Context, joint: str) -> Iterator[Figure]:
    """The effort minus a fit's other terms, over velocity, one panel a log and model."""
    maps = [m for m in context.catalogue.select(FrictionMap, joint=joint) if len(m)]
    if not maps:
        return
    shown = sorted(maps, key=lambda m: (m.role != "friction", m.model))[:MAX_PANELS]
    more = f" Of {len(maps)} maps, {len(shown)} are shown." if len(maps) > len(shown) else ""
    yield Figure(
        f"{title(joint)}: friction (the effort minus all other terms of the model) over velocity, while the joint "
        "gains speed and while it loses speed, and the model's friction. Points are means in bins of "
        "velocity, bars their standard deviations. If the two branches differ, friction depends on the past, or "
        f"changes more slowly than the sign of the velocity.{more}",
        f"Friction over velocity of {name_in_sentence(joint)}: {in_words(shown[0])}",
        tuple(panel(m) for m in shown),
        f"friction-{joint}",
        columns=2 if len(shown) > 1 else 1,
        height=48,
    )


def panel(m: FrictionMap) -> Panel:
    """One map."""
    branches = [(m.gaining == gaining, name, colour) for gaining, name, colour in BRANCHES]
    marks = [
        Points(m.dq[branch], m.tau_friction[branch], name, colour, y_std=m.tau_friction_std[branch])
        for branch, name, colour in branches
        if branch.any()
    ]
    velocity, friction = label(m, "dq", "velocity"), label(m, "tau_friction", "friction")
    return Panel(f"{m.log} ({m.model})", velocity, friction, (*marks, *curves(m)))


def curves(m: FrictionMap) -> Iterator[Line]:
    """The model's friction: one curve for both branches if it has no memory, else one curve for each."""
    branches = [np.flatnonzero(m.gaining == gaining) for gaining in (1, 0)]
    for rows in branches if m.model != "independent" else [np.arange(len(m))]:
        ordered = rows[np.argsort(m.dq[rows], kind="stable")]
        for side in (m.dq[ordered] < 0, m.dq[ordered] > 0):
            part = ordered[side]
            if len(part):
                is_first = part[0] == ordered[0] and (rows is branches[0] or m.model == "independent")
                yield Line(m.dq[part], m.tau_friction_hat[part], "model" if is_first else "", "black", "solid")


def in_words(m: FrictionMap) -> str:
    """State the mean friction in either direction."""
    sides = [float(m.tau_friction[side].mean()) if side.any() else 0.0 for side in (m.dq < 0, m.dq > 0)]
    return f"{sides[0]:.2g} on average backwards and {sides[1]:.2g} forwards."
