"""Tests whether the filter's innovations are white, and the causes if they are not."""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Column, Explanation, Innovation, Track, Whiteness
from davinci_forces.report.content import Block, Figure, OnScreen, Panel, Prose, Table, in_format, literal
from davinci_forces.report.content.marks import AnyMark, Line
from davinci_forces.report.context import Context, count, label
from davinci_forces.report.sections import parts

FINDINGS = {  # from the best to the least known
    "white": "white throughout",
    "left out": "white outside contact, reversals, rests or transients",
    "mended": "white once tested causes are removed",
    "unexplained": "not white, and no tested cause explains it in full",
}
PRINTED_RUNS = 9  # largest number of runs in the table of the PDF
INNOVATION_FIELDS = (("innovation_q", "position"), ("innovation_dq", "velocity"))


@parts.section_of("Innovations", "innovations", Explanation)
def section(context: Context, explained: list[Explanation]) -> Iterator[Block]:
    """The verdict on every run, figures of the worst run of each joint, and every test on demand."""
    yield Prose(f"{parts.explanation('innovations')}\n\n{summary(explained)}")
    yield verdicts(context, explained)
    worst = {(space.joint, space.log) for e in explained if (space := context.worst_space(e.joint)) is not None}
    drawn = sorted((e for e in explained if (e.joint, e.log) in worst), key=lambda e: least_probability(e)[0])
    figures = [figure(context, e) for e in drawn]
    yield from parts.first_on_paper(figures, "Innovations of the worst run of each other joint", "innovations-worst")
    yield OnScreen("Tests of the innovations, run by run", "innovation-tests", (tests(context, explained),))
    causes = tuple(OnScreen(parts.run_name(e), f"why-{e.log}-{e.joint}", (trials(e),)) for e in explained)
    yield OnScreen(f"The tested causes in {count(len(causes), 'run')}", "innovation-runs", causes)


def summary(explained: list[Explanation]) -> str:
    """State how many runs are white, and how many are explained."""
    counts = Counter(e.finding for e in explained)
    numbers = ((counts[finding], words) for finding, words in FINDINGS.items() if counts[finding])
    findings = (f"{number} {'is' if number == 1 else 'are'} {words}" for number, words in numbers)
    return f"Of {count(len(explained), 'run')} of moving joints, {', '.join(findings)}."


def verdicts(context: Context, explained: list[Explanation]) -> Table:
    """The verdict on every run, in words."""
    rows = tuple(
        (*parts.run_cells(e), *context.numbers(f"ekf.{e.log}.{e.joint}", ("nis_q", "nis_dq")), literal(e.verdict))
        for e in explained
    )
    band = max((i.nis_high - 1.0 for i in context.catalogue.records(Innovation)), default=0.0)
    within = f" White innovations are within {band:.2g} of 1 in 95 of 100 runs." if band else ""
    caption = parts.explanation("innovation-verdicts", within=within, most=PRINTED_RUNS)
    header = ("Log", "Joint", "NIS of $q$", "NIS of $dot(q)$", "Verdict")
    order = sorted(range(len(rows)), key=lambda i: least_probability(explained[i])[0])
    return Table(caption, header, rows, "innovation-verdicts", "llrrl", tuple(sorted(order[:PRINTED_RUNS])))


def tests(context: Context, explained: list[Explanation]) -> Table:
    """Every test of every run."""
    rows = []
    for e in explained:
        key = f"ekf.{e.log}.{e.joint}"
        numbers = context.numbers(key, ("nis_mean", "acf1_q", "acf1_dq"), 2)
        white = context.probabilities(key, ("ljung_box_p_q", "ljung_box_p_dq", "periodogram_p_q", "periodogram_p_dq"))
        rows.append((*parts.run_cells(e), *numbers, *white, context.number(f"{key}.clock_std", 2)))
    caption = parts.explanation("innovation-table")
    by_signal = (f"{test}, ${x}$" for test in ("ACF(1)", "Ljung-Box", "Periodogram") for x in ("q", "dot(q)"))
    return Table(caption, ("Log", "Joint", "NIS", *by_signal, "Times"), rows, "innovation-table", "llrrrrrrrr")


def trials(e: Explanation) -> Table:
    """The results of the tests without each cause, the largest p-value first."""
    least = least_probability(e)
    order = [0, *sorted(range(1, len(e)), key=lambda i: -least[i])]
    rows = []
    for i in order:
        p, explains = f"{least[i]:.2g}" if least[i] >= 0.001 else "< 0.001", "●" if e.explains[i] else ""
        rows.append((literal(str(e.without[i])), str(e.left[i]), f"{e.walk[i]:.3g}", p, explains))
    caption = parts.explanation("innovation-trials", run=parts.run_name(e))
    header = ("Without", "Samples", "Random walk", "Smallest $p$", "Explains")
    return Table(caption, header, tuple(rows), f"trials-{e.log}-{e.joint}", "lrrrl")


def least_probability(e: Explanation) -> Column:
    """The smallest probability of all tests, of the run as it is and then without each cause."""
    return np.asarray(np.min([e.ljung_box_p_q, e.ljung_box_p_dq, e.periodogram_p_q, e.periodogram_p_dq], axis=0))


def figure(context: Context, e: Explanation) -> Figure:
    """Innovations over time, autocorrelation, cumulative periodogram, correlation with the motion.  Fig 7.9-7.11"""
    name, about = parts.run_name(e), {"log": e.log, "joint": e.joint}
    white = {w.signal: w for w in context.catalogue.select(Whiteness, **about)}
    moved = {i.signal: i for i in context.catalogue.select(Innovation, **about)}
    tested = [(white[field], of) for field, of in INNOVATION_FIELDS if field in white]
    panels = (
        *(over_time(t, *signal) for t in context.catalogue.select(Track, **about) for signal in INNOVATION_FIELDS),
        *(parts.autocorrelation(w, f"ACF, {of}", named=w is tested[0][0]) for w, of in tested),
        *(periodogram(w, of) for w, of in tested),
        *(with_motion(moved[field], of) for field, of in INNOVATION_FIELDS if field in moved),
    )
    firsts = " and ".join(in_format(w.acf1, ".2f") for field, _ in INNOVATION_FIELDS if (w := white.get(field)))
    caption = parts.explanation("innovations-figure", run=name)
    alt = f"{name}: the innovations have first autocorrelations of {firsts or 'unknown size'}; verdict: {e.verdict}."
    return Figure(caption, alt, panels, f"innovations-{e.log}-{e.joint}", columns=2, height=30)


def over_time(t: Track, field: str, of: str) -> Panel:
    """An innovation over time, once the filter has converged."""
    shown = parts.converged_rows(t.t)
    marks = (Line(t.t[shown], getattr(t, field)[shown], "", "blue"),)
    return Panel(f"{of.capitalize()} innovation", "time [s]", label(t, field, "innovation"), marks)


def periodogram(w: Whiteness, of: str) -> Panel:
    """A cumulative periodogram minus the straight line of white noise, with the bands of white noise."""
    marks: tuple[AnyMark, ...] = (
        *parts.white_bands(w.periodogram_band, w.periodogram_band_99),
        Line(w.cycles, w.cumulated - 2.0 * w.cycles, "", "blue"),
    )
    return Panel(f"Periodogram, {of}", "frequency [1/sample]", "power above white", marks)


def with_motion(i: Innovation, of: str) -> Panel:
    """The correlation with velocity, acceleration and the sign of the velocity, as many samples before."""
    lag = i.lag.astype(float)
    # Both panels of a row show the same lines, so each legend names only some of them.
    names = ("velocity", "acceleration", "") if of == INNOVATION_FIELDS[0][1] else ("", "", "sign of velocity")
    marks: tuple[AnyMark, ...] = (
        *parts.white_bands(i.band, i.band_99),
        Line(lag, i.with_dq, names[0], "blue", "solid"),
        Line(lag, i.with_ddq, names[1], "vermillion", "dashed"),
        Line(lag, i.with_sign, names[2], "green", "dotted"),
    )
    return Panel(f"{of.capitalize()} innovation and motion", "lag [samples]", "correlation", marks)
