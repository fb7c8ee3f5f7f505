"""How the external effort is found: what the filter assumes, what its deviation is made of, and what other filters make
of the same run.
"""

from collections.abc import Iterator

import numpy as np

from davinci_forces import filters
from davinci_forces.records import Comparison, FilterNoise, Track
from davinci_forces.report.content import Block, Cell, Figure, Line, OnScreen, Panel, Prose, Section, Table, literal
from davinci_forces.report.context import Context, label, title

SHOWN = 8.0  # [s] of a run, in which filters can be told apart
DRAWN = {
    "direct": ("grey", "dotted"),
    "momentum": ("green", "dashdot"),
    "rts": ("blue", "dashed"),
    "ekf": ("vermillion", "solid"),
}


def section(context: Context) -> Section | None:
    """Tuning, budget and comparison, where anything was tracked."""
    found = tuple(blocks(context))
    return Section("The filter", "filters", found) if found else None


def blocks(context: Context) -> Iterator[Block]:
    """The section's content."""
    noises = context.catalogue.all(FilterNoise)
    if not noises:
        return
    yield Prose(
        "The noise that the filter assumes of position, velocity and effort is that of the greatest likelihood of its "
        "innovations in identification logs, where nothing touches the robot. How fast the external effort may walk "
        "is not asked of such data, which would make the filter deaf: it is the slowest walk with which a push, a "
        "half-sine of 1 s, shows 90 % of its peak at most 0.1 s late ([@filter-tuning])."
    )
    yield tuning(context, noises)
    worst = [track for noise in noises for track in worst_track(context, noise.joint)]
    if worst:
        yield Prose(
            "The stated standard deviation of the external effort is the total of independent parts "
            "([@error-budget]): what the filter says of noise and walk; the model's error, from free motion that no "
            "fit had seen and of other logs than the one that is judged; what the filter lags behind, by what it "
            "would miss of the smoothed effort; and the offset of the day, where free windows tell one."
        )
        yield budget(context, worst)
    compared = [c for track in worst for c in context.catalogue.about(Comparison, log=track.log, joint=track.joint)]
    if compared:
        yield comparison(context, compared)
        yield OnScreen("Filters beside each other over time", "filters-over-time", (overlaid(compared),))


def worst_track(context: Context, joint: str) -> Iterator[Track]:
    """The free run of a joint that its detection level comes from."""
    if (space := context.worst_space(joint)) is not None:
        yield from context.catalogue.about(Track, log=space.log, joint=joint)


def tuning(context: Context, noises: list[FilterNoise]) -> Table:
    """What was tuned, and on what."""
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            title(noise.joint),
            *context.numbers(f"tuning.{noise.joint}", ("r_q", "r_dq", "r_tau", "q_tau")),
            literal(", ".join(noise.logs)),
        )
        for noise in noises
    )
    caption = "What the filter assumes (standard deviations of a sample; the walk per root of a second)."
    return Table(
        caption, ("Joint", "Position", "Velocity", "Effort", "Walk", "Tuned on"), rows, "filter-tuning", "lrrrrl"
    )


def budget(context: Context, tracks: list[Track]) -> Table:
    """What the deviation of each joint's worst free run is made of, beside what that run shows."""
    names = ("filter_part", "model_part", "lag_part", "free_rms", "coverage")
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (title(t.joint), literal(t.log), *context.numbers(f"ekf.{t.log}.{t.joint}", names, 2)) for t in tracks
    )
    header = ("Joint", "Worst free run", "Filter", "Model", "Lag", "RMS found", "Covered by 95 % band")
    return Table(
        "Parts of the standard deviation (root mean squares), and what was found.",
        header,
        rows,
        "error-budget",
        "llrrrrr",
    )


def comparison(context: Context, compared: list[Comparison]) -> Table:
    """Every filter on the worst free run of each joint."""
    rows = tuple(compared_row(context, c) for c in compared)
    caption = (
        "Filters compared on the worst free run of each joint, each with the slowest walk that shows a push: what is "
        "left of free motion, and a push added to the recorded effort in software."
    )
    return Table(
        caption,
        ("Joint", "Filter", "RMS", "Detection level", "Push shown", "Delay"),
        rows,
        "filter-comparison",
        "llrrrr",
    )


def compared_row(context: Context, c: Comparison) -> tuple[Cell, ...]:
    """One filter on one joint."""
    names = (("free_rms", 2), ("detection_level", 2), ("push_share", 2), ("push_delay", 1))
    numbers = (context.number(f"{c.filter}.{c.log}.{c.joint}.{name}", digits) for name, digits in names)
    return (title(c.joint), name_of(c.filter), *numbers)


def name_of(label: str) -> str:
    """What the filter of a comparison is called; one is the default again, with the joint's own terms."""
    name = label.replace("-", "_")
    return filters.title(name) if name in filters.FILTERS else "The same, own terms only"


def overlaid(compared: list[Comparison]) -> Figure:
    """Some filters in the middle of the same run, joint by joint."""
    joints = list(dict.fromkeys(c.joint for c in compared))
    panels = tuple(panel([c for c in compared if c.joint == joint], i == 0) for i, joint in enumerate(joints))
    return Figure(
        "External effort of free motion by four filters, which should be 0: the smoother has no delay, and the model's "
        "error is in all of them.",
        f"External effort by four filters over {SHOWN:g} s of the worst free run of {len(joints)} joints.",
        panels,
        "filters-figure",
        columns=1,
        height=30,
    )  # fmt: skip


def panel(compared: list[Comparison], named: bool) -> Panel:
    """One joint."""
    by_name = {c.filter: c for c in compared}
    some = [by_name[name] for name in DRAWN if name in by_name]
    middle = float(np.mean(some[0].t))
    near = np.abs(some[0].t - middle) <= 0.5 * SHOWN
    lines = tuple(Line(c.t[near], c.tau_ext[near], name_of(c.filter) if named else "", *DRAWN[c.filter]) for c in some)  # type: ignore[arg-type]
    heading = f"{title(some[0].joint)} in {some[0].log}"
    return Panel(heading, "time [s]", label(some[0], "tau_ext", "external effort"), lines)
