"""Stability limits of haptic feedback from tissue: switching, delay and sampling."""

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
from davinci_forces.report.sections.parts import MS, THESIS_TISSUE

LAWS: dict[str, tuple[str, Colour]] = {"worst": ("worst", "vermillion"), "at contact": ("as it is", "blue")}


def section(context: Context) -> Section | None:
    """The limits of one assumed hand; None where no tissue was measured."""
    delayed = context.catalogue.records(DelayLimit)
    return Section("Stability of haptic feedback", "stability", tuple(blocks(context, delayed[0]))) if delayed else None


def blocks(context: Context, delayed: DelayLimit) -> Iterator[Block]:
    """The section's content.  Section 8.3"""
    tissues = context.catalogue.records(TissueLimit)
    if tissues:
        yield verdict(context, tissues)
    yield Prose(f"{model(context)}\n\n{without_delay(context)}\n\n{with_delay(context, tissues)}")
    yield limits_figure(context, delayed, tissues)
    yield OnScreen(
        "More on stability: the hand that each tissue needs, and the hand's motion",
        "more-stability",
        (requirements(context, tissues), *motions(context)),
    )


def verdict(context: Context, tissues: list[TissueLimit]) -> Verdict:
    """Whether the hand is stable against the stiffest tissue with the filter's lag."""
    softest, stiffest = (choose(tissues, key=lambda tissue: tissue.stiffness) for choose in (min, max))
    low, high = (stiffness(context, tissue) for tissue in (softest, stiffest))
    measured = f"the measured tissue, {low}" + f" to {high}" * (softest is not stiffest)
    prefix = f"stability.{stiffest.log}"
    if f"{prefix}.k_t_lag" not in context.results:
        return Verdict("info", f"Stability against {measured}, is not known: no log tells the delay of the filter.")
    limit, lag, damping = (
        context.results[f"{prefix}.{n}"].number(2) for n in ("k_t_lag", "force_lag", "damping_needed")
    )
    stable = stiffest.stiffness < stiffest.k_t_lag
    return Verdict(
        "good" if stable else "warn",
        f"{'The thesis’s' if context.compares_with_thesis else 'The assumed'} hand is {'' if stable else '**not** '}"
        f"stable against {measured}. With the link and the filter of the {title(stiffest.lag_of).lower()}, which is "
        f"{lag} late, it is stable up to {limit}."
        + ("" if stable else f" A hand with a damping of {damping} or more would be."),
    )


def stiffness(context: Context, tissue: TissueLimit) -> str:
    """The stiffness of a measured tissue, with its error where there is one."""
    key = f"tissue.{tissue.log}.stiffness"
    return (
        str(context.results[key].number())
        if key in context.results
        else context.size(tissue, "stiffness", tissue.stiffness)
    )


def model(context: Context) -> str:
    """State the assumed model of the hand."""
    m, b, k = (context.results[f"stability.hand_{n}"].number(3) for n in ("mass", "damping", "stiffness"))
    origin = (
        f"Mass {m} and damping {b} are the thesis's (8.2)–(8.7); it states no stiffness, and {k} stands for an arm "
        "held loosely."
        if context.compares_with_thesis
        else f"Assumed are a mass of {m}, a damping of {b} and a stiffness of {k}, as of an arm held loosely."
    )
    return (
        "A surgeon's hand on a haptic device is modelled as a mass $m$ on a spring $K_H$ and a damper $b$. Tissue is a "
        f"spring $K_T$ on one side of its surface. {origin} Try other hands: `davinci-forces stability --help`."
    )


def without_delay(context: Context) -> str:
    """Explain what the map of Lyapunov functions says, and what it does not.  Fig 8.9"""
    proved, switching = (context.results[f"stability.{n}"].number(3) for n in ("k_t_cqlf", "k_t_switching"))
    region = "the region that the thesis's map paints red" if context.compares_with_thesis else "the shaded region"
    return (
        "A common quadratic Lyapunov function proves stability without delay. It exists exactly where "
        f"$K_T < b^2/m + 2 b sqrt(K_H/m)$, here below {proved}; the solver's points agree. Beyond it lies {region}. "
        "That is **not** a region of instability: **this criterion** merely proves nothing there. Even tissue that "
        f"switched on and off at any moment would do no harm below {switching}. Real tissue acts only where $x >= 0$. "
        "There $V = 1/2 m dot(x)^2 + 1/2 K_H x^2 + 1/2 K_T max(x, 0)^2$ falls by $b dot(x)^2$. So **every** "
        "$K_T >= 0$ is stable without delay, also in that region."
    )


def with_delay(context: Context, tissues: list[TissueLimit]) -> str:
    """Explain the limits that delay and sampling set."""
    rate = context.results["stability.link_rate"].number(3)
    late = any(f"stability.{tissue.log}.force_lag" in context.results for tissue in tissues)
    lag = " The filter's lag is the delay with which it shows the peak of a push of 1 s." if late else ""
    return (
        "The limit comes from the delay of the force. A delay $d$ takes a damping of about $K_T d$ from a hand in "
        f"contact. A link of {rate} holds each force for one period, which adds half a period of delay. The stated "
        "limit is that of a hand pressed into the tissue. A hand that nothing presses bounces off, and by simulation "
        f"it is stable up to at least twice as much.{lag}"
    )


def limits_figure(context: Context, delayed: DelayLimit, tissues: list[TissueLimit]) -> Figure:
    """The map without delay, and the limit over the delay."""
    return Figure(
        "Limits of the tissue's stiffness. Left, without delay, over the stiffness of the hand: where the solver found "
        "a Lyapunov function, and both exact limits of arbitrary switching; tissue that switches at first contact is "
        "stable beyond them, too. Right, over the delay of the force: for a hand in contact, and by simulation for "
        "one that leaves the tissue.",
        "Limits of the tissue's stiffness, rising with the stiffness of the hand and falling with the delay of the "
        "force.",
        (map_panel(context, tissues), delay_panel(context, delayed, tissues)),
        "stability-limits",
        columns=2,
        height=62,
    )


def map_panel(context: Context, tissues: list[TissueLimit]) -> Panel:
    """Fig 8.9 with the exact curves and the tissues."""
    beyond = "red in Fig 8.9" if context.compares_with_thesis else "no Lyapunov function"
    marks: list[AnyMark] = [
        mark for cells in context.catalogue.records(StabilityMap) for mark in lyapunov_marks(cells, beyond)
    ]
    for limit in context.catalogue.records(StabilityLimit):
        marks.append(Line(limit.k_h, limit.k_t_cqlf, "exact limit", "black", "solid"))
        marks.append(Line(limit.k_h, limit.k_t_switching, "worst switching", "vermillion", "dashed"))
    return Panel(
        "Without delay",
        "stiffness of the hand [N/m]",
        "stiffness of tissue [N/m]",
        (*marks, *tissue_lines(context, tissues)),
        x_log=True,
        y_log=True,
    )


def lyapunov_marks(cells: StabilityMap, beyond: str) -> tuple[AnyMark, ...]:
    """Up to where the solver found a function and from where it did not, column by column of cells."""
    k_h, stable = np.unique(cells.k_h), cells.has_cqlf == 1
    columns = [cells.k_h == k for k in k_h]
    top = float(cells.tissue_stiffness.max())
    last = np.array([cells.tissue_stiffness[column & stable].max(initial=0.0) for column in columns])
    first = np.array([cells.tissue_stiffness[column & ~stable].min(initial=top) for column in columns])
    holds, fails = last > 0.0, first < top
    return (
        Band(k_h, first, np.full(len(k_h), top), beyond, "vermillion"),
        Points(k_h[holds], last[holds], "LMI holds up to", "blue"),
        Points(k_h[fails], first[fails], "LMI fails from", "orange"),
    )


def tissue_lines(context: Context, tissues: list[TissueLimit]) -> Iterator[HLine]:
    """The measured tissues, and in simulations of the thesis's experiments the thesis's."""
    for i, tissue in enumerate(tissues):
        yield HLine(tissue.stiffness, "" if i else "measured", "green", "solid")
    if context.compares_with_thesis:
        yield HLine(THESIS_TISSUE, "thesis", "black", "dotted")


def delay_panel(context: Context, delayed: DelayLimit, tissues: list[TissueLimit]) -> Panel:
    """The limit over the delay."""
    delay = MS * delayed.delay
    tried = delayed.k_t_leaving == delayed.k_t_leaving
    marks: list[AnyMark] = [
        Line(delay, delayed.k_t_delay, "delayed", "blue", "solid"),
        Line(delay, delayed.k_t_held, f"and held at {delayed.link_rate:g} Hz", "vermillion", "dashed"),
        Points(delay[tried], delayed.k_t_leaving[tried], "leaving the tissue", "purple"),
        *tissue_lines(context, tissues),
    ]
    late = [tissue for tissue in tissues if tissue.force_lag > 0.0]
    marks += [VLine(MS * tissue.force_lag, "filter's lag") for tissue in late[:1]]
    return Panel(
        "With delay", "delay of the force [ms]", "stiffness of tissue [N/m]", tuple(marks), x_log=True, y_log=True
    )


def requirements(context: Context, tissues: list[TissueLimit]) -> Table:
    """The stiffness and the damping that each tissue requires of the hand."""
    names = ("k_h_needed", "force_lag", "k_t_lag", "damping_needed")
    rows = tuple(
        (
            literal(tissue.log),
            context.number(f"tissue.{tissue.log}.stiffness"),
            *context.numbers(f"stability.{tissue.log}", names),
        )
        for tissue in tissues
    )
    header = ("Log", "Stiffness", "$K_H$ for a Lyapunov function", "Filter's lag", "Stable up to", "Damping needed")
    return Table(
        "The measured tissue: the stiffness of the hand above which a common quadratic Lyapunov function exists; the "
        "stiffest tissue that is stable with the filter's lag and the link; and the damping that a hand needs to be "
        "stable against the measured tissue with this lag.",
        header,
        rows,
        "stability-table",
        "lrrrrr",
    )


def motions(context: Context) -> Iterator[Figure]:
    """Fig 8.8 and 8.10: the same hand and tissue, by the worst switching and as it is."""
    runs = [run for run in context.catalogue.records(HapticMotion) if run.switching in LAWS]
    if not runs:
        return
    k_t = context.size(runs[0], "tissue_stiffness", runs[0].tissue_stiffness, 3)
    phase, position, energy = (
        tuple(Line(getattr(run, x), getattr(run, y), *LAWS[run.switching], "solid") for run in runs)
        for x, y in (("hand_x", "hand_dx"), ("t", "hand_x"), ("t", "V"))
    )
    yield Figure(
        f"The same hand and tissue of {k_t}, beyond both limits of arbitrary switching. It is unstable by the worst "
        "switching, and stable as it switches at first contact. Under the worst switching V is not the stored energy, "
        "so it can rise.",
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
