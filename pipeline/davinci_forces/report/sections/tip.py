"""The force at the tip: over time, along the path, in every contact, and how large it looks in free space."""

from collections.abc import Iterator, Sequence

import numpy as np

from davinci_forces.maths.arrays import evenly
from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records import Column, TipBudget, TipContact, TipForce
from davinci_forces.records.record import as_list
from davinci_forces.report.content import Block, Equation, Figure, Figure3D, OnScreen, Panel, Prose, Table, Verdict
from davinci_forces.report.content.inline import literal
from davinci_forces.report.content.marks import AnyMark, Band, Colour, Line, Line3D, Points3D
from davinci_forces.report.content.number import Number, in_format
from davinci_forces.report.context import Context, label, name_in_sentence
from davinci_forces.report.sections.parts import F, converged_rows, explanation, section_of, spans, strokes
from davinci_forces.report.verdicts import NEAR_SINGULAR, band, percent

PATH_POINTS = 600  # points drawn of the path in space
REACH = 0.5  # drawn length of the largest force over the extent of the path


@section_of("Force at the tip", "tip", TipForce)
def section(context: Context, forces: list[TipForce]) -> Iterator[Block]:
    """The force at the tip of every log in which all joints that carry it move."""
    tool = context.study.robot.tool
    shaft = f" The shaft of the tool is taken to be {Number(tool.length, 'm')} long." if tool else ""
    yield Prose(explanation("tip", shaft=shaft))
    yield Equation(
        'f = bold(J)_v^(-T) tau_"ext", quad C_f = bold(J)_v^(-T) C_tau bold(J)_v^(-1)',
        "force is the inverse of the transposed Jacobian times external effort; its covariance follows from that of "
        "the efforts",
        "tip-force",
    )
    yield Prose(correlations(forces))
    contacts = context.catalogue.records(TipContact)
    if contacts:
        yield contact_table(context, contacts)
    yield level_table(context, forces)
    for force in forces:
        if band(force.force_coverage) == "bad":
            covers = f"it covers {percent(force.force_coverage)} of samples in free space"
            text = f"**{literal(force.log)}**: the 95 % band of the force is too narrow: {covers}. "
            yield Verdict("bad", f"{text}Trust the detection level rather than the standard deviations.")
    touched = {contact.log for contact in contacts}
    # With contact first, then those not fitted, then by the detection level.
    levels = {f.log: (f.log in touched, f.role != "identification", np.nan_to_num(f.force_detection)) for f in forces}
    first, *others = sorted(forces, key=lambda force: levels[force.log], reverse=True)
    yield from log_blocks(context, first)
    for force in others:
        inside = tuple(log_blocks(context, force))
        yield OnScreen(f"Force at the tip in {literal(force.log)}", f"tip-{force.log}", inside)


def correlations(forces: Sequence[TipForce]) -> str:
    """State the assumed correlation of the joints' errors."""
    correlated = [force for force in forces if force.correlation_from]
    if not correlated:
        return explanation("tip-independent")
    largest = max(max(abs(f.rho_12), abs(f.rho_13), abs(f.rho_23)) for f in correlated)
    return explanation("tip-correlated", largest=f"{largest:.2f}")


def contact_table(context: Context, contacts: Sequence[TipContact]) -> Table:
    """The largest force of every contact, component by component."""
    rows = []
    for contact in contacts:
        for i in range(len(contact)):
            prefix = f"tip.{contact.log}.{i + 1}"
            weak = ", ".join(in_format(x[i], ".1f") for x in (contact.weak_x, contact.weak_y, contact.weak_z))
            remark = ("" if contact.stated[i] else ", found") + (", near singular" if contact.near_singular[i] else "")
            window = f"{contact.onset[i]:.4g} to {contact.release[i]:.4g} s{remark}"
            numbers = *context.numbers(prefix, (*F, "peak", "middle_mean")), context.number(f"{prefix}.sigma_1", 2)
            rows.append((literal(contact.log), window, *numbers, f"({weak})"))
    header = ("Log", "Window", "$f_x$", "$f_y$", "$f_z$", "$abs(f)$", "Middle half", "Largest std", "Direction")
    return Table(explanation("tip-contacts"), header, rows, "tip-contacts", "llrrrrrrl")


def level_table(context: Context, forces: Sequence[TipForce]) -> Table:
    """The force that is estimated in free space, and the condition of the poses."""
    names = ("free_rms", "free_level", "detection_level", "coverage", "condition", "near_singular")
    rows = tuple((literal(force.log), force.role, *context.numbers(f"tip.{force.log}", names)) for force in forces)
    header = ("Log", "Role", "RMS", "95 %", "Detection level", "Coverage", "Condition", "Near singular")
    return Table(explanation("tip-levels", limit=NEAR_SINGULAR), header, rows, "tip-levels", "llrrrrrr")


def log_blocks(context: Context, force: TipForce) -> Iterator[Block]:
    """The figures of one log."""
    name, contacts = literal(force.log), context.catalogue.select(TipContact, log=force.log)
    caption = explanation("tip-time", log=name, shaded=" Windows of contact are shaded." * bool(contacts))
    alt = f"Components of the force at the tip over time in {name}."
    panels = tuple(component_panel(force, axis, contacts) for axis in "xyz")
    yield Figure(caption, alt, panels, f"tip-time-{force.log}", zoomable=True, height=32)
    yield from (in_space(force, contact) for contact in contacts)
    for budget in context.catalogue.select(TipBudget, log=force.log):
        sizes = ((joint, context.number(f"tip.{force.log}.{joint}.total", 2)) for joint in budget.of_joint)
        parts = as_list([f"{size} by {name_in_sentence(joint)}" for joint, size in sizes])
        yield Prose(f"Standard deviation of the force at the tip in {name}, at the median pose: {parts}.")


def component_panel(force: TipForce, axis: str, contacts: Sequence[TipContact]) -> Panel:
    """One component over time."""
    shown = converged_rows(force.t)
    t, f, std = force.t[shown], getattr(force, f"f_{axis}")[shown], np.sqrt(getattr(force, f"c_{axis}{axis}")[shown])
    windows = [w for c in contacts for w in zip(c.onset.tolist(), c.release.tolist(), strict=True)]
    marks: tuple[AnyMark, ...] = (
        *spans(windows),
        Band(t, f - NORMAL_95 * std, f + NORMAL_95 * std, "95 % band" if axis == "x" else "", "blue"),
        Line(t, f, "force" if axis == "x" else "", "vermillion", "solid"),
    )
    return Panel(f"Along {axis}0", "time [s]", label(force, f"f_{axis}", "force"), marks)


def in_space(force: TipForce, contact: TipContact) -> Figure3D:
    """The path of the tip, with the largest force of each contact."""
    path = np.column_stack([force.x, force.y, force.z])
    extent = float(np.ptp(path, axis=0).max())
    per_newton = REACH * extent / float(contact.f_peak.max())
    few = evenly(len(path), PATH_POINTS)
    here, largest = (np.column_stack([getattr(contact, n) for n in names]) for names in (("x", "y", "z"), F))
    weak = np.column_stack([contact.weak_x, contact.weak_y, contact.weak_z]) * NORMAL_95 * contact.sigma_1[:, None]
    ends = here + per_newton * largest
    x, y, z = ends.T  # where numbers of contacts at one place are apart
    marks = (
        line(path[few], "path of the tip", "grey"),
        line(strokes(here, ends), "largest force", "vermillion", arrow=True),
        Points3D(x, y, z, "", "vermillion", tuple(str(i) for i in range(1, len(contact) + 1))),
        line(strokes(ends - per_newton * weak, ends + per_newton * weak), "95 % interval", "black"),
    )
    caption = explanation("tip-space", log=literal(force.log), scale=Number(1e3 * per_newton, "mm", digits=2))
    alt = f"The path of the tip in space in {literal(force.log)}, with the largest force of each contact as an arrow."
    return Figure3D(caption, alt, marks, f"tip-space-{force.log}", height=88)


def line(points: Column, name: str, colour: Colour, arrow: bool = False) -> Line3D:
    """A line through points (N, 3)."""
    return Line3D(points[:, 0], points[:, 1], points[:, 2], name, colour, "solid", arrow)
