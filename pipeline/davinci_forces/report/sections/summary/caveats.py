"""What a reviewer should look at first: every caveat with its weight."""

import re
from collections import Counter
from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Diagnostic, PathShare, Prediction, Record, Spectrum, Track, Weight
from davinci_forces.records.record import as_list, first_of_each_kind
from davinci_forces.report import verdicts
from davinci_forces.report.content import literal, message
from davinci_forces.report.context import Context, title
from davinci_forces.report.sections.parts import explanation, grade_of_mass, of_joint, scored_predictions
from davinci_forces.report.verdicts import Trust, is_mostly_constant, percent

# Warnings of the measured motion, on which all else rests, and of the scale of efforts
SPOILS_ALL = re.compile("^resample|A of .* counts as")
# In a warning of any stage that blames units, or leaves a joint without an answer, or free motion in doubt.
COMES_FIRST = re.compile("check the units|its external effort is not estimated|something seems to touch the arm")
LACKS_LOGS = "arm: no identification log moves"  # so begins advice that a log that failed may have followed
FIRST_OF_ALL, FIRST, WARNING = 200.0, 100.0, 1.5  # weights of these two kinds of warnings, and of others
MAX_NARROW = 2.4  # largest weight of a narrow band: less than that of an error for which a joint's verdict is a problem
FASTER = 1.2  # speed over that of all fitted logs, which may be why a band is too narrow
NEAR_TWICE = 0.1  # distance of a model error from twice the effort, from which the sign of the effort is suspected


def first_looks_in_order(context: Context, trusts: list[Trust]) -> tuple[str, ...]:
    """The three things to look at first, as marked texts, worst first."""
    return tuple(text for _, text in sorted(looks_at(context, trusts), key=lambda look: -look[0])[:3])


def looks_at(context: Context, trusts: list[Trust]) -> Iterator[tuple[float, str]]:
    """Yield every caveat with its weight; 1 is where caution begins."""
    for trusted in trusts:
        yield from looks_at_model(context, trusted)
        yield from looks_at_parameters(context, trusted.joint)
        yield from looks_at_band(context, trusted)
    yield from looks_at_narrow_bands(context, trusts)
    yield from looks_at_paths(context, trusts)
    yield from looks_at_reach(context, [trusted.joint for trusted in trusts])
    yield from looks_at_masses(context)
    omitted = max(map(omitted_share, context.catalogue.records(Spectrum)), default=0.0)
    fitted = [log.name for log in context.study.logs if log.role == "identification"]
    lost = any(task.split(" ")[-1] in fitted for task in context.provenance.failures)
    moving = Counter(track.log for track in context.catalogue.records(Track) if not track.at_rest)
    is_idle = lost or max(moving.values(), default=0) < 2  # advice on joints that move together in no log
    warnings = [("study.toml", text) for text in context.study.remarks]
    warnings += [
        (diagnostic.stage, text)
        for diagnostic in context.catalogue.records(Diagnostic)
        for severity, text in zip(diagnostic.severity, diagnostic.text, strict=True)
        if severity == "warning" and not (is_idle and text.startswith(LACKS_LOGS))
    ]
    for stage, text in first_of_each_kind(warnings):
        by_size = omitted / verdicts.GOOD if stage == "differentiate" else WARNING
        rank = FIRST if COMES_FIRST.search(text) else by_size
        weight = FIRST_OF_ALL if SPOILS_ALL.search(f"{stage} {text}") else rank
        yield weight, message(text)


def omitted_share(spectrum: Spectrum) -> float:
    """The largest harmonic that is not kept, over the largest of all; 0 if all are kept."""
    omitted = spectrum.amplitude[spectrum.harmonics + 1 :].max(initial=0.0)
    return float(omitted / (spectrum.amplitude[1:].max(initial=0.0) or 1.0))


def looks_at_masses(context: Context) -> Iterator[tuple[float, str]]:
    """Yield a caveat for each mass that is negative, or differs from the stated one."""
    for weight in context.catalogue.records(Weight):
        why = grade_of_mass(context, weight)[1]
        if why == "sign":
            yield FIRST, f"**{literal(weight.log)}**: the mass is negative, so a direction is reversed. See [@weight]."
        if why == "scale":
            share = abs(weight.mass / weight.stated_mass - 1.0)
            away = abs(weight.mass - weight.stated_mass) / weight.mass_std
            side = "large" if weight.mass > weight.stated_mass else "small"
            size = f"{share + 1.0:.3g} times too large" if share > 1.0 else f"{100 * share:.2g} % too {side}"
            text = f"the mass is estimated {size}, by {away:.1f} standard errors."
            yield WARNING, f"**{literal(weight.log)}**: {text} See [@weight]."


def looks_at_paths(context: Context, trusts: list[Trust]) -> Iterator[tuple[float, str]]:
    """Yield one caveat for all joints that were tested only on the path that was fitted, and one for parts of it."""
    same = [trusted for trusted in trusts if trusted.same_path]
    parts = [trusted for trusted in trusts if trusted.of_parts and not trusted.same_path]
    where_tested = (
        (4.0, same, "the path that was fitted ({}), where the model's error repeats."),
        (2.0, parts, "parts of fitted logs ({}) that refits left out; on another path the error may be larger."),
    )
    for weight, some, where in (tested for tested in where_tested if tested[1]):
        logs = dict.fromkeys(literal(trusted.prediction.log) for trusted in some if trusted.prediction is not None)
        names = ", ".join(title(trusted.joint) for trusted in some)
        remedy = f"Record a validation log on another path.{see(context, Prediction, 'prediction')}"
        yield weight, f"**{names}**: tested only on {where.format(', '.join(logs))} {remedy}"


def looks_at_reach(context: Context, joints: list[str]) -> Iterator[tuple[float, str]]:
    """Yield a caveat for the joint and log that are fastest over fitted logs, and for those that go farthest beyond."""
    shares = [share for share in context.catalogue.records(PathShare) if share.joint in joints]
    reaches = (
        ("speed_ratio", verdicts.MAX_SPEED_RATIO, "it moves {0:.2g} times as fast as in any fitted log", "is as fast"),
        ("outside", verdicts.MAX_OUTSIDE, "{1} of its samples are " + verdicts.BEYOND, "goes as far"),
    )
    for name, most, text, remedy in reaches:
        share = max(shares, key=lambda of: np.nan_to_num(getattr(of, name)), default=None)
        if share is not None and (reach := getattr(share, name)) > most:
            where, what = f"**{title(share.joint)}, {literal(share.log)}**", text.format(reach, percent(reach))
            follows = f"so its model extrapolates and may err more. Record an identification log that {remedy}."
            yield reach / most, f"{where}: {what}, {follows}"


def looks_at_model(context: Context, trusted: Trust) -> Iterator[tuple[float, str]]:
    """Yield a caveat where the model error calls for caution; it names a constant part that is most of the error."""
    p, name, see_runs = trusted.prediction, title(trusted.joint), see(context, Prediction, "prediction")
    if p is not None and trusted.share > verdicts.GOOD:
        error, constant = context.results[f"{p.prefix}.model_error"].number(2), ""
        if is_mostly_constant(p):
            mean = context.results[f"{p.prefix}.mean_error"].number(2)
            varying = context.size(p, "model_error", max(p.model_error**2 - p.mean_error**2, 0.0) ** 0.5, 2)
            as_of = "as of another payload or an offset of the current"
            constant = f"; {varying} without its constant part, {mean}, {as_of}"
        opposed = ", as where the effort has the wrong `sign`" if abs(trusted.share - 2.0) < NEAR_TWICE else ""
        text = f"the model error is {error}, {verdicts.error_share(p)} of the effort{constant or opposed}; "
        text += f"that of a good model is at most {percent(verdicts.GOOD)}.{offset_remedy(context, p)}"
        by_level = " The verdict follows from the detection level." if trusted.level == "good" else ""
        yield trusted.share / verdicts.GOOD, f"**{name}, {literal(p.log)}**: {text}{by_level}{see_runs}"


def offset_remedy(context: Context, p: Prediction) -> str:
    """What to state where the error in a log is mostly constant and may be the offset of the day; else ""."""
    if context.study.log(p.log).free or not is_mostly_constant(p):
        return ""
    remedy = "state `free` in that log: levels and band are then without it, the model error is not"
    return f" If the constant part of the model error is an offset of the day, and of no interest, {remedy}."


def looks_at_parameters(context: Context, joint: str) -> Iterator[tuple[float, str]]:
    """Yield a caveat if the model in use has parameters that no mechanism has."""
    fit = context.shown_fit(joint)
    if fit is None:
        return
    impossible = [verdicts.is_impossible(*of) for of in zip(fit.theta, fit.theta_std, strict=True)]
    if wrong := [name for i, name in of_joint(fit, joint).items() if fit.positive[i] and impossible[i]]:
        text = explanation("negative", parameters=as_list(wrong))
        if verdicts.LIFTED_MASS in wrong:
            text = explanation("negative-mass", remedy=verdicts.TURN_AROUND)
        yield FIRST if verdicts.LIFTED_MASS in wrong else WARNING, f"**{title(joint)}**: {text} See [@joints]."


def looks_at_band(context: Context, trusted: Trust) -> Iterator[tuple[float, str]]:
    """Yield a caveat where the detection level hides the effort sought."""
    space, name, see_runs = trusted.space, title(trusted.joint), see(context, Track, "runs")
    if space is not None and trusted.fineness > verdicts.DETECTED:
        level, sought = (context.size(space, "detection_level", x) for x in (space.detection_level, trusted.sought))
        hides = "hides efforts of" if trusted.fineness > verdicts.DETECTABLE else "is more than a third of"
        text = f"the detection level of {level} {hides} {sought}, which the study seeks."
        yield 3 * trusted.fineness, f"**{name}, {literal(space.log)}**: {text}{see_runs}"


def looks_at_narrow_bands(context: Context, trusts: list[Trust]) -> Iterator[tuple[float, str]]:
    """Yield one caveat for all joints whose 95 % band is too narrow."""
    narrow = [(t, t.narrowest) for t in trusts if t.narrow and t.narrowest is not None]
    if not narrow:
        return
    logs = dict.fromkeys(literal(space.log) for _, space in narrow)
    names = [title(t.joint) if len(logs) == 1 else f"{title(t.joint)} in {literal(space.log)}" for t, space in narrow]
    where = as_list(names) + (f", {next(iter(logs))}" if len(logs) == 1 else "")
    shares = as_list([verdicts.covered_share(space) for _, space in narrow])
    text = f"**{where}**: the 95 % band is too narrow: it covers only {shares} of free-space samples."
    if not all(t.share > verdicts.CAUTION for t, _ in narrow):  # else more logs do not calibrate it: the model is wrong
        text += f" {explanation('narrow-band')}"
    reach = {(share.log, share.joint): share.speed_ratio for share in context.catalogue.records(PathShare)}
    most = verdicts.MAX_SPEED_RATIO  # above which it is a caveat of its own
    ratios = {t.joint: reach.get((space.log, t.joint), 0.0) for t, space in narrow}
    faster = [f"{title(joint)} {ratio:.2g} times" for joint, ratio in ratios.items() if FASTER < ratio <= most]
    text += f" There it is faster than in any fitted log, so the model extrapolates: {as_list(faster)}." * bool(faster)
    others = (
        offset_remedy(context, p)
        for t, space in narrow
        for p in scored_predictions(context, t.joint)
        if p.log == space.log and not (p == t.prediction and t.share > verdicts.GOOD)
    )
    text += next(filter(None, others), "")
    least = min(space.coverage for _, space in narrow)
    weight = min(1.0 + 10 * (verdicts.COVERED[0] - least), MAX_NARROW)
    yield weight, f"{text}{see(context, Track, 'runs')}"


def see(context: Context, kind: type[Record], anchor: str) -> str:
    """A reference to a section, or "" where no record of that kind exists and so the section is missing."""
    return f" See [@{anchor}]." if context.catalogue.records(kind) else ""
