"""Parts that several sections share: tables on paper or on screen, marks of a run, and words."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import numpy as np

from davinci_forces.files import read_bytes, text_of
from davinci_forces.maths.arrays import Booleans, evenly, runs
from davinci_forces.records import Column, Contact, Fit, PathShare, Prediction, Record, Residual, Track, Whiteness
from davinci_forces.records.weight import TorqueConstant, Weight
from davinci_forces.report.content import Block, Level, OnScreen, Panel, Section, Table, literal
from davinci_forces.report.content.marks import AnyMark, Colour, HBand, Line, Points, Reference, Stems, VSpan
from davinci_forces.report.context import Context, label, title
from davinci_forces.report.verdicts import Trust, decisive, mass_level

MM = MS = 1000.0  # millimetres in a metre, milliseconds in a second
RATINGS = {"accept": "● Accept", "doubt": "▲ Doubt", "reject": "✖ Reject"}
F = ("f_x", "f_y", "f_z")  # components of the force at the tip
UNFITTED = " that no fit used"  # the worst run is sought among these runs, if there are any
PAPER = 18  # largest number of rows of a table in the PDF
THESIS_TISSUE = 457.24  # [N/m], section 8.2
Window = tuple[str, float, float, float, str, int]  # log, onset, release, size of the peak, joint, and row


def chapters(name: str) -> dict[str, str]:
    """The chapters of a file of text beside this module, by heading; the lines of a paragraph are as in the file."""
    text = text_of(read_bytes(Path(__file__).with_name(name)))
    _, *parts = re.split(r"^# ([\w-]+)\n", text, flags=re.M)  # headings, each before its body
    return dict(zip(parts[::2], map(str.strip, parts[1::2]), strict=True))


def explanation(chapter: str, **values: object) -> str:
    """What a section says before its numbers, or a caption, from explanations.md, with the values of its braces."""
    paragraphs = chapters("explanations.md")[chapter].split("\n\n")
    return "\n\n".join(paragraph.replace("\n", " ") for paragraph in paragraphs).format(**values)


def static_frictions(context: Context, tracks: Iterable[Track]) -> dict[str, str]:
    """The largest static friction of each joint that is tracked."""
    in_order = sorted(tracks, key=lambda track: track.static_friction)  # the largest comes last
    return {track.joint: context.size(track, "static_friction") for track in in_order}


def section_of(
    heading: str, anchor: str, *kinds: type[Record]
) -> Callable[[Callable[..., Iterator[Block]]], Callable[[Context], Section | None]]:
    """Turn a function that yields blocks, from the context and the records of kinds, into the function of a section.

    There is no section where a kind has no records, or where there are no blocks.
    """

    def decorate(blocks: Callable[..., Iterator[Block]]) -> Callable[[Context], Section | None]:
        @wraps(blocks)
        def section(context: Context) -> Section | None:
            records = [context.catalogue.records(kind) for kind in kinds]
            content = tuple(blocks(context, *records)) if all(records) else ()
            return Section(heading, anchor, content) if content else None

        return section

    return decorate


def run_cells(run: Any) -> tuple[str, str]:
    """The first cells of a row about a record of a joint in a log."""
    return literal(run.log), title(run.joint)


def paper_or_screen(table: Table, name: str = "") -> Iterator[Block]:
    """A table on paper, or on screen if it has more rows than `PAPER`, under a name or the start of its caption."""
    name = name or re.split(r"[;:.?](?: |$)", table.caption)[0]
    yield OnScreen(name, f"all-{table.label}", (table,)) if len(table.rows) > PAPER else table


def first_on_paper(blocks: Sequence[Block], name: str, anchor: str, number: int = 1) -> Iterator[Block]:
    """The first blocks on paper, the others on screen under a name."""
    yield from blocks[:number]
    if blocks[number:]:
        yield OnScreen(name, anchor, tuple(blocks[number:]))


def grade_of_mass(context: Context, weight: Weight) -> tuple[Level, str]:
    """The verdict on the mass of a weight log, and why; a torque constant that the study states may be of that log."""
    constants = context.catalogue.records(TorqueConstant)
    stated = [c for c in constants if "torque_constant" in context.study.changed.get(c.joint, {})]
    return mass_level(weight, stated)


def trust(context: Context, joint: str) -> Trust:
    """The prediction that decides on a joint, by the fit that the filter uses, and its worst free space."""
    run, about = decisive(scored_predictions(context, joint), context.catalogue.select(PathShare, joint=joint))
    narrowest = min(context.spaces(joint), key=lambda space: space.coverage, default=None)
    return Trust(joint, run, context.worst_space(joint), context.study.settings.effort.get(joint), about, narrowest)


def scored_predictions(context: Context, joint: str) -> list[Prediction]:
    """The predictions of a joint by the fit that the filter uses, of logs of which some motion is known to be free."""
    fits = context.predicting_fits(joint)
    scored = [p for p in context.catalogue.select(Prediction, joint=joint) if f"{p.model}.{p.estimator}" in fits]
    return [p for p in scored if p.role != "contact" or context.study.log(p.log).has_known_free_motion]


def run_name(run: Any) -> str:
    """The joint and the log of a record, as the beginning of a caption."""
    return f"{title(run.joint)} in {literal(run.log)}"


def is_of_link(phi: str) -> bool:
    """Whether a column of a regressor is of a link's parameter, which all joints of the arm share."""
    return str(phi).startswith("partial")


def converged_rows(t: Column) -> slice:
    """The samples after the first second, in which the filter's band is wide, and before the last half second.

    There the low-pass of the motion errs, as it has no later samples.  Of a short log a fifth and a tenth are left out.
    """
    first = min(1.0, 0.2 * (t[-1] - t[0]))
    return slice(*np.searchsorted(t, [t[0] + first, t[-1] - 0.5 * first], "left").tolist())


def spans(windows: Iterable[tuple[float, float]], name: str = "", colour: Colour = "orange") -> tuple[VSpan, ...]:
    """Ranges of time, the first named in the legend."""
    return tuple(VSpan(start, end, "" if i else name, colour) for i, (start, end) in enumerate(windows))


def spans_where(t: Column, which: Booleans, name: str, colour: Colour = "orange") -> tuple[VSpan, ...]:
    """The ranges of time in which a condition (N,) holds, the first named in the legend."""
    return spans(((float(t[part.start]), float(t[part.stop - 1])) for part in runs(which)), name, colour)


def effort_panel(record: Track | Prediction | Residual, *spans: VSpan, heading: str = "Effort") -> Panel:
    """Effort over time, measured and modelled."""
    model = Line(record.t, record.tau_hat, "model", "vermillion", "dashed")
    marks: tuple[AnyMark, ...] = (*spans, Line(record.t, record.tau, "measured", "sky"), model)
    return Panel(heading, "time [s]", label(record, "tau", "effort"), marks)


def white_bands(band: float, band_99: float, name: str = "", name_99: str = "") -> tuple[HBand, HBand]:
    """The ranges in which 95 % and 99 % of white noise stay, the wider one first."""
    return HBand(-band_99, band_99, name_99, "sky"), HBand(-band, band, name)


def autocorrelation(w: Whiteness, heading: str, named: bool = True) -> Panel:
    """An autocorrelation with the bands that white noise stays in; `named` in a legend."""
    acf = w.acf[1:]
    names = ("95 % band", "99 % band") if named else ("", "")
    marks = (*white_bands(w.band, w.band_99, *names), Stems(w.lag[1:].astype(float), acf, "", "blue"))
    # The range shows small correlations apart from the band, and both sides of zero.
    reach = max(4 * w.band, 0.1)
    low, high = min(-reach, 1.1 * float(acf.min())), max(reach, min(1.1 * float(acf.max()), 1.0))
    return Panel(heading, "lag [samples]", "autocorrelation", marks, y_range=(low, high))


def normal_plot(title: str, x: Column, axis: str) -> Panel:
    """A normal probability plot: ordered values over theoretical quantiles, and the line through the quartiles.

    At most 500 points, evenly spread over the order, as more cannot be told apart on paper.
    """
    from scipy.special import ndtri

    ordered = np.sort(x)
    scores = ndtri((np.arange(1, len(x) + 1) - 0.375) / (len(x) + 0.25))
    shown = evenly(len(x), 500)
    low, high = np.quantile(x, [0.25, 0.75])
    slope = (high - low) / (2 * ndtri(0.75))
    line = Reference(float(slope), float((low + high) / 2), "normal", "vermillion")
    return Panel(title, "normal quantile", axis, (Points(scores[shown], ordered[shown], "", "blue"), line))


def strokes(start: Column, end: Column) -> Column:
    """A line from each start (N, 3) to its end, as one interrupted line (3 N, 3)."""
    return np.stack([start, end, np.full_like(start, np.nan)], axis=1).reshape(-1, 3)


def of_free_motion(context: Context, predictions: list[Prediction]) -> list[Prediction]:
    """The predictions of free motion in logs that no fit uses; all of them if there is none."""
    free = [p for p in predictions if p.role != "identification" and context.study.log(p.log).has_known_free_motion]
    return free or predictions


def of_joint(fit: Fit, joint: str) -> dict[int, str]:
    """The rows and names of a fit's parameters of this joint alone: not those of links, nor of other joints."""
    suffix = f" of {joint}" if fit.group != joint else ""
    own = [i for i, name in enumerate(fit.parameter) if name.endswith(suffix) and not is_of_link(fit.phi[i])]
    return {i: str(fit.parameter[i]).removesuffix(suffix) for i in own}


def contacts_at_once(contacts: Iterable[Contact], which: Callable[[Contact], Booleans]) -> list[list[Window]]:
    """Group some of the contacts (C,): those whose windows overlap in a log."""
    groups: list[list[Window]] = []
    rows = [(c, i) for c in contacts for i in np.flatnonzero(which(c)).tolist()]
    for window in sorted((c.log, c.onset[i], c.release[i], abs(c.peak[i]), c.joint, i) for c, i in rows):
        if not groups or window[0] != groups[-1][0][0] or window[1] >= max(end for _, _, end, *_ in groups[-1]):
            groups.append([])
        groups[-1].append(window)
    return groups
