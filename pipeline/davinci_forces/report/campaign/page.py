"""The page of a campaign: an overview, then every joint with its numbers over time, study by study."""

from collections.abc import Iterator, Sequence

import numpy as np

from davinci_forces.report.campaign.studies import FLOORS, CampaignStudy, Findings, Series, by_robot, joints_of
from davinci_forces.report.content import Block, Bullets, Cell, Document, Figure, Panel, Prose, Section, Table, Verdict
from davinci_forces.report.content.inline import literal
from davinci_forces.report.content.marks import AnyMark, Band, HLine, Points
from davinci_forces.report.content.number import Number
from davinci_forces.report.context import count, title
from davinci_forces.report.results import format_unit
from davinci_forces.report.sections.parts import explanation
from davinci_forces.report.verdicts import band, verdict_words
from davinci_forces.report.writers import render_all


def render_campaign(studies: Sequence[CampaignStudy], left_out: Sequence[str], findings: Findings) -> dict[str, bytes]:
    """campaign.html and campaign.pdf of studies in their order; `left_out` names those that have no results."""
    robots = by_robot(studies)
    sections = (
        Section("The campaign", "campaign", tuple(overview(studies, left_out, findings))),
        *(
            joint_section(joint, same, findings, f"{i}-{joint}" if i else joint, len(robots) > 1)
            for i, same in enumerate(robots.values())
            for joint in joints_of(same)
        ),
    )
    simulated = any(study.simulated for study in studies)
    heading = "1 study" if len(studies) == 1 else f"{len(studies)} studies"
    return render_all((Document("Campaign", heading, simulated, sections, "", "campaign", links=()),))


def overview(studies: Sequence[CampaignStudy], left_out: Sequence[str], findings: Findings) -> Iterator[Block]:
    """Prose, findings, and a table with one row a study."""
    dates = f", recorded from {studies[0].started[:10]} to {studies[-1].started[:10]}" if findings.by_date else ""
    undated = " Some logs state no date of recording, so studies are in the order in which they are named."
    order = "" if findings.by_date else undated
    reports, chance = count(len(studies), "report"), 100 * findings.chance
    yield Prose(explanation("campaign", reports=reports, dates=dates, order=order, tests=findings.tests, chance=chance))
    if left_out:
        names = ", ".join(f"`{literal(name)}`" for name in left_out)
        yield Verdict("info", f"Left out, as they have no results: {names}. Run `davinci-forces all` on them.")
    changes = [series for series in findings.every if series.key in {*findings.slopes, *findings.varying}]
    messages = [change_in_words(series, findings) for series in changes]
    for series in findings.every:
        for i in findings.outliers.get(series.key, ()):
            shown = Number(float(series.value[i]), format_unit(series.unit), float(series.std[i]))
            messages.append(f"{series.studies[i].link} stands out: **{where(series)}** is {literal(str(shown))}.")
    if messages:
        yield Verdict("warn", "**Beyond standard errors:**")
        yield Bullets(tuple(messages))
    else:
        yield Verdict("good", "No number drifts, varies or stands out beyond its standard errors.")
    for i, (robot, same) in enumerate(by_robot(studies).items()):
        joints = joints_of(same)
        rows = tuple((date(study), study.link, *(word(study, joint) for joint in joints)) for study in same)
        header, caption = ("Recorded", "Study", *map(title, joints)), "the verdict of every joint in every study."
        label = f"campaign-studies{f'-{i + 1}' if i else ''}"
        yield Table(f"{literal(robot)}: {caption}", header, rows, label, "l" * len(header))


def change_in_words(series: Series, findings: Findings) -> str:
    """State how a number drifts or varies."""
    name = f"**{where(series)}**"
    if line := findings.slopes.get(series.key):
        a_time = "a day" if findings.by_date else "a study"
        slope = Number(line[0], f"{format_unit(series.unit)} {a_time}".strip(), line[1])
        return f"{name} drifts by {literal(str(slope))} over {len(series.value)} studies."
    return f"{name} varies by more than its standard errors, without a trend."


def where(series: Series) -> str:
    """The joint and the number."""
    return f"{title(series.joint)}, {literal(series.name.replace('_', ' ').replace('coulomb', 'Coulomb'))}"


def date(study: CampaignStudy) -> str:
    """The date of the first log of a study."""
    return study.started[:10] if study.when else "–"


def word(study: CampaignStudy, joint: str) -> str:
    """The verdict on one joint in one study."""
    verdict = study.joints.get(joint)
    if verdict is None:
        return "–"
    coverage = study.numbers.get(verdict.keys.get("coverage") or "")
    narrow = coverage is not None and coverage.number is not None and band(coverage.number) == "bad"
    return verdict_words(verdict.verdict, verdict.same_path, narrow)


def joint_section(
    joint: str, studies: Sequence[CampaignStudy], findings: Findings, label: str, names_robot: bool
) -> Section:
    """The numbers of one joint of the robot of these studies, drawn and listed."""
    of_joint = [series for series in findings.every if (series.robot, series.joint) == (studies[0].robot, joint)]
    names = list(dict.fromkeys(series.name for series in of_joint))
    changing = {*findings.slopes, *findings.varying, *findings.outliers}
    changed = sorted({series.name for series in of_joint if series.key in changing})
    changes = f"beyond errors: {', '.join(changed)}" if changed else "none changes beyond its errors"
    drawn = [series for series in of_joint if len(series.studies) > 1]  # a series of one study is not drawn
    caption = explanation("campaign-joint", joint=title(joint), inside=100 * findings.inside)
    alt = f"{title(joint)}: {count(len(names), 'number')} over {len(studies)} studies; {changes}."
    panels = tuple(panel(series, findings) for series in drawn)
    figure = Figure(caption, alt, panels, f"campaign-{label}", columns=2, height=34)
    floors = [name for name in names if name in FLOORS.values()]
    parameters = [name for name in names if name not in floors]
    tables = (
        table(joint, "parameters", f"{label}-parameters", parameters, of_joint, studies),
        table(joint, "measures of trust", f"{label}-floors", floors, of_joint, studies),
    )
    heading = f"{title(joint)}, {literal(studies[0].robot)}" if names_robot else title(joint)
    return Section(heading, f"joint-{label}", (*([figure] if drawn else []), *tables))


def table(
    joint: str, content: str, label: str, names: Sequence[str], of_joint: Sequence[Series],
    studies: Sequence[CampaignStudy],
) -> Table:  # fmt: skip
    """Some numbers of a joint, one row a study."""
    keys = {(s.name, study.name): key for s in of_joint for study, key in zip(s.studies, s.keys, strict=True)}
    verdict, rows = label.endswith("floors"), []
    for study in (study for study in studies if joint in study.joints):
        numbers = (cell(study, keys.get((name, study.name))) for name in names)
        rows.append((date(study), study.link, *([word(study, joint)] if verdict else []), *numbers))
    header = ("Recorded", "Study", *(["Verdict"] if verdict else []), *map(title, names))
    align = ("lll" if verdict else "ll") + "r" * len(names)
    return Table(f"{title(joint)}: {content}, in every study.", header, tuple(rows), f"campaign-{label}", align)


def cell(study: CampaignStudy, key: str | None) -> Cell:
    """A number of a study, or a dash."""
    stated = study.numbers.get(key) if key else None
    if stated is None or stated.number is None:
        return "–"
    return Number(stated.number, format_unit(stated.unit), stated.std, key, 3)


def panel(series: Series, findings: Findings) -> Panel:
    """One number over time."""
    t, out = np.array([findings.time[study.name] for study in series.studies]), [*findings.outliers.get(series.key, ())]
    inside = [i for i in range(len(t)) if i not in out]
    std = np.nan_to_num(series.std)
    marks: list[AnyMark] = []
    if limits := findings.limits.get(series.key):
        centre, width = limits
        marks.append(Band(t[inside], centre - width, centre + width, "", "grey"))
        marks.append(HLine(centre, "", "grey", "solid"))
    if inside:
        marks.append(Points(t[inside], series.value[inside], "", "blue", std[inside]))
    if out:
        names = tuple(series.studies[i].name for i in out)
        marks.append(Points(t[out], series.value[out], "", "vermillion", std[out], names))
    unit = format_unit(series.unit)
    name, label = series.name.replace("_", " "), "" if findings.by_date else "study"
    x_range = None if findings.by_date else (min(findings.time.values()) - 0.5, max(findings.time.values()) + 0.5)
    heading = f"{name.partition(' of the ')[0]} [{unit}]" if unit else name  # beside the title, which has it all
    return Panel(name, label, heading, tuple(marks), x_range, x_dates=findings.by_date)
