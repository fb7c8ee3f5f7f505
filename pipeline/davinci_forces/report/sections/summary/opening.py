"""The verdict on a study in a sentence, what it measured, and its sign-off."""

from collections.abc import Iterator, Sequence
from hashlib import sha256

import numpy as np

from davinci_forces.records import Stiffness, Weight
from davinci_forces.report.content import Block, Bullets, Prose, Verdict, literal
from davinci_forces.report.context import Context, count
from davinci_forces.report.sections import tissue
from davinci_forces.report.sections.review import MARKS
from davinci_forces.report.verdicts import DETECTABLE, WORDS, Trust, band_in_words, mass_level, percent
from davinci_forces.study.review import STUDY

MAX_MEASURED = 4  # masses and stiffnesses on page one
TO_SIGN = "Reviewed by ______________________ on ______________   ☐ accept   ☐ accept with remarks   ☐ reject"


def verdict_sentence(context: Context, trusts: Sequence[Trust]) -> str:
    """The verdict on the study by the rules of the table: efforts that can be believed, and what limits the others."""
    fine = [trusted for trusted in trusts if trusted.level == "good" and not trusted.narrow and trusted.space]
    levels = [
        f"above {context.size(trusted.space, 'detection_level', trusted.space.detection_level)} on the "
        f"{name_in_sentence(trusted.joint)}"
        for trusted in fine
        if trusted.space is not None
    ]
    believed = [f"efforts {listed(levels)} can be believed"] if levels else []
    text = "; ".join([*believed, *(doubt(trusted) for trusted in trusts if trusted not in fine)])
    return f"{text[:1].upper()}{text[1:]}."


def doubt(trusted: Trust) -> str:
    """State what limits the trust in a joint."""
    name = f"the {name_in_sentence(trusted.joint)}"
    if trusted.prediction is None:
        return f"{name} was not tested on any run"
    path = "the path that was fitted" if trusted.same_path else "an unseen path"
    too_much = ", too much to be believed" if trusted.level == "bad" and not trusted.sought else ""
    hidden = ", and efforts that the study seeks are hidden" if trusted.fineness > DETECTABLE else ""
    band = f"; its band is {band_in_words(trusted.space.coverage)}" if trusted.space is not None else ""
    return f"{name} errs by {percent(trusted.share)} on {path}{too_much}{hidden}{band}"


def name_in_sentence(joint: str) -> str:
    """The name of a joint within a sentence."""
    return literal(joint.replace("_", " "))


def listed(parts: Sequence[str]) -> str:
    """Parts of a sentence as a list: 'a, b and c'."""
    return " and ".join(", ".join(parts).rsplit(", ", 1))


def measured(context: Context) -> Iterator[Block]:
    """The masses beside the stated ones and the stiffnesses with their quartiles, with verdicts."""
    texts = [*masses(context), *stiffnesses(context)]
    if texts:
        more = f" [{count(len(texts) - MAX_MEASURED, 'more log')} below.]" if texts[MAX_MEASURED:] else ""
        yield Prose(f"**Measured:**{more}")
        yield Bullets(tuple(texts[:MAX_MEASURED]))


def masses(context: Context) -> Iterator[str]:
    """The mass of each weight log with its standard error, and the stated one."""
    for weight in context.catalogue.records(Weight):
        mass = context.number(f"weight.{weight.log}.mass", 3)
        stated = f", stated {weight.stated_mass:g} kg" if np.isfinite(weight.stated_mass) else ""
        text = f"**{literal(weight.log)}**: mass {mass}{stated}. See [@weight]."
        yield f"{WORDS.get(mass_level(weight)[0], '')} {text}".strip()


def stiffnesses(context: Context) -> Iterator[str]:
    """The stiffness of each tissue log with its standard error, and the quartiles of its pushes."""
    for log in context.catalogue.records(Stiffness):
        graded = tissue.verdict(context, log)
        low, high = context.numbers(f"tissue.{log.log}", ("stiffness_q1", "stiffness_q3"))
        quartiles = f" Half of the pushes lie between {low} and {high}." if log.pushes > 1 else ""
        yield f"{WORDS.get(graded.level, '')} {graded.text}{quartiles} See [@tissue].".strip()


def nothing_identified(context: Context) -> Iterator[Verdict]:
    """State that no joint was identified, which is a problem only of a study that measured nothing else."""
    text = "No log is for identification, so no model of a joint was identified and no effort was tracked."
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
    return Prose(f"Reviewed by {literal(signed.reviewer) or '–'}{date}: **{MARKS[signed.verdict]}**.{words}{changed}")
