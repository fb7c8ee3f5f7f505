"""A simulated study beside what is true of it.  Nothing but the report ever sees the truth."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from pipeline.records import Fit, Track
from pipeline.report.content import Block, Figure, Line, Panel, Prose, Section, Table, Verdict, literal
from pipeline.report.context import Context, label, title
from pipeline.report.results import slug

WORST = 4.0  # standard errors that a parameter may be off before it is called wrong
SHAPES = {"triangle": ((0.0, 0.0), (0.5, 1.0), (1.0, 0.0)), "pulse": ((0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0))}


def section(context: Context) -> Section | None:
    """Parameters and pushes, found and true."""
    if not context.study.truth:
        return None
    return Section("Beside the truth", "truth", tuple(blocks(context)))


def blocks(context: Context) -> Iterator[Block]:
    """The section's content."""
    yield Prose(
        "This study is simulated, so the truth is known. It lies beside the logs, no stage reads it, and this section "
        "compares with it: parameters where the simulated friction is what the model says, and pushes everywhere."
    )
    for joint, path, theta in true_parameters(context):
        yield from parameters(context, joint, path, theta)
    for log in context.study.truth.get("log", []):
        for joint in dict.fromkeys(push.get("joint") for push in log.get("push", [])):
            tracks = context.catalogue.about(Track, log=log["name"], joint=str(joint))
            yield from (pushes(track, [p for p in log["push"] if p.get("joint") == joint]) for track in tracks)


def true_parameters(context: Context) -> Iterator[tuple[str, tuple[str, ...], dict[str, float]]]:
    """Joint, place in truth.toml and true parameters of every joint that has a fit."""
    fitted = {fit.group for fit in context.catalogue.all(Fit)}
    theta: dict[str, Any] = context.study.truth.get("theta", {})
    for first, below in theta.items():
        if first in fitted:
            yield first, ("theta", first), below
        else:
            yield from ((joint, ("theta", first, joint), of) for joint, of in below.items() if joint in fitted)


def parameters(context: Context, joint: str, path: tuple[str, ...], theta: dict[str, float]) -> Iterator[Block]:
    """The parameters of one joint beside the true ones."""
    sha256 = context.provenance.raw.get(f"raw/{context.study.name}/truth.toml", "")
    rows, scores = [], []
    for name, value in theta.items():
        found = context.results.get(f"fit.{joint}.{context.used_fit(joint)}.{slug(name)}")
        if found is None or not found.std:
            continue
        key = f"truth.{joint}.{slug(name)}"
        context.results.truth(key, value, found.unit, (*path, name), sha256)
        scores.append(abs(found.value - value) / found.std)
        rows.append((name, context.number(key, 5), found.number()))
    if not rows:
        return
    yield Table(f"{title(joint)}: true parameters and those found.", ("Parameter", "True", "Found"), tuple(rows))
    good = max(scores) < WORST
    words = "all lie" if good else "not all lie"
    yield Verdict("good" if good else "bad", f"**{title(joint)}**: {words} within four of their standard errors.")


def pushes(track: Track, pushed: list[dict[str, Any]]) -> Figure:
    """What was exerted on a joint, and what the filter made of it."""
    t, effort = true_effort(pushed, float(track.t[-1]))
    name = f"{title(track.joint)} in {literal(track.log)}"
    marks = (Line(track.t, track.tau_ext, "filter", "vermillion"), Line(t, effort, "true", "black"))
    return Figure(
        f"{name}: external effort as the filter tracked it, and as it was.",
        f"External effort over time for {name}, tracked and true.",
        (Panel("External effort", "time [s]", label(track, "tau_ext", "external effort"), marks),),
        height=42,
    )


def true_effort(pushed: list[dict[str, Any]], end: float) -> tuple[Any, Any]:
    """The corners of the effort that was exerted."""
    corners = [(0.0, 0.0)]
    for push in sorted(pushed, key=lambda p: float(p["start"])):
        span = push["end"] - push["start"]
        corners += [(push["start"] + x * span, y * push["peak"]) for x, y in SHAPES[push["shape"]]]
    corners.append((end, 0.0))
    return np.array([x for x, _ in corners]), np.array([y for _, y in corners])
