"""The verdict on a study in a sentence, what it measured, and its sign-off."""

from collections.abc import Iterator, Sequence
from hashlib import sha256

import numpy as np

from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records import Contact, HandLimit, Stiffness, TipContact, TipForce, Weight
from davinci_forces.records.record import as_list, groups_of
from davinci_forces.report import verdicts
from davinci_forces.report.content import Level, Number, Prose, Verdict, literal
from davinci_forces.report.context import Context, count, name_in_sentence
from davinci_forces.report.sections.parts import RATINGS, grade_of_mass
from davinci_forces.report.verdicts import DETECTABLE, WORDS, Trust, band, doubt_of_mass, percent, stiffness_level
from davinci_forces.robots.robot import TIP_JOINTS
from davinci_forces.study.review import STUDY

MAX_MEASURED = 4  # forces, masses and stiffnesses on page one
MIN_QUARTILES = 4  # pushes, below which quartiles are interpolated rather than observed
WHY_CAUTION = {  # of a mass, by what `mass_level` says
    "side": ", as the other side of its link explains the efforts better", "joints": ", as its joints differ",
    "sign": ", as it is negative", "scale": ", as its 95 % interval excludes the stated one",
    "wide": f", as its error exceeds {percent(verdicts.PRECISE)}",
}  # fmt: skip
MAX_NAMED = 3  # joints that a clause of the verdict names
TO_SIGN = "Reviewed by ______________________ on ______________   ☐ accept   ☐ accept with remarks   ☐ reject"


def verdict_sentence(context: Context, trusts: Sequence[Trust]) -> str:
    """The verdict on the study by the rules of the table: efforts that stand out, and what limits the others."""
    levels = [
        f"{context.number(f'threshold.{t.joint}.alarm_level', 2, std=None)} on {name_in_sentence(t.joint)}"
        + " (whose 95 % band is too narrow)" * t.narrow
        for t in trusts
        if t.space is not None and t.level != "bad"
    ]
    parts = [f"the smallest effort that stands out from free motion (alarm level) is {as_list(levels)}"] * bool(levels)
    parts += errors([trusted for trusted in trusts if trusted.level != "good" and trusted.space is not None])
    narrow = [t for t in trusts if t.narrow and t.level == "bad"]  # `levels` names the others
    unseen = [t for t in trusts if t.space is None]
    for why, some in (("the 95 % band is too narrow", narrow), ("no effort was estimated in free space", unseen)):
        names = [name_in_sentence(t.joint).removeprefix("the " if i else "") for i, t in enumerate(some)]
        which = as_list(names) if len(names) <= MAX_NAMED else f"{len(names)} of {len(trusts)} joints"
        parts += [f"{why} on {which}"] if names else []
    roles = {trusted.space.role for trusted in trusts if trusted.space is not None}
    if roles and not any(trusted.narrow for trusted in trusts):
        where = "in free motion" if "identification" in roles else "in free motion that was not fitted,"
        spaces = [(name_in_sentence(t.joint), s) for t in trusts if (s := t.narrowest) is not None]
        wide = [name for name, s in spaces if verdicts.band_in_words(s.coverage, s.coverage_std) == "too wide"]
        width = f"is too wide on {as_list(wide)}, and too narrow on none" if wide else "of each joint is wide enough"
        parts += [f"{where} the 95 % band {width}"]
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}."


def errors(trusts: Sequence[Trust]) -> Iterator[str]:
    """State the model errors of joints that are not fine, those of one kind of path and one verdict together."""
    kinds: dict[tuple[str, str], list[str]] = {}
    for trusted in trusts:
        name = name_in_sentence(trusted.joint)
        path = "the fitted path" if trusted.same_path else "an unseen path"
        level, error = trusted.level, f"{verdicts.error_share(trusted.prediction)} on {name}"
        if trusted.fineness > DETECTABLE:
            level, error = "bad", f"{error}, whose detection level is above the effort sought"
        kinds.setdefault((path, "too much to be believed" if level == "bad" else ""), []).append(error)
    for (path, why), joints in kinds.items():
        whose = "its" if len(joints) == 1 else "their"
        caution = f"so judge {whose} efforts with caution"
        if path == "the fitted path":
            caution = "and another path was not tested, on which it may err more"
        yield f"on {path} the model errs by {as_list(joints)}, {why or caution}"


def measurements(context: Context) -> tuple[str, ...]:
    """The largest forces at the tip, the masses beside the stated ones, and the stiffnesses, a line each."""
    lines = [*forces_at_tip(context), *masses(context), *stiffnesses(context)]
    more = [f"{count(len(lines) - MAX_MEASURED, 'more log')}: see the contents."] if lines[MAX_MEASURED:] else []
    return (*lines[:MAX_MEASURED], *more, *feedback(context))


def feedback(context: Context) -> Iterator[str]:
    """The stiffest tissue that haptic feedback could render stably to each simulated hand."""
    limits = [limit for limit in context.catalogue.records(HandLimit) if np.isfinite(limit.k_t_limit)]
    doubts = [" (cannot be told from none)" * (x.k_t_limit <= NORMAL_95 * x.k_t_limit_std) for x in limits]
    rendered = [
        f"{context.number(f'stability.{limit.hand}.k_t_limit', 3)} with hand “{literal(limit.hand)}” "
        f"({limit.hand_mass:.3g} kg, {limit.hand_damping:.3g} N s/m, {limit.hand_stiffness:.3g} N/m){doubt}"
        for limit, doubt in zip(limits, doubts, strict=True)
    ]
    if rendered:
        yield f"Haptic feedback, simulated: stable on tissue up to {as_list(rendered)}"


def forces_at_tip(context: Context) -> Iterator[str]:
    """The largest force at the tip in the contacts of each log, with its standard error."""
    contacts = context.catalogue.records(TipContact)
    sought = [contact for contact in contacts if context.study.log(contact.log).role != "identification"]
    for contact in sought or contacts:
        row = int(np.argmax(contact.f_peak))
        largest, x, y, z = context.numbers(f"tip.{contact.log}.{row + 1}", ("peak", "f_x", "f_y", "f_z"))
        of_all = f", the largest of {len(contact)}" * (len(contact) > 1)
        coverage = [force.force_coverage for force in context.catalogue.select(TipForce, log=contact.log)]
        level = f"tip.{contact.log}.detection_level"
        free = f"; without contact, 99 % stay below {context.number(level, 2)}" if level in context.results else ""
        narrow = [share for share in coverage if band(share) == "bad"]
        beside = f"; its 95 % band covers only {percent(narrow[0])} of free space" if narrow else ""
        start, end = float(contact.onset[row]), float(contact.release[row])
        touched = [
            of for of in context.catalogue.select(Contact, log=contact.log)
            if (of.above.astype(bool) & (of.onset < end) & (of.release > start)).any()
        ]  # fmt: skip
        alone = "; only one joint shows it, as a touch elsewhere would" * (len(touched) == 1)
        yield (
            f"**{literal(contact.log)}**: force by the arm at its tip up to {largest} "
            f"({start:.1f} to {end:.1f} s{of_all}; in the base’s axes x: {x}, y: {y}, z: {z}), "
            f"if the arm was touched at its tip alone{alone}{free}{beside}"
        )
    robot = context.study.robot
    if robot.chain is not None and not context.catalogue.records(TipForce):
        if len(robot.joints) != TIP_JOINTS:
            yield f"No force at the tip: that takes an arm of {TIP_JOINTS} joints, and this one has {len(robot.joints)}"
        elif any(joint.effort for joint in robot.joints):  # in A
            yield "No force at the tip: that takes the torque constants of all joints"


def masses(context: Context) -> Iterator[str]:
    """The mass of each weight log with its standard error, and the stated one."""
    for weight in context.catalogue.records(Weight):
        mass = context.number(f"weight.{weight.log}.mass", 3)
        stated = f", stated {weight.stated_mass:g} kg" if np.isfinite(weight.stated_mass) else ""
        is_uncertain = bool(np.isnan(weight.joint_offset).all())
        what = f"a change of its offset since {literal(weight.tare)}" if weight.tare else "an offset of the effort"
        offset = f" ({what} would count as mass)" * is_uncertain
        level, why = grade_of_mass(context, weight)
        stated += ", which seems to have given a torque constant in use: no test of it" * (why == "taken")
        verdict = verdict_at_end(level) + WHY_CAUTION.get(why, "")
        yield f"**{literal(weight.log)}**: mass {mass}{offset}{doubt_of_mass(weight)}{stated}{verdict}"


def verdict_at_end(level: Level) -> str:
    """A verdict at the end of a line, if it is one."""
    return f": {WORDS[level]}" if level in WORDS else ""


def stiffnesses(context: Context) -> Iterator[str]:
    """The stiffness of each tissue log with its standard error, and the quartiles of its pushes."""
    for log in context.catalogue.records(Stiffness):
        level = stiffness_level(log, context.true_stiffness(log.log))
        stiffness, low, high = context.numbers(f"tissue.{log.log}", ("stiffness", "stiffness_q1", "stiffness_q3"))
        quartiles = f", quartiles {low} and {high}" if log.pushes >= MIN_QUARTILES else ""
        why = "; a straight line explains less than 90 % of the others" if log.pushes < len(log) else ""
        used = f" ({log.pushes} of {count(len(log), 'push')}{why})"
        yield f"**{literal(log.log)}**: stiffness {stiffness}{quartiles}{used}{verdict_at_end(level)}"


def currents_in_words(context: Context) -> str:
    """State by which constants motor currents became efforts; "" if none did."""
    joints = context.study.joints_by_current
    numbers = (str(Number(joint.effort_per_ampere, joint.unit("{effort}"), digits=3)) for joint in joints)
    alike = groups_of(zip(numbers, (name_in_sentence(joint.name) for joint in joints), strict=True))
    factors = [
        f"{factor} on {as_list(names) if len(names) <= MAX_NAMED else f'each of {len(names)} joints'}"
        for factor, names in alike.items()
    ]
    is_listed = any(joint.name not in context.study.changed for joint in joints)
    whose = " (by the robot’s description: check your drives)" if is_listed else ""
    tested = any(np.isfinite(weight.stated_mass) for weight in context.catalogue.records(Weight))
    untested = "" if tested else "; no known mass tests that, and all efforts scale with it"
    factors_in_words = f" 1 A of a motor counts as {'; '.join(factors)}{whose}; no ± holds the error of that{untested}."
    return factors_in_words if factors else ""


def nothing_identified(context: Context) -> Iterator[Verdict]:
    """State that no joint was identified, which is a problem only of a study that measured nothing else."""
    text = (
        "No log is for identification, so no model of a joint was identified and no effort was tracked. Record each "
        "joint on a periodic path, and give that log the role identification."
    )
    if context.study.logs and any(log.role == "identification" for log in context.study.logs):
        text = "No joint could be identified: there is no usable identification log, so no effort was tracked."
    others = [*context.catalogue.records(Stiffness), *context.catalogue.records(Weight)]
    yield Verdict("info" if others else "bad", text)


def sign_off(context: Context) -> Prose:
    """The line for a reviewer's signature, or the verdict on the study in review.toml."""
    signed = next((rating for rating in reversed(context.ratings) if rating.subject == STUDY), None)
    if signed is None:
        return Prose(TO_SIGN)
    date = f" on {literal(signed.date)}" if signed.date else ""
    words = f" {literal(signed.comment)}" if signed.comment else ""
    same = signed.results == sha256(context.results.json()).hexdigest()
    changed = "" if same else " **The numbers have changed since.**"
    return Prose(f"Reviewed by {literal(signed.reviewer) or '–'}{date}: **{RATINGS[signed.verdict]}**.{words}{changed}")
