"""The methods behind the numbers, with their equations."""

import re
from collections.abc import Iterator
from pathlib import Path
from textwrap import fill

from davinci_forces.files import read_bytes, text_of
from davinci_forces.records import KINDS, LogSummary, Trajectory
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.report.content import Block, Bullets, Equation, Listing, Prose, Section, Table
from davinci_forces.report.context import Context, count
from davinci_forces.report.sections.parts import chapters, of_joint, section_of, trust
from davinci_forces.report.verdicts import percent, thresholds

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
    logs = {log for fit in context.own_fits() for log in fit.logs}
    summaries = [summary for summary in context.catalogue.records(LogSummary) if summary.log in logs]
    rates = " to ".join(dict.fromkeys(f"{rate:.4g}" for rate in sorted(s.rate for s in summaries)))
    averaged = ", averaged over periods" if context.catalogue.records(Trajectory) else ""
    slowest = f"the slowest that shows 90 % of a push of 1 s at most {settings.delay:g} s late"
    walk = f"of intensity {settings.q_tau:g} effort/s^0.5" if settings.q_tau else f"({slowest})"
    scores = "; ".join(filter(None, (unseen_score(context, joint.name) for joint in robot.joints))) or "none"
    logs_in_words = count(len(logs), "simulated log" if context.study.simulated else "recording")
    kind = "a simulated arm" if context.study.simulated else "an arm"
    return fill(
        f"External efforts of {kind} ({robot.title}) were estimated from motor efforts and joint positions with "
        f"davinci-forces {context.provenance.version} (code {context.provenance.code}). Parameters were identified "
        f"from {logs_in_words} ({', '.join(sorted(logs))}) of "
        f"{sum(s.duration for s in summaries):.0f} s in all at {rates} Hz{averaged}; the model was "
        f"{'selected by cross-validation over blocks of path' if settings.fit == CHOSEN else settings.fit}. Model, "
        "error (root mean square, beyond noise) on unseen data, and level below which 99 % of free-motion samples "
        f"stay: {scores}. For the errors, effort and prediction passed one low-pass of {settings.lowpass:g} "
        "Hz without delay. The external effort was tracked by an extended Kalman filter with position, velocity and "
        f"external effort as states, the last as a random walk {walk}. Standard errors (±) allow for "
        "autocorrelation, by restricted likelihood (Patterson and Thompson, 1971) or blocks (Künsch, 1989).",
        88, break_on_hyphens=False,
    )  # fmt: skip


def unseen_score(context: Context, joint: str) -> str:
    """The model that a joint's effort was judged with, its error on the worst unseen log, and its detection level."""
    trusted = trust(context, joint)
    if (p := trusted.prediction) is None:
        return ""
    error, level = context.number(f"{p.prefix}.model_error", 2), ""
    if trusted.space is not None:
        level = f", level {context.number(f'{trusted.space.prefix}.detection_level', 2)}"
    model = context.used_fit(joint)
    if (used := context.used_record(joint)) is not None:
        friction = ", ".join(name for name in of_joint(used, joint).values() if "friction" in name)
        model = f"{used.structure}, {len(used)} parameters with {friction}, by {used.estimator}"
    where = f"{p.log}, on the fitted path" if trusted.same_path else p.log
    return (
        f"{joint.replace('_', ' ')}: {model}; error {error} ({percent(trusted.share)} of the effort) on {where}{level}"
    )
