"""The filter: its assumed noise, the parts of its standard deviation, and a comparison with other filters."""

from collections.abc import Iterator

import numpy as np

from davinci_forces import filters
from davinci_forces.records import Comparison, FilterNoise, Track
from davinci_forces.report.content import Block, Cell, Figure, Line, OnScreen, Panel, Prose, Section, Table, literal
from davinci_forces.report.context import Context, label, title

SECONDS_DRAWN = 8.0  # [s] of a run, few enough to see differences of filters
DRAWN = {
    "direct": ("grey", "dotted"),
    "momentum": ("green", "dashdot"),
    "rts": ("blue", "dashed"),
    "ekf": ("vermillion", "solid"),
}


def section(context: Context) -> Section | None:
    """Tuning, budget and comparison, where anything was tracked."""
    content = tuple(blocks(context))
    return Section("The filter", "filters", content) if content else None


def blocks(context: Context) -> Iterator[Block]:
    """The section's content."""
    noises = context.catalogue.records(FilterNoise)
    if not noises:
        return
    yield Prose(
        "The filter assumes noise of position, velocity and effort. Its size maximises the likelihood of the "
        "innovations (each measurement minus its prediction) in identification logs, where nothing touches the robot. "
        "The external effort is a random walk. Such logs cannot tell how fast it may change: a filter tuned to them "
        "would miss pushes. So the walk is the slowest with which a push, a half-sine of 1 s, shows 90 % of its peak "
        "at most 0.1 s late ([@filter-tuning])."
    )
    yield tuning(context, noises)
    worst = [track for noise in noises for track in worst_track(context, noise.joint)]
    if worst:
        yield Prose(
            "The stated standard deviation of the external effort combines independent parts ([@error-budget]). The "
            "filter's part comes from noise and random walk. The model's part is its error in free motion of other "
            "logs that no fit had seen. The lag's part is what the filter misses of the smoothed effort. The offset "
            "of the day is added where free windows determine one."
        )
        yield budget(context, worst)
    comparisons = [c for track in worst for c in context.catalogue.select(Comparison, log=track.log, joint=track.joint)]
    if comparisons:
        yield comparison(context, comparisons)
        yield OnScreen("Filters beside each other over time", "filters-over-time", (overlay(comparisons),))


def worst_track(context: Context, joint: str) -> Iterator[Track]:
    """The free run of a joint that its detection level comes from."""
    if (space := context.worst_space(joint)) is not None:
        yield from context.catalogue.select(Track, log=space.log, joint=joint)


def tuning(context: Context, noises: list[FilterNoise]) -> Table:
    """The tuned noise of each joint, and the logs that it was tuned on."""
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            title(noise.joint),
            *context.numbers(f"tuning.{noise.joint}", ("r_q", "r_dq", "r_tau", "q_tau")),
            literal(", ".join(noise.logs)),
        )
        for noise in noises
    )
    caption = "Noise that the filter assumes (standard deviations of a sample; the walk per square root of a second)."
    return Table(
        caption, ("Joint", "Position", "Velocity", "Effort", "Walk", "Tuned on"), rows, "filter-tuning", "lrrrrl"
    )


def budget(context: Context, tracks: list[Track]) -> Table:
    """The parts of the standard deviation of each joint's worst free run, beside the RMS and coverage of that run."""
    names = ("filter_part", "model_part", "lag_part", "free_rms", "coverage")
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (title(t.joint), literal(t.log), *context.numbers(f"ekf.{t.log}.{t.joint}", names, 2)) for t in tracks
    )
    header = ("Joint", "Worst free run", "Filter", "Model", "Lag", "RMS", "Covered by 95 % band")
    return Table(
        "Parts of the standard deviation (root mean squares), beside the RMS and the coverage of the run.",
        header,
        rows,
        "error-budget",
        "llrrrrr",
    )


def comparison(context: Context, compared: list[Comparison]) -> Table:
    """Every filter on the worst free run of each joint."""
    rows = tuple(compared_row(context, c) for c in compared)
    caption = (
        "Filters compared on the worst free run of each joint, each with the slowest walk that shows a push: their "
        "external effort in free motion, and their response to a push that is added to the recorded effort in software."
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


def overlay(compared: list[Comparison]) -> Figure:
    """Some filters in the middle of the same run, joint by joint."""
    joints = list(dict.fromkeys(c.joint for c in compared))
    panels = tuple(panel([c for c in compared if c.joint == joint], i == 0) for i, joint in enumerate(joints))
    return Figure(
        "External effort in free motion by four filters. It should be 0; the rest is the model's error, which all of "
        "them share. The smoother has no delay.",
        f"External effort by four filters over {SECONDS_DRAWN:g} s of the worst free run of {len(joints)} joints.",
        panels,
        "filters-figure",
        columns=1,
        height=30,
    )  # fmt: skip


def panel(compared: list[Comparison], named: bool) -> Panel:
    """One joint."""
    by_name = {c.filter: c for c in compared}
    drawn = [by_name[name] for name in DRAWN if name in by_name]
    middle = float(np.mean(drawn[0].t))
    near = np.abs(drawn[0].t - middle) <= 0.5 * SECONDS_DRAWN
    lines = tuple(Line(c.t[near], c.tau_ext[near], name_of(c.filter) if named else "", *DRAWN[c.filter]) for c in drawn)  # type: ignore[arg-type]
    heading = f"{title(drawn[0].joint)} in {drawn[0].log}"
    return Panel(heading, "time [s]", label(drawn[0], "tau_ext", "external effort"), lines)
