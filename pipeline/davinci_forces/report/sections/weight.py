"""What hangs on the arm: its mass, the scale of the efforts, and what free motion would seem to weigh.  Section 7.5"""

import math
from collections.abc import Iterator

from davinci_forces.records import FreeWeight, Load, Weight
from davinci_forces.report.content import (
    Block,
    Cell,
    Figure,
    Line,
    Number,
    OnScreen,
    Panel,
    Prose,
    Section,
    Table,
    Verdict,
    literal,
)
from davinci_forces.report.context import Context, label, title
from davinci_forces.report.verdicts import NORMAL_95


def section(context: Context) -> Section | None:
    """One part per weight log."""
    weights = context.catalogue.all(Weight)
    if not weights:
        return None
    found: list[Block] = [intro(), summary(context, weights)]
    found += (verdict(context, weight) for weight in weights)
    found += of_log(context, weights[0])
    if weights[1:]:
        others = tuple(block for weight in weights[1:] for block in of_log(context, weight))
        found.append(OnScreen("The other runs with a mass", "other-masses", others))
    return Section("Hung masses", "weight", tuple(found))


def intro() -> Prose:
    """How a mass is found, and what its error is made of."""
    return Prose(
        "A mass that hangs on a link asks the joints for its gravity and its inertia, which follow from the robot's "
        "chain. The external effort (measured minus modelled, low-passed without delay, not the filter's) of all "
        "joints that move and carry the mass is regressed on what a kilogram would ask for, each joint weighted by the "
        "inverse of its model's squared error along free motion. A joint has an offset of the day where that can be "
        "told from the load. The standard error is that of six parts of the path, one left out at a time, together "
        "with that of the fit; both are widened where masses that other free motion seems to carry, and that should "
        "be 0, exceed theirs."
    )


def summary(context: Context, weights: list[Weight]) -> Table:
    """The masses of all logs."""
    rows = tuple(
        (
            literal(weight.log),
            literal(weight.moves_with),
            "–" if math.isnan(weight.stated_mass) else str(Number(weight.stated_mass, "kg")),
            *context.numbers(f"weight.{weight.log}", ("mass", "mass_mirrored", "scale")),
            weight.side,
        )
        for weight in weights
    )
    return Table(
        "Masses with their standard errors: as the position is stated, and on the other side of the link. The side "
        "that explains the efforts better is named where it does so by two standard errors. The scale is the mass over "
        "the stated one.",
        ("Log", "Moves with", "Stated", "Mass", "Other side", "Scale", "Side"),
        rows,
        "weight-table",
        "llrrrrl",
    )


def of_log(context: Context, weight: Weight) -> Iterator[Block]:
    """What is said of one log."""
    if weight.tare:
        yield disagreement(context, weight)
    if loads := carrying(context, weight):
        yield figure(weight, loads)
    yield by_joint(context, weight)
    free = context.catalogue.about(FreeWeight, weight=weight.log)
    if free:
        yield OnScreen("What free motion seems to weigh", f"free-{weight.log}", (free_motion(context, weight, free),))


def verdict(context: Context, weight: Weight) -> Verdict:
    """Whether the mass is the one that is stated, and what follows for the efforts."""
    mass = context.number(f"weight.{weight.log}.mass", 3)
    name = f"**{literal(weight.log)}**: the efforts weigh {mass}"
    if weight.side == "the other one":
        return Verdict("warn", f"{name}; on the other side of its link it explains them better: check its position.")
    if math.isnan(weight.stated_mass):
        return Verdict("info", f"{name}; the study states no mass, so the scale of the efforts is not known.")
    within = abs(weight.mass - weight.stated_mass) <= NORMAL_95 * weight.mass_std
    stated, scale = Number(weight.stated_mass, "kg"), context.number(f"weight.{weight.log}.scale", 3)
    if within:
        return Verdict("good", f"{name}, and {stated} hang there: the scale, {scale}, cannot be told from 1.")
    return Verdict(
        "warn", f"{name}, and {stated} hang there: efforts are {scale} times too large; check gear and motor."
    )


def disagreement(context: Context, weight: Weight) -> Prose:
    """By how much the tare disagrees with the fit's own free motion."""
    seems = context.number(f"weight.{weight.log}.tare_mass", 2)
    return Prose(
        f"The run {literal(weight.tare)} along the same path is subtracted. By the fit alone it would seem to carry "
        f"{seems}: by so much the tare disagrees with the free motion that was fitted, and by so much the mass differs "
        "from the one without the tare. What the fit errs by repeats along the path and falls out, so it is not in the "
        "standard error; what changed between the two runs is in the mass."
    )


def carrying(context: Context, weight: Weight) -> list[Load]:
    """What the joints carry along the path of a log."""
    loads = context.catalogue.about(Load, log=weight.log, weight=weight.log)
    return [load for load in loads if load.joint in weight.loaded]


def figure(weight: Weight, loads: list[Load]) -> Figure:
    """The external effort of each joint beside what the mass asks of it.  Fig 7.12"""
    mass = weight.mass if math.isnan(weight.stated_mass) else weight.stated_mass
    by = "found" if math.isnan(weight.stated_mass) else "stated"
    offsets = dict(zip(weight.loaded, weight.joint_offset, strict=True))
    name, subtracted = literal(weight.log), ", before the tare is subtracted" if weight.tare else ""
    once = "over one period, averaged" if loads[0].period else "over the run"
    return Figure(
        f"{name}: external effort of each joint that carries the mass {once}{subtracted}, and what the {by} mass asks "
        "for, with the joint's offset of the day.",
        f"{name}: the external effort of {', '.join(title(load.joint) for load in loads)} follows the load of "
        f"{Number(mass, 'kg')}.",
        tuple(
            Panel(
                title(load.joint), "time [s]", label(load, "tau_ext", "external effort"),
                (
                    Line(load.t, load.tau_ext, "measured minus model", "sky"),
                    Line(load.t, mass * load.load + offsets[load.joint], f"{by} mass", "vermillion", "dashed"),
                ),
            )
            for load in loads
        ),
        f"weight-figure-{weight.log}",
        height=35,
    )  # fmt: skip


def by_joint(context: Context, weight: Weight) -> Table:
    """What each joint says of the mass."""
    names = ("mass", "joint_offset", "left_rms", "free_error")
    rows = tuple((title(joint), *context.numbers(f"weight.{weight.log}.{joint}", names)) for joint in weight.loaded)
    return Table(
        f"{literal(weight.log)}, joint by joint: the mass by that joint alone, with the standard error that parts of "
        "the path tell; its offset of the day; and the root mean square of what mass and offset leave, beside what the "
        "model leaves of free motion. Where the former is larger, more than the mass has changed.",
        ("Joint", "Mass alone", "Offset", "Left", "Free motion"),
        rows,
        f"weight-joints-{weight.log}",
        "lrrrr",
    )


def free_motion(context: Context, weight: Weight, free: list[FreeWeight]) -> Table:
    """What free motion would seem to weigh."""
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (literal(of.log), literal(of.role), context.number(f"weight.{weight.log}.free.{of.log}", 2)) for of in free
    )
    widening = context.number(f"weight.{weight.log}.widening", 3)
    return Table(
        f"What seems to hang in free motion where {literal(weight.log)} has its mass: it should be 0. Fitted logs "
        f"count by refits that had not seen them; by the others, standard errors are widened {widening} times.",
        ("Log", "Role", "Mass"),
        rows,
        f"weight-free-{weight.log}",
        "llr",
    )
