"""Masses on the arm: their estimates, and the scale of the efforts.  Section 7.5"""

import math
from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Load, TorqueConstant, Weight
from davinci_forces.report.content import Block, Figure, Number, OnScreen, Panel, Prose, Table, Verdict, literal
from davinci_forces.report.content.marks import Line
from davinci_forces.report.context import Context, label, name_in_sentence, title
from davinci_forces.report.sections.parts import explanation, grade_of_mass, run_cells, section_of
from davinci_forces.report.verdicts import PRECISE, TURN_AROUND, doubt_of_mass, is_same, percent


@section_of("Attached masses", "weight")
def section(context: Context) -> Iterator[Block]:
    """The masses of all weight logs in a table, then each log in detail."""
    weights, constants = context.catalogue.records(Weight), context.catalogue.records(TorqueConstant)
    if not weights and not constants:
        return
    yield Prose(explanation("weight"))
    if weights:
        yield summary(context, weights)
    yield from (verdict(context, weight) for weight in weights)
    if constants:
        yield torque_constants(context, constants)
    for weight in weights[:1]:
        yield from log_blocks(context, weight)
    if weights[1:]:
        others = tuple(block for weight in weights[1:] for block in log_blocks(context, weight))
        yield OnScreen("The other runs with a mass", "other-masses", others)


def summary(context: Context, weights: list[Weight]) -> Table:
    """The masses of all logs."""
    rows = []
    for weight in weights:
        carrier, stated = literal(weight.moves_with or "tip"), str(Number(weight.stated_mass, "kg"))
        rows.append((literal(weight.log), carrier, stated, *context.numbers(f"weight.{weight.log}", ("mass", "scale"))))
    caption = "Masses with their standard errors. The scale is the estimated mass divided by the stated mass."
    return Table(caption, ("Log", "Moves with joint or link", "Stated", "Mass", "Scale"), rows, "weight-table", "llrrr")


def torque_constants(context: Context, constants: list[TorqueConstant]) -> Table:
    """The torque constants that known masses give, beside those that are used."""
    rows = []
    for constant in constants:
        used = context.size(constant, "torque_constant_used", digits=4)
        proposed = context.number(f"weight.{constant.log}.{constant.joint}.torque_constant", 3)
        agrees = is_same(constant.torque_constant, constant.torque_constant_std, constant.torque_constant_used)
        follows = "–" if math.isnan(constant.torque_constant_used) else "keep" if agrees else "check"
        rows.append((*run_cells(constant), str(Number(constant.stated_mass, "kg")), used, proposed, follows))
    header = ("Log", "Joint", "Known mass", "Used", "Proposed", "In use")
    return Table(explanation("torque-constants"), header, rows, "torque-constants", "llrrrl")


def log_blocks(context: Context, weight: Weight) -> Iterator[Block]:
    """The content about one log."""
    if weight.tare:
        apparent = context.number(f"weight.{weight.log}.tare_mass", 2)
        yield Prose(explanation("tare", run=literal(weight.tare), mass=apparent))
    loads = context.catalogue.select(Load, log=weight.log, weight=weight.log)
    if loads := [load for load in loads if load.joint in weight.loaded]:
        yield figure(weight, loads)
    yield by_joint(context, weight)


def verdict(context: Context, weight: Weight) -> Verdict:
    """Whether the estimated mass agrees with the stated one, and what follows for the scale of the efforts."""
    mass, scale = (context.number(f"weight.{weight.log}.{name}", 3) for name in ("mass", "scale"))
    stated = f"{Number(weight.stated_mass, 'kg')} is stated."
    level, why = grade_of_mass(context, weight)
    tests_scale = any(math.isfinite(other.stated_mass) for other in context.catalogue.records(Weight))
    errors = np.abs(weight.mass_alone - weight.stated_mass) / weight.mass_alone_std
    worst = literal(weight.loaded[int(np.argmax(errors))])  # the joint that alone is furthest from the stated mass
    turned = str(weight.loaded[int(np.argmin(weight.mass_alone / weight.mass_alone_std))])  # the most clearly negative
    others = ": [@weight-table] has scales of other masses" if tests_scale else ""
    follows = {
        "side": ". The other side of its link explains the efforts better: check its position.",
        "sign": f". No mass is negative: the positive direction of {name_in_sentence(turned)} is not "
        f"that of the robot's chain. In study.toml {TURN_AROUND}.",
        "joints": f". The joints tell different masses, {literal(weight.differing)} most; the interval contains all.",
        "unstated": f". The study states no mass, so none tests the scale of the efforts{others}.",
        "taken": f", and {stated} A torque constant in use is what this log gives, so this is no test: weigh another.",
        "scale": f", but {stated} Efforts are {scale} times too large: check gear and motor, most of all those of "
        f"{worst}, and where the mass hung.",
        "wide": f", and {stated} The standard error exceeds {percent(PRECISE)} of it, too much to test the scale.",
        "right": f", and {stated} The scale, {scale}, agrees with 1.",
    }
    named = f"**{literal(weight.log)}**: the mass estimated from the efforts is {mass}{doubt_of_mass(weight)}"
    return Verdict(level, named + follows[why])


def figure(weight: Weight, loads: list[Load]) -> Figure:
    """The external effort of each joint and the effort of the mass.  Fig 7.12"""
    mass, by = (weight.mass, "estimated") if math.isnan(weight.stated_mass) else (weight.stated_mass, "stated")
    offsets = dict(zip(weight.loaded, np.nan_to_num(weight.joint_offset), strict=True))
    name = literal(weight.log)
    subtracted = ", before the tare is subtracted and the model's error with it" if weight.tare else ""
    once = "over one averaged period" if loads[0].period else "over the run"
    panels = []
    for load in loads:
        measured = Line(load.t, load.tau_ext, "measured minus model", "sky")
        caused = Line(load.t, mass * load.load + offsets[load.joint], f"{by} mass", "vermillion", "dashed")
        effort = label(load, "tau_ext", "external effort")
        panels.append(Panel(title(load.joint), "time [s]", effort, (measured, caused)))
    plus = " plus the joint's offset of the day" if any(offsets.values()) else ""
    caption = explanation("weight-figure", log=name, once=once, subtracted=subtracted, by=by, plus=plus)
    joints = ", ".join(title(load.joint) for load in loads)
    alt = f"{name}: the external effort of {joints} follows the load of {Number(mass, 'kg')}."
    return Figure(caption, alt, tuple(panels), f"weight-figure-{weight.log}", height=35)


def by_joint(context: Context, weight: Weight) -> Table:
    """The mass estimated from each joint alone."""
    names = ("mass", "mass_mirrored", "false_mass", "joint_offset", "left_rms", "free_error")
    rows = tuple((title(joint), *context.numbers(f"weight.{weight.log}.{joint}", names)) for joint in weight.loaded)
    agree, mirrored = context.probabilities(f"weight.{weight.log}", ("agreement", "agreement_mirrored"))
    chance = f"{agree} ({mirrored} mirrored); below 0.01 they do not"
    together = f" Probability of the joints' chi-square, if they agree: {chance}."
    caption = explanation("weight-joints", log=literal(weight.log), agreement=together if len(rows) > 1 else "")
    header = ("Joint", "Mass alone", "Mirrored", "False mass", "Offset", "Residual", "Free motion")
    return Table(caption, header, rows, f"weight-joints-{weight.log}", "lrrrrrr")
