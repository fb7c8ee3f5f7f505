"""Comparison of a simulated study with its ground truth, which nothing but the report ever sees."""

from collections.abc import Iterator
from typing import Any

from davinci_forces.records import Prediction, Track
from davinci_forces.records.record import slug
from davinci_forces.report.content import Block, Figure, Line, OnScreen, Panel, Prose, Section, Table, Verdict, literal
from davinci_forces.report.context import PLAIN, Context, count, fit_name, label, title
from davinci_forces.report.pushed import tip_forces, true_effort

LIMIT = 4.0  # standard errors that an estimate may be off before it is called wrong


def section(context: Context) -> Section | None:
    """Parameters and external efforts, estimated and true; only of a simulated study."""
    if not context.study.truth:
        return None
    return Section("Comparison with ground truth", "truth", tuple(blocks(context)))


def blocks(context: Context) -> Iterator[Block]:
    """The section's content."""
    yield Prose(
        "This study is simulated, so the ground truth is known. It is stored with the logs, no stage reads it, and "
        "this section compares with it: parameters where the simulated friction is what the model says, and external "
        "efforts everywhere."
    )
    yield from of_friction(context)
    for joint, path, theta in true_parameters(context):
        yield from parameters(context, joint, path, theta)
    figures: list[Figure] = []
    for log in context.study.truth.get("log", []):
        for joint in dict.fromkeys(push.get("joint") for push in log.get("push", [])):
            tracks = context.catalogue.about(Track, log=log["name"], joint=str(joint))
            pushes = [push for push in log["push"] if push.get("joint") == joint]
            figures += [effort_figure(track, pushes) for track in tracks]
    tip = list(tip_forces(context))
    yield from tip
    shown = 0 if tip else 1  # on paper, where no force at the tip shows the same
    yield from figures[:shown]
    if figures[shown:]:
        name = f"{count(len(figures) - shown, 'comparison')} of tracked and true effort"
        yield OnScreen(name, "more-truth", tuple(figures[shown:]))


def of_friction(context: Context) -> Iterator[Block]:
    """What friction does to a fit, where parameters are fitted to recordings of another friction than the models'."""
    family = {log["name"]: log.get("family", "") for log in context.study.truth.get("log", [])}
    matched = [name for name in context.study.truth.get("theta", {}) if name in family.values()]
    fitted = sorted({family.get(log, "") for fit in context.own_fits() for log in fit.logs})
    if not matched or not fitted or set(fitted) & set(matched):
        return
    yield Prose(
        f"**What friction does to a fit.** Parameters are identified from the recordings {literal(', '.join(fitted))}, "
        "whose friction differs by direction, rises near rest and gives way before it slides. The true parameters "
        f"below are those of the recordings {literal(', '.join(matched))}, which differ in nothing but friction: there "
        "it is what the models say. So what an estimate is off by is what such friction does to it, and the standard "
        "errors are as wide as they are because the residual repeats in every period."
    )
    yield errors_by_family(context, family)


def errors_by_family(context: Context, family: dict[str, str]) -> Table:
    """The model error of each joint in logs that nobody fitted, by what their friction is."""
    unseen = [p for p in context.catalogue.all(Prediction) if p.role != "identification"]
    used = [p for p in unseen if f"{p.model}.{p.estimator}" in (context.used_fit(p.joint), PLAIN)]
    rows = tuple(
        (
            title(p.joint),
            literal(family.get(p.log, "") or "–"),
            fit_name(p.model, p.estimator),
            context.number(f"{p.prefix}.model_error", 2),
            context.number(f"{p.prefix}.effort_rms", 2),
        )
        for p in sorted(used, key=lambda p: (p.joint, p.model, family.get(p.log, "")))
    )
    header = ("Joint", "Friction", "Fit", "Model error", "Effort")
    return Table("Model error by the friction of logs that nobody fitted.", header, rows, "error-by-friction", "lllrr")


def true_parameters(context: Context) -> Iterator[tuple[str, tuple[str, ...], dict[str, float]]]:
    """Joint, path in truth.toml and true parameters of every joint that has a fit."""
    fitted = {fit.group for fit in context.own_fits()}
    theta: dict[str, Any] = context.study.truth.get("theta", {})
    for name, entry in theta.items():
        if name in fitted:
            yield name, ("theta", name), entry
        else:  # a model of several joints has a table for each
            yield from ((joint, ("theta", name, joint), values) for joint, values in entry.items() if joint in fitted)


def parameters(context: Context, joint: str, path: tuple[str, ...], theta: dict[str, float]) -> Iterator[Block]:
    """The estimated parameters of one joint, compared with the true ones."""
    sha256 = context.provenance.raw.get(f"raw/{context.study.name}/truth.toml", "")
    rows, errors = [], []
    for name, value in theta.items():
        estimate = context.results.get(f"fit.{joint}.{context.own_fit(joint)}.{slug(name)}")
        if estimate is None or not estimate.std:
            continue
        key = f"truth.{joint}.{slug(name)}"
        context.results.truth(key, value, estimate.unit, (*path, name), sha256)
        errors.append(abs(estimate.value - value) / estimate.std)
        rows.append((name, context.number(key, 5), estimate.number()))
    if not rows:
        return
    yield Table(f"{title(joint)}: true and estimated parameters.", ("Parameter", "True", "Estimated"), tuple(rows))
    good = max(errors) < LIMIT
    judgement = "all lie" if good else "not all lie"
    yield Verdict("good" if good else "bad", f"**{title(joint)}**: {judgement} within four of their standard errors.")


def effort_figure(track: Track, pushes: list[dict[str, Any]]) -> Figure:
    """The effort exerted on a joint, and the filter's estimate of it."""
    t, effort = true_effort(pushes, float(track.t[-1]))
    name = f"{title(track.joint)} in {literal(track.log)}"
    marks = (Line(track.t, track.tau_ext, "filter", "vermillion"), Line(t, effort, "true", "black"))
    return Figure(
        f"{name}: external effort tracked by the filter, and true external effort.",
        f"External effort over time for {name}, tracked and true.",
        (Panel("External effort", "time [s]", label(track, "tau_ext", "external effort"), marks),),
        height=42,
    )
