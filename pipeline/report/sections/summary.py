"""What the study found, and how far to trust it."""

from collections.abc import Iterator

import numpy as np

from pipeline.records import Diagnostic, Fit, Prediction, Track
from pipeline.report.content import Block, Bullets, Prose, Section, Table, Verdict, literal
from pipeline.report.context import Context, title

SAME_PATH = "leave one period out"  # a scheme that repeats the path, and so the model's error on it
EXPECTED = 2.0  # normalised innovation squared of a consistent filter, of two measurements
GOOD, FAIR = 0.9, 0.7  # shares of variance explained that call a model good, or usable with care


def section(context: Context) -> Section:
    """Verdicts first, then the numbers behind them."""
    return Section("Summary", "summary", tuple(blocks(context)))


def blocks(context: Context) -> Iterator[Block]:
    """The summary's content."""
    study = context.study
    kind = "simulated" if study.simulated else "recorded"
    yield Prose(
        f"The study holds {len(study.logs)} {kind} logs of the {literal(study.robot.title)}. External effort is what "
        "the robot exerts on its environment, estimated from motor currents and joint positions; no force sensor was "
        "used."
    )
    if study.simulated:
        yield Verdict(
            "info", "All data in this report are **simulated**. They show that the methods work, not what an arm does."
        )
    yield from failures(context)
    if not context.catalogue.all(Fit):
        yield Verdict(
            "bad", "No joint could be identified: there is no usable identification log, so no effort was tracked."
        )
        return
    for joint in fitted_joints(context):
        yield from verdicts(context, joint)
    yield table(context)
    warnings = [literal(text) for diagnostic in context.catalogue.all(Diagnostic) for text in warning_texts(diagnostic)]
    if warnings:
        yield Prose("**What to look at.** The analysis itself warned of the following.")
        yield Bullets(tuple(warnings))


def warning_texts(diagnostic: Diagnostic) -> Iterator[str]:
    """The warnings of a diagnostic."""
    yield from (
        text for severity, text in zip(diagnostic.severity, diagnostic.text, strict=True) if severity == "warning"
    )


def failures(context: Context) -> Iterator[Block]:
    """What could not be done at all."""
    for task, failed in context.provenance.failures.items():
        yield Verdict("bad", f"**{literal(task)}** failed, and what depends on it is missing: {literal(failed)}")


def fitted_joints(context: Context) -> list[str]:
    """The joints that have a fit, in the robot's order."""
    return list(dict.fromkeys(fit.group for fit in context.catalogue.all(Fit)))


def verdicts(context: Context, joint: str) -> Iterator[Verdict]:
    """How well the model of a joint predicts, and whether its filter is consistent."""
    fit = context.used_fit(joint)
    scored = [p for p in context.catalogue.all(Prediction) if p.joint == joint and f"{p.model}.{p.estimator}" == fit]
    unseen = [p for p in scored if p.scheme != SAME_PATH and (p.role != "contact" or context.study.log(p.log).contact)]
    if unseen:
        yield prediction_verdict(context, min(unseen, key=lambda p: p.r2))
    elif scored:
        r2 = context.results[f"{scored[0].prefix}.r2"].number(3)
        yield Verdict(
            "info",
            f"**{title(joint)}**: the model explains {r2} of the variance of other periods of the path that it was "
            "fitted to. What it is worth on other paths is not known: add a validation log.",
        )
    tracks = [track for track in context.catalogue.all(Track) if track.joint == joint and not track.at_rest]
    if tracks and all(f"ekf.{track.log}.{joint}.white" in context.results for track in tracks):
        yield consistency_verdict(context, joint, tracks)


def prediction_verdict(context: Context, worst: Prediction) -> Verdict:
    """The verdict on the worst prediction of a joint."""
    name = title(worst.joint)
    where = f"(worst: {literal(worst.log)}, {worst.scheme})"
    if worst.r2 < 0:
        return Verdict(
            "bad", f"**{name}**: on effort that it has not seen, the model is worse than a constant {where}."
        )
    level = "good" if worst.r2 >= GOOD else "warn" if worst.r2 >= FAIR else "bad"
    r2 = context.results[f"{worst.prefix}.r2"].number(3)
    text = f"**{name}**: the model explains at least {r2} of the variance of effort that it has not seen {where}."
    return Verdict(level, text)  # type: ignore[arg-type]


def consistency_verdict(context: Context, joint: str, tracks: list[Track]) -> Verdict:
    """Whether the standard deviations that the filter states can be believed."""
    name = title(joint)
    coloured = [t for t in tracks if context.results[f"ekf.{t.log}.{joint}.white"].value != 1]
    if not coloured:
        return Verdict("good", f"**{name}**: the filter's innovations pass as white noise in all {len(tracks)} logs.")
    usual = float(np.median([t.nis_mean for t in tracks]))
    size = "too small" if usual > 2 * EXPECTED else "too large" if usual < EXPECTED / 2 else "about as large as it is"
    return Verdict(
        "warn" if EXPECTED / 2 <= usual <= 2 * EXPECTED else "bad",
        f"**{name}**: the filter's innovations are not white over the whole run in {len(coloured)} of {len(tracks)} "
        f"logs, and what it states of their spread is {size}. Judge a contact by the free-space level, not by the "
        "filter's own standard deviations.",
    )


def table(context: Context) -> Table:
    """One row per joint and log that was tracked."""
    rows = []
    for track in context.catalogue.all(Track):
        key = f"ekf.{track.log}.{track.joint}"
        white = context.results.get(f"{key}.white")
        rows.append(
            (
                title(track.joint),
                literal(track.log),
                f"{track.role}, at rest" if track.at_rest else track.role,
                context.number(f"{key}.tau_ext_rms", 3),
                context.number(f"{key}.nis_mean", 3),
                "–" if white is None else "yes" if white.value == 1 else "no",
            )
        )
    return Table(
        "External effort outside known contacts (root mean square), the filter's normalised innovation squared "
        "(2 when it is consistent), and whether its innovations are white. Where nothing touched the robot, the first "
        "is its floor: a contact has to exceed it to be seen.",
        ("Joint", "Log", "Role", "External effort", "NIS", "White"),
        tuple(rows),
        label="summary-table",
        align="lllrrl",
    )
