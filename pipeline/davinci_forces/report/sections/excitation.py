"""Excitation trajectories: published ones, and those designed here within the joints' limits."""

from collections.abc import Iterator

from davinci_forces.records import Excitation
from davinci_forces.report.content import Block, Figure, HLine, Line, Panel, Prose, Section, Table, Verdict, literal
from davinci_forces.report.context import Context, label, title

SOURCES = {"table-6.1": "published", "table-6.1-corrected": "published, corrected", "found": "designed here"}


def section(context: Context) -> Section | None:
    """Objectives and limits of every trajectory."""
    excitations = context.catalogue.records(Excitation)
    return Section("Excitation", "excitation", tuple(blocks(context, excitations))) if excitations else None


def blocks(context: Context, excitations: list[Excitation]) -> Iterator[Block]:
    """The section's content.  Fig 6.5, Table 6.1"""
    yield Prose(
        "The smaller the objective $-log_10 det(F^T F)$ over 300 samples of a period, the better a trajectory "
        "separates the parameters. Position, velocity and acceleration must keep their limits at every instant, so the "
        "extremes are computed, not sampled. Trajectories designed here are the best of several searches without "
        "limits: the harmonics are scaled until they reach a limit; the mean may lie anywhere in the remaining range."
        + (" The published ones are those of the thesis's Table 6.1." if context.compares_with_thesis else "")
    )
    yield Table(
        "Objective and condition number of published trajectories and of trajectories designed here, and the excess of "
        "each over its position limits.",
        ("Joint", "Trajectory", "Objective", "Condition", "Beyond limits"),
        tuple(
            (
                title(e.joint),
                source_label(e),
                *context.numbers(f"excitation.{e.joint}.{e.source}", ("objective", "condition"), 5),
                context.number(f"excitation.{e.joint}.{e.source}.excess_q", 2),
            )
            for e in excitations
        ),
        "excitation-table",
        "llrrr",
    )
    for e in excitations:
        if max(e.excess_q, e.excess_dq, e.excess_ddq) > 0:
            excess = context.results[f"excitation.{e.joint}.{e.source}.excess_q"].number(2)
            yield Verdict("warn", f"**{title(e.joint)}**, {source_label(e)}: exceeds its position limits by {excess}.")
    yield coefficients(context, excitations)
    for joint in dict.fromkeys(e.joint for e in excitations):
        yield figure(context, [e for e in excitations if e.joint == joint])


def source_label(e: Excitation) -> str:
    """The source of a trajectory."""
    return SOURCES.get(e.source, literal(e.source))


def coefficients(context: Context, excitations: list[Excitation]) -> Table:
    """The Fourier coefficients of every trajectory."""
    names = ("a0", "a1", "b1", "a2", "b2")
    rows = tuple(
        (title(e.joint), source_label(e), *context.numbers(f"excitation.{e.joint}.{e.source}", names, 4))
        for e in excitations
    )
    header = ("Joint", "Trajectory", *(f"${name[0]}_{name[1]}$" for name in names))
    return Table("Coefficients of the Fourier series.", header, rows, align="llrrrrr")


def figure(context: Context, trajectories: list[Excitation]) -> Figure:
    """One period of each trajectory of a joint, within its limits."""
    first = trajectories[0]
    limits = context.study.robot.joint(first.joint).limits
    panels = []
    for symbol, meaning in (("q", "position"), ("dq", "velocity"), ("ddq", "acceleration")):
        named = symbol == "q"  # once is enough: the colours are the same in every panel
        lines = [Line(e.t, getattr(e, symbol), source_label(e) if named else "") for e in trajectories]
        bounds = [HLine(bound, "limits" if named and i == 0 else "") for i, bound in enumerate(getattr(limits, symbol))]
        panels.append(Panel(meaning.capitalize(), "time [s]", label(first, symbol, meaning), (*lines, *bounds)))
    return Figure(
        f"{title(first.joint)}: one period of the published trajectories and of the designed one, with the limits.",
        f"Position, velocity and acceleration over a period of the {title(first.joint)} trajectories.",
        tuple(panels),
        columns=3,
        height=55,
    )
