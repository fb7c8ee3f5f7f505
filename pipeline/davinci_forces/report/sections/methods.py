"""The methods behind the numbers, with their equations."""

import re
from collections.abc import Iterator, Sequence
from math import isfinite
from pathlib import Path
from textwrap import fill

from davinci_forces.estimators import title_of
from davinci_forces.files import read_bytes, text_of
from davinci_forces.records import KINDS, Fit, LogSummary, Motion, Weight
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.records.record import as_list
from davinci_forces.report.content import Block, Bullets, Equation, Listing, Prose, Section, Table
from davinci_forces.report.context import Context, count
from davinci_forces.report.sections import parts
from davinci_forces.report.sections.parts import chapters, explanation, grade_of_mass, of_joint, section_of, trust
from davinci_forces.report.verdicts import error_share, thresholds

BIBLIOGRAPHY = Path(__file__).with_name("references.bib")
ENTRY, FIELD = re.compile(r"@\w+\{.*?^\}", re.M | re.S), re.compile(r"^  (\w+) = \{(.*)\},$", re.M)


@section_of("Methods", "methods")
def section(context: Context) -> Iterator[Block]:
    """Prose and equations in the order of the stages; symbols, thresholds, a paragraph for a paper, and references."""
    methods = chapters("methods.md")
    symbols = methods.pop("Symbols")
    for method in (method for kind, method in methods.items() if context.catalogue.records(KINDS[kind])):
        blocks = method.replace("{lowpass}", f"{context.study.settings.lowpass:g}").split("\n\n")
        yield from map(method_block, blocks)
    header = ("Quantity", "Measure", "Good", "Caution", "Problem")
    yield Table("The thresholds of the verdicts of this report.", header, thresholds(), "thresholds", "lllll")
    rows = [tuple(line.split(" | ")) for line in symbols.split("\n")]
    yield Table("Symbols.", ("Symbol", "Is", "Unit"), rows, "symbols", "lll")
    if context.own_fits():
        yield Section("A paragraph for a paper", "paragraph", (Listing(paragraph_for_paper(context)),))
    references = tuple(map(reference, ENTRY.findall(bibliography())))
    yield Section("References", "references", (Bullets(references),))


def method_block(paragraph: str) -> Prose | Equation:
    """A paragraph of methods.md: prose, or lines with the label, the maths and the description of an equation."""
    if paragraph.startswith("equation: "):
        label, typst, alt = paragraph.removeprefix("equation: ").split("\n")
        return Equation(typst, alt, label)
    return Prose(paragraph.replace("\n", " "))


def bibliography() -> str:
    """The references as BibTeX, which stands beside the report."""
    return text_of(read_bytes(BIBLIOGRAPHY))


def reference(entry: str) -> str:
    """A BibTeX entry as the report prints it, with its DOI if there is one."""
    has = dict(FIELD.findall(entry))
    names = [" ".join(reversed(name.split(", "))) for name in has.get("author", "").split(" and ")]
    place = next((has[name] for name in ("journal", "booktitle", "publisher", "school") if name in has), "")
    issue = f" {has['volume']} ({has['number']}), {has['pages'].replace('--', '–')}" if "volume" in has else ""
    doi = f", doi:{has['doi']}" if "doi" in has else ""
    text = f"{', '.join(names)}: {has['title']}. {place}{issue}, {has.get('year', '')}{doi}."
    return text.removeprefix(": ").replace(", .", ".")


def paragraph_for_paper(context: Context) -> str:
    """A paragraph on the method with this study's numbers, for a paper."""
    settings, robot = context.study.settings, context.study.robot
    fits = {fit.key: fit for joint in robot.joints if (fit := context.shown_fit(joint.name)) is not None}.values()
    together = [
        f" One model with {len(fit)} parameters describes {as_list(context.efforts_of(fit))} together."
        for fit in fits if len(context.efforts_of(fit)) > 1
    ]  # fmt: skip
    slowest = f"the slowest that shows 90 % of a push of 1 s at most {settings.delay:g} s late"
    masses = [
        f"{weight.stated_mass:g} kg was estimated as {context.number(f'weight.{weight.log}.mass', 2)}"
        + " (and gave a torque constant in use)" * (grade_of_mass(context, weight)[1] == "taken")
        for weight in context.catalogue.records(Weight) if isfinite(weight.stated_mass)
    ]  # fmt: skip
    spaces = [context.worst_space(joint.name) for joint in robot.joints]
    unfitted = all(space.role != "identification" for space in spaces if space is not None)
    is_logged = any(motion.velocity == "logged" for motion in context.catalogue.records(Motion))
    paragraph = explanation(
        "paper",
        arm=f"{'a simulated arm' if context.study.simulated else 'an arm'} ({robot.title})",
        efforts=efforts_in_words(context),
        motion="joint positions and velocities" if is_logged else "joint positions",
        version=f"{context.provenance.version} (code {context.provenance.code})",
        data="; and from ".join(data_in_words(context, [*fits])),
        chosen="selected by cross-validation over blocks of path" if settings.fit == CHOSEN else settings.fit,
        scores="; ".join(filter(None, (unseen_score(context, joint.name) for joint in robot.joints))) or "none",
        together="".join(together).replace("_", " "),
        lowpass=f"{settings.lowpass:g}",
        walk=f"of intensity {settings.q_tau:g} effort/s^0.5" if settings.q_tau else f"({slowest})",
        unfitted=parts.UNFITTED if unfitted else " (of those that no fit used, if there are any)",
        masses=f" Of known masses, {as_list(masses)}." if masses else "",
    )
    return fill(paragraph, 88, break_on_hyphens=False)


def efforts_in_words(context: Context) -> str:
    """What the efforts of the joints that have a fit come from."""
    by_current, joints = context.study.joints_by_current, context.study.robot.joints
    return ", ".join(dict.fromkeys(
        "motor currents, assumed torque constants" if joint in by_current
        else "motor currents in A" if joint.effort else "motor efforts"
        for joint in joints if context.shown_fit(joint.name) is not None
    ))  # fmt: skip


def data_in_words(context: Context, fits: Sequence[Fit]) -> Iterator[str]:
    """What models were fitted to: all motion or averaged periods, with their rate, the used time, and the periods."""
    kind = "simulated log" if context.study.simulated else "recording"
    for is_averaged, data in ((False, "all motion in"), (True, "averages over the whole periods of")):
        names = {log for fit in fits if bool(fit.periods) is is_averaged for log in fit.logs}
        seconds, rates, motions = 0.0, list[float](), dict[str, list[str]]()
        for summary in (summary for summary in context.catalogue.records(LogSummary) if summary.log in names):
            used, motion, key = moving_time(context, summary.log), "no period", f"period.{summary.log}"
            if key in context.results:
                periods = round(context.results[f"{key}.periods"].value)
                used = periods * context.results[key].value if is_averaged else used
                whole = f"{count(periods, 'period')} of {context.number(key, 4, std=None)}"
                motion = whole if is_averaged else f"with {whole}"
            seconds += used
            rates.append(summary.rate)
            motions.setdefault(motion, []).append(summary.log)
        if rates:
            rate = " to ".join(dict.fromkeys(f"{of(rates):.4g}" for of in (min, max)))
            each = {motion: " each" * (len(logs) > 1 and motion != "no period") for motion, logs in motions.items()}
            listed = "; ".join(f"{', '.join(sorted(logs))}: {motion}{each[motion]}" for motion, logs in motions.items())
            yield f"{data} {count(len(rates), kind)} at {rate} Hz, {seconds:.0f} s in all ({listed})"


def moving_time(context: Context, log: str) -> float:
    """The time [s] of a log in which a joint moved and was measured, which is fitted where nothing is averaged."""
    motions = [motion for motion in context.catalogue.select(Motion, log=log) if not motion.at_rest]
    return max((float(sum((of.standing == 0) & (of.filled == 0))) / of.rate for of in motions), default=0.0)


def unseen_score(context: Context, joint: str) -> str:
    """The model that a joint's effort was judged with, its error on the worst unseen log, its levels and coverage."""
    trusted, fit = trust(context, joint), context.shown_fit(joint)
    if (p := trusted.prediction) is None or fit is None:
        return ""
    efforts = context.efforts_of(fit)
    parts = [] if len(efforts) > 1 else [count(len(fit), "parameter")]
    terms = as_list([name.replace(",", "") for name in of_joint(fit, joint).values()]) or "no term"
    parts += [f"besides the effort of the links {terms}" if len(efforts) > 1 else terms]
    parts += [] if fit.periods else [f"low-pass of {fit.cutoff[efforts.index(joint)]:g} Hz"]
    where = f"{p.log}, on the fitted path" if trusted.same_path else p.log
    error = f"error {context.number(f'{p.prefix}.model_error', 2)} ({error_share(p)} of the effort) on {where}"
    levels = ("detection level", "alarm level")
    keys = {name: f"threshold.{joint}.{name.replace(' ', '_')}" for name in levels}
    keys["mean coverage"] = f"band.{joint}.coverage"
    scores = [error, *(f"{name} {context.number(key, 2)}" for name, key in keys.items() if key in context.results)]
    model = f"{fit.structure} model by {title_of(fit.estimator)} ({', '.join(parts)})"
    return f"{joint.replace('_', ' ')}: {model}, {', '.join(scores)}"
