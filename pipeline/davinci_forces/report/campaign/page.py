"""The page of a campaign: an overview, then every joint with its numbers over time, study by study."""

from collections.abc import Iterator, Sequence

import numpy as np

from davinci_forces.report.campaign.studies import FLOORS, Campaigned, Findings, Series, joints_of, place
from davinci_forces.report.content import (
    Block,
    Bullets,
    Cell,
    Document,
    Figure,
    Number,
    Panel,
    Points,
    Prose,
    Section,
    Table,
    Verdict,
    literal,
)
from davinci_forces.report.content.marks import AnyMark
from davinci_forces.report.context import count, title
from davinci_forces.report.results import format_unit
from davinci_forces.report.verdicts import WORDS
from davinci_forces.report.writers import render_all


def page(studies: Sequence[Campaigned], left_out: Sequence[str], told: Findings) -> dict[str, bytes]:
    """campaign.html and campaign.pdf of studies in their order; `left_out` names those that have no results."""
    sections = (
        Section("The campaign", "campaign", tuple(overview(studies, left_out, told))),
        *(joint_section(joint, studies, told) for joint in joints_of(studies)),
    )
    simulated = any(study.simulated for study in studies)
    heading = "1 study" if len(studies) == 1 else f"{len(studies)} studies"
    return render_all((Document("Campaign", heading, simulated, sections, "", "campaign", links=()),))


def overview(studies: Sequence[Campaigned], left_out: Sequence[str], told: Findings) -> Iterator[Block]:
    """What there is, what drifts, and one row a study."""
    dates = f", recorded from {studies[0].started[:10]} to {studies[-1].started[:10]}" if told.by_date else ""
    undated = " Their logs do not all say when they were recorded, so they are in the order in which they are named."
    order = "" if told.by_date else undated
    yield Prose(
        f"{count(len(studies), 'report')}{dates}, each row linked to its own.{order} Parameters are those of each "
        "joint by itself, by least squares. A number drifts where a weighted line through it has a slope beyond its "
        "standard error, varies where its studies scatter about one mean by more than their errors, and a study "
        "stands out where it is far from the mean of the others; errors of a line are widened where values scatter. "
        f"Of all {told.tests} tests together, the chance that any tells falsely is {100 * told.chance:.0f} %."
    )
    if left_out:
        names = ", ".join(f"`{literal(name)}`" for name in left_out)
        yield Verdict("info", f"Left out, as they have no results: {names}. `davinci-forces all` makes them.")
    said = tuple(finding(one, told) for one in told.every if place(one) in told.slopes or place(one) in told.varying)
    said += tuple(text for one in told.every for text in outliers_in_words(one, told))
    if said:
        yield Verdict("warn", "**Beyond standard errors:**")
        yield Bullets(said)
    else:
        yield Verdict("good", "No number drifts, varies or stands out beyond its standard errors.")
    joints = joints_of(studies)
    rows = tuple((date(study), study.link, *(word(study, joint) for joint in joints)) for study in studies)
    header = ("Recorded", "Study", *map(title, joints))
    yield Table("The verdict of every joint in every study.", header, rows, "campaign-studies", "l" * len(header))


def finding(one: Series, told: Findings) -> str:
    """What a series does, in words."""
    name = f"**{title(one.joint)}, {literal(words(one.name))}**"
    if line := told.slopes.get(place(one)):
        slope = Number(line.value, f"{format_unit(one.unit)} a {told.unit}".strip(), line.std)
        return f"{name} drifts by {literal(str(slope))} over {len(one.value)} studies."
    return f"{name} varies by more than its standard errors, without a trend."


def outliers_in_words(one: Series, told: Findings) -> Iterator[str]:
    """Studies that stand out."""
    for i in told.stand_out(one):
        shown = Number(float(one.value[i]), format_unit(one.unit), float(one.std[i]))
        where = f"{title(one.joint)}, {literal(words(one.name))}"
        yield f"{one.studies[i].link} stands out: **{where}** is {literal(str(shown))}."


def date(study: Campaigned) -> str:
    """The day of its first log."""
    return study.started[:10] if study.when else "–"


def word(study: Campaigned, joint: str) -> str:
    """The verdict of one joint."""
    judged = study.joints.get(joint)
    return WORDS[judged.verdict] + (", same path" if judged.same_path else "") if judged else "–"


def joint_section(joint: str, studies: Sequence[Campaigned], told: Findings) -> Section:
    """The numbers of one joint, drawn and listed."""
    own = [one for one in told.every if one.joint == joint]
    names = list(dict.fromkeys(one.name for one in own))
    odd = sorted({one.name for one in own if told.tell(one)})
    spoken = f"beyond errors: {', '.join(odd)}" if odd else "none changes beyond its errors"
    drawn = [one for one in own if len(one.studies) > 1]  # a single one is no course over time
    figure = Figure(
        f"{title(joint)}: its parameters and how far it is to be trusted, with standard errors, study by study; "
        "studies that stand out are named.",
        f"{title(joint)}: {count(len(names), 'number')} over {len(studies)} studies; {spoken}.",
        tuple(panel(one, told) for one in drawn),
        f"campaign-{joint}",
        columns=2,
        height=34,
    )
    floors = [name for name in names if name in FLOORS.values()]
    parameters = [name for name in names if name not in floors]
    tables = (
        table(joint, "parameters", "parameters", parameters, own, studies),
        table(joint, "how far to trust it", "floors", floors, own, studies),
    )
    return Section(title(joint), f"joint-{joint}", (*([figure] if drawn else []), *tables))


def table(
    joint: str, said: str, label: str, names: Sequence[str], own: Sequence[Series], studies: Sequence[Campaigned]
) -> Table:
    """Some numbers of a joint, one row a study."""
    keys = {(one.name, study.name): key for one in own for study, key in zip(one.studies, one.keys, strict=True)}
    verdict = label == "floors"
    rows = tuple(
        (
            date(study),
            study.link,
            *([word(study, joint)] if verdict else []),
            *(cell(study, keys.get((name, study.name))) for name in names),
        )
        for study in studies
        if joint in study.joints
    )
    heads = [words(name)[:1].upper() + words(name)[1:] for name in names]
    header = ("Recorded", "Study", *(["Verdict"] if verdict else []), *map(literal, heads))
    align = ("lll" if verdict else "ll") + "r" * len(names)
    return Table(f"{title(joint)}: {said}, in every study.", header, rows, f"campaign-{joint}-{label}", align)


def words(name: str) -> str:
    """A number's name as it is printed."""
    return name.replace("_", " ")


def cell(study: Campaigned, key: str | None) -> Cell:
    """A number of a study, or a dash."""
    stated = study.numbers.get(key) if key else None
    if stated is None or stated.number is None:
        return "–"
    return Number(stated.number, format_unit(stated.unit), stated.std, key, 3)


def panel(one: Series, told: Findings) -> Panel:
    """One number over time."""
    t, out = told.times(one), list(told.stand_out(one))
    inside = [i for i in range(len(t)) if i not in out]
    std = np.nan_to_num(one.std)
    marks: list[AnyMark] = [Points(t[inside], one.value[inside], "", "blue", std[inside])] if inside else []
    if out:
        names = tuple(one.studies[i].name for i in out)
        marks.append(Points(t[out], one.value[out], "", "vermillion", std[out], names))
    unit = format_unit(one.unit)
    x_label = "time [days from the first]" if told.by_date else "study"
    name = words(one.name)
    x_range = None if told.by_date else (min(told.time.values()) - 0.5, max(told.time.values()) + 0.5)
    return Panel(name, x_label, f"{name} [{unit}]" if unit else name, tuple(marks), x_range)
