"""Excitation trajectories: published ones, and those designed here within the joints' limits."""

from collections.abc import Iterator

from davinci_forces.records import Excitation
from davinci_forces.report.content import Block, Figure, Panel, Prose, Table, Verdict, literal
from davinci_forces.report.content.marks import HLine, Line
from davinci_forces.report.context import Context, label, title
from davinci_forces.report.sections.parts import explanation, section_of

SOURCES = {"table-6.1": "published", "table-6.1-corrected": "published, corrected", "found": "designed here"}
MOTION = {"q": "position", "dq": "velocity", "ddq": "acceleration"}


@section_of("Excitation", "excitation", Excitation)
def section(context: Context, excitations: list[Excitation]) -> Iterator[Block]:
    """Objectives and limits of every trajectory.  Fig 6.5, Table 6.1"""
    published = " The published ones are those of the thesis's Table 6.1." * context.compares_with_thesis
    yield Prose(explanation("excitation") + published)
    rows, names = [], ("a0", "a1", "b1", "a2", "b2")
    for e in excitations:
        key = f"excitation.{e.joint}.{e.source}"
        scores = *context.numbers(key, ("objective", "condition"), 5), context.number(f"{key}.excess_q", 2)
        rows.append((title(e.joint), source_label(e), *scores, *context.numbers(key, names, 4)))
    symbols = (f"${name[0]}_{name[1]}$" for name in names)
    header = ("Joint", "Trajectory", "Objective", "Condition", "Beyond limits", *symbols)
    yield Table(explanation("excitation-table"), header, tuple(rows), "excitation-table", "llrrrrrrrr")
    for e in excitations:
        for symbol, meaning in MOTION.items():
            if getattr(e, f"excess_{symbol}") > 0:
                excess = context.results[f"excitation.{e.joint}.{e.source}.excess_{symbol}"].number(2)
                about = f"**{title(e.joint)}**, {source_label(e)}"
                yield Verdict("warn", f"{about}: exceeds its {meaning} limits by {excess}.")
    for joint in dict.fromkeys(e.joint for e in excitations):
        yield figure(context, [e for e in excitations if e.joint == joint])


def source_label(e: Excitation) -> str:
    """The source of a trajectory."""
    return SOURCES.get(e.source, literal(e.source))


def figure(context: Context, trajectories: list[Excitation]) -> Figure:
    """One period of each trajectory of a joint, within its limits."""
    first = trajectories[0]
    limits, name = context.study.robot.joint(first.joint).limits, title(first.joint)
    panels = []
    for symbol, meaning in MOTION.items():
        named = symbol == "q"  # once is enough: the colours are the same in every panel
        lines = [Line(e.t, getattr(e, symbol), source_label(e) if named else "") for e in trajectories]
        bounds = [HLine(bound, "limits" if named and i == 0 else "") for i, bound in enumerate(getattr(limits, symbol))]
        panels.append(Panel(meaning.capitalize(), "time [s]", label(first, symbol, meaning), (*lines, *bounds)))
    caption = f"{name}: one period of the published trajectories and of the designed one, with the limits."
    alt = f"Position, velocity and acceleration over a period of the {name} trajectories."
    return Figure(caption, alt, tuple(panels), columns=3, height=55)
