"""Comparison of a simulated study with its ground truth, which only the report reads."""

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from davinci_forces.records import TipContact, TipForce, Track
from davinci_forces.records.record import slug
from davinci_forces.report.content import Block, Cell, Figure, Panel, Prose, Table, Verdict, in_format, literal, message
from davinci_forces.report.content.marks import Line
from davinci_forces.report.context import Context, count, label, title
from davinci_forces.report.sections.parts import F, explanation, first_on_paper, of_joint, run_name, section_of
from davinci_forces.report.verdicts import truth_level

PUSH_SHAPES = {
    "triangle": ((0.0, 0.0), (0.5, 1.0), (1.0, 0.0)),
    "pulse": ((0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0)),
}
# What the simulator puts into a joint: the effect, its parameters in truth.toml, and the terms that represent it.
EFFECTS = (
    ("viscous friction", "{viscous:g}", "viscous friction"),
    ("Coulomb friction, positive; negative", "{coulomb_up:g}; {coulomb_down:g}", "Coulomb friction|offset"),
    (
        "Stribeck: static friction, positive; negative; velocity",
        "{static_up:g}; {static_down:g}; {stribeck_velocity:g}",
        "Stribeck friction",
    ),
    ("presliding (LuGre): stiffness; damping", "{bristle_stiffness:g}; {bristle_damping:g}", "presliding friction"),
)
WITHOUT_TERM = "none: the current is measured"
Push = dict[str, Any]


@section_of("Comparison with ground truth", "truth")
def section(context: Context) -> Iterator[Block]:
    """Parameters and external efforts, estimated and true; only of a simulated study."""
    if not context.study.truth:
        return
    yield Prose(explanation("truth"))
    yield from effects(context)
    errors: list[float] = []
    fitted = {fit.group for fit in context.own_fits()}
    for name, entry in context.study.truth.get("theta", {}).items():
        is_joint = name in fitted  # a model of several joints has a table for each
        tables = {(name,): entry} if is_joint else {(name, joint): values for joint, values in entry.items()}
        for path, values in tables.items():
            if path[-1] in fitted:
                yield from parameters(context, ("theta", *path), values, errors)
    if errors:
        yield truth_verdict("Parameters", errors)
    figures: list[Figure] = []
    for log in context.study.truth.get("log", []):
        for joint in dict.fromkeys(push.get("joint") for push in log.get("push", [])):
            pushes = [push for push in log["push"] if push.get("joint") == joint]
            curve = {"External effort": ("tau_ext_smooth", pushes)}
            for track in context.catalogue.select(Track, log=log["name"], joint=str(joint)):
                figures.append(compared_figure(track, f"{run_name(track)}: external effort", "external effort", curve))
    tip = list(tip_forces(context))
    yield from tip
    shown = 0 if tip else 1  # figures on paper, if no force at the tip is compared there
    name = f"{count(len(figures) - shown, 'comparison')} of tracked and true effort"
    yield from first_on_paper(figures, name, "more-truth", shown)


def effects(context: Context) -> Iterator[Table]:
    """What was put into an arm, the terms that represent it, and their values in the model that the filter used."""
    fitted = {log for fit in context.own_fits() for log in fit.logs}
    family = {log.get("family") for log in context.study.truth.get("log", []) if log["name"] in fitted}
    rows: list[tuple[Cell, ...]] = []
    for name, friction in context.study.truth.get("friction", {}).items():
        for joint, parameters in friction.items() if name in family else ():
            keys = used_parameters(context, joint)
            for effect, symbols, terms in EFFECTS:
                of_effect = [(term, context.number(key, 3)) for term, key in keys.items() if re.match(terms, term)]
                cells = of_effect or [(terms.replace("|", ", "), "not in the model")]
                rows += [(title(joint), effect, message(symbols.format(**parameters)), *cell) for cell in cells]
    if rows:
        rows.append(("Motors", "rotor inertia", "see truth.toml", "part of the inertia", "–"))
        rows.append(("Motors", "windings, limits of current and voltage", "see truth.toml", WITHOUT_TERM, "–"))
        yield Table(explanation("put-in"), ("Joint", "Effect", "Put in", "Term", "Estimated"), rows, "put-in", "llllr")


def used_parameters(context: Context, joint: str) -> dict[str, str]:
    """The parameters of a joint in the fit that the filter used, by name, with the keys of their values."""
    fit = context.shown_fit(joint)
    rows = of_joint(fit, joint) if fit else {}
    return {name: ".".join(("fit", *fit.key, slug(fit.parameter[i]))) for i, name in rows.items() if fit}


def parameters(
    context: Context, path: tuple[str, ...], theta: dict[str, float], errors: list[float]
) -> Iterator[Table]:
    """The estimated parameters of one joint, compared with the true ones; their errors are added to `errors`.

    `path` leads to the true ones in truth.toml, and ends with the joint.
    """
    joint, sha256 = path[-1], context.provenance.raw.get(f"raw/{context.study.name}/truth.toml", "")
    rows = []
    for name, value in theta.items():
        estimate = context.results.get(f"fit.{joint}.{context.own_fit(joint)}.{slug(name)}")
        if estimate is None or not estimate.std:
            continue
        key = f"truth.{joint}.{slug(name)}"
        context.results.truth(key, value, estimate.unit, (*path, name), sha256)
        errors.append(abs(estimate.value - value) / estimate.std)
        rows.append((name, context.number(key, 5), estimate.number(), f"{errors[-1]:.1f}"))
    if rows:
        caption = f"{title(joint)}: true and estimated parameters, and the errors in standard errors."
        yield Table(caption, ("Parameter", "True", "Estimated", "Error"), tuple(rows))


def compared_figure(
    record: Track | TipForce, subject: str, meaning: str, curves: dict[str, tuple[str, list[Push]]]
) -> Figure:
    """Efforts or forces of one log over time: of each panel, by its heading, the estimated field and the pushes."""
    panels = []
    for heading, (field, pushes) in curves.items():
        estimated = Line(record.t, getattr(record, field), "estimated", "vermillion")
        true = Line(*true_effort(pushes, float(record.t[-1])), "true", "black")
        panels.append(Panel(heading, "time [s]", label(record, field, meaning), (estimated, true)))
    caption, alt = f"{subject}, estimated and true.", f"{subject} over time, estimated and true."
    return Figure(caption, alt, tuple(panels), columns=len(panels), height=42)


def true_effort(pushes: list[Push], end: float) -> tuple[Any, Any]:
    """Times [s] and values (n,) of the corners of the effort that was exerted."""
    corners = [(0.0, 0.0)]
    for push in sorted(pushes, key=lambda p: float(p["start"])):
        span = push["end"] - push["start"]
        corners += [(push["start"] + x * span, y * push["peak"]) for x, y in PUSH_SHAPES[push["shape"]]]
    corners.append((end, 0.0))
    return np.array([x for x, _ in corners]), np.array([y for _, y in corners])


def tip_forces(context: Context) -> Iterator[Block]:
    """The force at the tip, estimated and true; nothing where no push of a simulation is at the tip."""
    logs = context.study.truth.get("log", [])
    pushed = {log["name"]: [push for push in log.get("push", []) if "direction" in push] for log in logs}
    pushed = {log: pushes for log, pushes in pushed.items() if pushes}
    pairs = [
        (contact, i, push)
        for contact in context.catalogue.records(TipContact)
        for i in range(len(contact))
        for push in pushed.get(contact.log, [])
        if contact.onset[i] < push["end"] and contact.release[i] > push["start"]  # at the same time
    ]
    if pairs:
        yield comparison(context, pairs)
        yield truth_verdict("Force at the tip", [size for pair in pairs for size in errors_in_deviations(*pair)])
    figures = []
    for force in (force for force in context.catalogue.records(TipForce) if force.log in pushed):
        curves = {
            f"Along {f[-1]}0": (f, [push | {"peak": force_of(push)[k]} for push in pushed[force.log]])
            for k, f in enumerate(F)
        }
        figures.append(compared_figure(force, f"{literal(force.log)}: force at the tip", "force", curves))
    yield from first_on_paper(figures, "Force at the tip, estimated and true, in other logs", "more-tip-truth")


def force_of(push: Push) -> list[float]:
    """The components of a push where it is largest [N]."""
    return [push["peak"] * part for part in push["direction"]]


def errors_in_deviations(contact: TipContact, i: int, push: Push) -> list[float]:
    """The error of each component in standard deviations."""
    of_axes = zip(F, force_of(push), strict=True)
    return [abs(float(getattr(contact, f)[i]) - true) / float(getattr(contact, f"{f}_std")[i]) for f, true in of_axes]


def comparison(context: Context, pairs: list[tuple[TipContact, int, Push]]) -> Table:
    """One row a push."""
    rows = []
    for contact, i, push in pairs:
        true = (in_format(x, ".3g") for x in force_of(push))
        numbers = context.numbers(f"tip.{contact.log}.{i + 1}", F)
        worst = f"{max(errors_in_deviations(contact, i, push)):.1f}"
        rows.append((literal(contact.log), str(i + 1), *true, *numbers, worst))
    header = ("Log", "Contact", *(f"true ${f}$" for f in F), *(f"${f}$" for f in F), "Error")
    return Table(explanation("tip-truth"), header, rows, "tip-truth", "llrrrrrrr")


def truth_verdict(name: str, errors: list[float]) -> Verdict:
    """Whether errors agree with the stated standard errors."""
    level, counts = truth_level(errors)
    return Verdict(level, f"**{name}**: of {count(len(errors), 'error')}, {counts}.")
