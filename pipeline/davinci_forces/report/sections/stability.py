"""Whether a hand that feels the tissue through a haptic device is stable: switching, delay and sampling."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.records import DelayLimit, HapticMotion, StabilityLimit, StabilityMap, TissueLimit
from davinci_forces.report.content import (
    Band,
    Block,
    Figure,
    HLine,
    Line,
    OnScreen,
    Panel,
    Points,
    Prose,
    Section,
    Table,
    Verdict,
    VLine,
    literal,
)
from davinci_forces.report.content.marks import AnyMark, Colour
from davinci_forces.report.context import Context, label, title
from davinci_forces.report.sections.parts import THESIS_TISSUE

MS = 1e3
LAWS: dict[str, tuple[str, Colour]] = {"worst": ("worst", "vermillion"), "at contact": ("as it is", "blue")}


def section(context: Context) -> Section | None:
    """The limits of the hand of the thesis; None where no tissue was measured."""
    delayed = context.catalogue.all(DelayLimit)
    return (
        Section("Stability of a hand that feels", "stability", tuple(blocks(context, delayed[0]))) if delayed else None
    )


def blocks(context: Context, delayed: DelayLimit) -> Iterator[Block]:
    """The section's content.  Section 8.3"""
    tissues = context.catalogue.all(TissueLimit)
    if tissues:
        yield verdict(context, tissues)
    yield Prose(f"{model(context)}\n\n{red_region(context)}\n\n{what_limits(context, tissues)}")
    yield limits_figure(context, delayed, tissues)
    yield OnScreen(
        "More on stability: what each tissue asks of the hand, and the hand's motion",
        "more-stability",
        (asked(context, tissues), *motions(context)),
    )


def verdict(context: Context, tissues: list[TissueLimit]) -> Verdict:
    """Against which of the tissues the hand is stable with the filter's lag."""
    softest, stiffest = (choose(tissues, key=lambda tissue: tissue.stiffness) for choose in (min, max))
    every = [stiffness(context, tissue) for tissue in (softest, stiffest)]
    measured = f"the tissue that was measured, {every[0]}" + f" to {every[1]}" * (softest is not stiffest)
    prefix = f"stability.{stiffest.log}"
    if f"{prefix}.k_t_lag" not in context.results:
        return Verdict("info", f"Nothing is said of {measured}: no log tells how late the filter is.")
    most, lag, damping = (
        context.results[f"{prefix}.{n}"].number(2) for n in ("k_t_lag", "force_lag", "damping_needed")
    )
    stable = stiffest.stiffness < stiffest.k_t_lag
    return Verdict(
        "good" if stable else "warn",
        f"The thesis's hand is {'' if stable else '**not** '}stable against {measured}, where the force comes {lag} "
        f"late, as the filter's of the {title(stiffest.lag_of).lower()} does, and over the link: at most against "
        f"{most}. A hand damped by {damping} or more is.",
    )


def stiffness(context: Context, tissue: TissueLimit) -> str:
    """The stiffness of a tissue that was measured, with its error where that is at hand."""
    key = f"tissue.{tissue.log}.stiffness"
    known = context.results[key].number() if key in context.results else None
    return str(known) if known else context.size(tissue, "stiffness", tissue.stiffness)


def model(context: Context) -> str:
    """What is assumed of the hand."""
    m, b, k = (context.results[f"stability.hand_{n}"].number(3) for n in ("mass", "damping", "stiffness"))
    return (
        "A hand that holds a haptic device is a mass on a spring and a damper, tissue a spring on one side of its "
        f"surface (8.2)–(8.7). Mass {m} and damping {b} are the thesis's; it states no stiffness, and {k} stands for "
        "an arm held loosely. Other hands: `davinci-forces stability --help`."
    )


def red_region(context: Context) -> str:
    """What the thesis's Fig 8.9 says, and what it does not."""
    proved, switching = (context.results[f"stability.{n}"].number(3) for n in ("k_t_cqlf", "k_t_switching"))
    return (
        "The thesis's map is red where no common quadratic Lyapunov function was found. Such a function exists exactly "
        f"where $K_T < b^2/m + 2 b sqrt(K_H/m)$, here below {proved}, and the solver's points agree. But the red "
        "region is **not** a region of instability: it is where **this criterion** proves nothing. Even if the tissue "
        f"could switch on and off at any moment, it would do no harm below {switching}. And it cannot: it acts where "
        "$x >= 0$ only. There $V = 1/2 m dot(x)^2 + 1/2 K_H x^2 + 1/2 K_T max(x, 0)^2$ falls by $b dot(x)^2$, so that "
        "without delay **every** $K_T >= 0$ is stable, the whole red region with it."
    )


def what_limits(context: Context, tissues: list[TissueLimit]) -> str:
    """What does limit the tissue: delay and sampling."""
    rate = context.results["stability.link_rate"].number(3)
    late = any(f"stability.{tissue.log}.force_lag" in context.results for tissue in tissues)
    lag = " The filter's lag is how late it shows the peak of a push of 1 s." if late else ""
    return (
        "What does limit the tissue is how late its force comes. A force late by $d$ takes damping from a hand that is "
        f"in contact, about $K_T d$, and one that a link of {rate} holds is half a period later still. The limit is "
        "that of a hand pressed into tissue that stays there; one that nothing presses bounces off it, and by "
        f"simulation bears at least twice as much.{lag}"
    )


def limits_figure(context: Context, delayed: DelayLimit, tissues: list[TissueLimit]) -> Figure:
    """The map without delay, and the limit over the delay."""
    return Figure(
        "The stiffest tissue: without delay over the stiffness of the hand, where the solver found a Lyapunov "
        "function, with both exact limits of arbitrary switching (beyond them the tissue, which switches at first "
        "contact, is stable, too); and over how late the force comes, for the hand in contact and, by simulation, for "
        "one that leaves it, with the filter's lag.",
        "Limits of the tissue's stiffness, rising with the stiffness of the hand and falling with the delay of the "
        "force.",
        (map_panel(context, tissues), delay_panel(delayed, tissues)),
        "stability-limits",
        columns=2,
        height=62,
    )


def map_panel(context: Context, tissues: list[TissueLimit]) -> Panel:
    """Fig 8.9 with the exact curves and the tissues."""
    marks: list[AnyMark] = [mark for cells in context.catalogue.all(StabilityMap) for mark in solved(cells)]
    for limit in context.catalogue.all(StabilityLimit):
        marks.append(Line(limit.k_h, limit.k_t_cqlf, "the same, exactly", "black", "solid"))
        marks.append(Line(limit.k_h, limit.k_t_switching, "worst switching", "vermillion", "dashed"))
    return Panel(
        "Without delay",
        "stiffness of the hand [N/m]",
        "stiffness of tissue [N/m]",
        (*marks, *tissue_lines(tissues)),
        x_log=True,
        y_log=True,
    )


def solved(cells: StabilityMap) -> tuple[AnyMark, ...]:
    """Up to where the solver found a function and from where it did not, one column of cells after the other."""
    k_h, found = np.unique(cells.k_h), cells.has_cqlf == 1
    columns = [cells.k_h == k for k in k_h]
    top = float(cells.tissue_stiffness.max())
    last = np.array([cells.tissue_stiffness[column & found].max(initial=0.0) for column in columns])
    first = np.array([cells.tissue_stiffness[column & ~found].min(initial=top) for column in columns])
    some, fails = last > 0.0, first < top
    return (
        Band(k_h, first, np.full(len(k_h), top), "red in Fig 8.9", "vermillion"),
        Points(k_h[some], last[some], "LMI holds up to", "blue"),
        Points(k_h[fails], first[fails], "LMI fails from", "orange"),
    )


def tissue_lines(tissues: list[TissueLimit]) -> Iterator[HLine]:
    """The tissues that were measured, and the thesis's."""
    for i, tissue in enumerate(tissues):
        yield HLine(tissue.stiffness, "" if i else "measured", "green", "solid")
    yield HLine(THESIS_TISSUE, "thesis", "black", "dotted")


def delay_panel(delayed: DelayLimit, tissues: list[TissueLimit]) -> Panel:
    """The limit over the delay."""
    delay = MS * delayed.delay
    tried = delayed.k_t_leaving == delayed.k_t_leaving
    marks: list[AnyMark] = [
        Line(delay, delayed.k_t_delay, "late", "blue", "solid"),
        Line(delay, delayed.k_t_held, f"and held at {delayed.link_rate:g} Hz", "vermillion", "dashed"),
        Points(delay[tried], delayed.k_t_leaving[tried], "leaving the tissue", "purple"),
        *tissue_lines(tissues),
    ]
    late = [tissue for tissue in tissues if tissue.force_lag > 0.0]
    marks += [VLine(MS * tissue.force_lag, "filter's lag") for tissue in late[:1]]
    return Panel(
        "With delay", "delay of the force [ms]", "stiffness of tissue [N/m]", tuple(marks), x_log=True, y_log=True
    )


def asked(context: Context, tissues: list[TissueLimit]) -> Table:
    """What each tissue asks of the hand."""
    names = ("k_h_needed", "force_lag", "k_t_lag", "damping_needed")
    rows = tuple(
        (
            literal(tissue.log),
            context.number(f"tissue.{tissue.log}.stiffness"),
            *context.numbers(f"stability.{tissue.log}", names),
        )
        for tissue in tissues
    )
    header = ("Log", "Stiffness", "$K_H$ for a Lyapunov function", "Filter's lag", "Stiffest so late", "Damping needed")
    return Table(
        "The measured tissue: the stiffness of a hand from which a common quadratic Lyapunov function exists, the "
        "stiffest tissue with the filter's lag and the link, and the damping of a hand that is stable against it so "
        "late.",
        header,
        rows,
        "stability-table",
        "lrrrrr",
    )


def motions(context: Context) -> Iterator[Figure]:
    """Fig 8.8 and 8.10: the same hand and tissue, by the worst switching and as it is."""
    runs = [run for run in context.catalogue.all(HapticMotion) if run.switching in LAWS]
    if not runs:
        return
    k_t = context.size(runs[0], "tissue_stiffness", runs[0].tissue_stiffness, 3)
    phase, position, energy = (
        tuple(Line(getattr(run, x), getattr(run, y), *LAWS[run.switching], "solid") for run in runs)
        for x, y in (("hand_x", "hand_dx"), ("t", "hand_x"), ("t", "V"))
    )
    yield Figure(
        f"The same hand and tissue of {k_t}, beyond both limits of arbitrary switching: unstable by the worst "
        "switching, stable as it switches at first contact. Where the tissue acts at other places than its surface, V "
        "is not what it stores, and rises.",
        "A spiral that grows by the worst switching, and one that shrinks to rest by switching at first contact.",
        (
            Panel("Phase plane", label(runs[0], "hand_x"), label(runs[0], "hand_dx"), phase),
            Panel("Position", "time [s]", label(runs[0], "hand_x"), position),
            Panel("Energy", "time [s]", label(runs[0], "V"), energy, y_log=True),
        ),
        "stability-motion",
        columns=3,
        height=52,
    )
