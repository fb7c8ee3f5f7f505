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

LAWS: dict[str, tuple[str, Colour]] = {"worst": ("worst switching", "vermillion"), "at contact": ("contact", "blue")}


def section(context: Context) -> Section | None:
    """The stability limits of one assumed hand; None if no tissue was measured."""
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
    """Whether the hand is stable against the stiffest tissue with the filter's delay."""
    softest, stiffest = (choose(tissues, key=lambda tissue: tissue.stiffness) for choose in (min, max))
    low, high = (stiffness(context, tissue) for tissue in (softest, stiffest))
    measured = f"the measured tissue, {low}" + f" to {high}" * (softest is not stiffest)
    prefix = f"stability.{stiffest.log}"
    if f"{prefix}.k_t_lag" not in context.results:
        return Verdict("info", f"Stability against {measured}, is not known: no log shows the delay of the filter.")
    limit, lag, damping = (
        context.results[f"{prefix}.{n}"].number(2) for n in ("k_t_lag", "force_lag", "damping_needed")
    )
    rate = context.results["stability.link_rate"].number(3)
    stable = stiffest.stiffness < stiffest.k_t_lag
    return Verdict(
        "good" if stable else "warn",
        f"{'The thesis’s' if context.compares_with_thesis else 'The assumed'} model of a hand is "
        f"{'' if stable else '**not** '}"
        f"stable against {measured}. With a communication link of {rate} and the filter's delay of {lag} "
        f"({title(stiffest.lag_of).lower()}), it is stable up to {limit}."
        + ("" if stable else f" A hand with a damping of at least {damping} would be stable against this tissue."),
    )


def stiffness(context: Context, tissue: TissueLimit) -> str:
    """The stiffness of a measured tissue, with its standard error if there is one."""
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
        else f"Its mass is assumed as {m}, its damping as {b} and its stiffness as {k}, as of an arm held loosely."
    )
    return (
        "A surgeon's hand on a haptic device is modelled as a mass $m$ on a spring $K_H$ and a damper $b$. Tissue is a "
        f"spring $K_T$ on one side of its surface. {origin} Try other hands: `davinci-forces stability --help`."
    )


def without_delay(context: Context) -> str:
    """Explain what the map of Lyapunov functions proves, and what it does not prove.  Fig 8.9"""
    proved, switching = (context.results[f"stability.{n}"].number(3) for n in ("k_t_cqlf", "k_t_switching"))
    region = "the red region of the thesis's Figure 8.9" if context.compares_with_thesis else "the shaded region"
    return (
        "A common quadratic Lyapunov function proves stability without delay. It exists if and only if "
        f"$K_T < b^2/m + 2 b sqrt(K_H/m)$, here below {proved}; the numerical solutions of its linear matrix "
        f"inequality (LMI) in [@stability-limits] agree. Above this limit, in {region}, **this criterion** proves "
        "nothing; the hand may be stable there, too. A spring that switches on and off at arbitrary times is stable "
        f"below {switching}. Real tissue acts only in contact, at $x >= 0$. The energy "
        "$V = 1/2 m dot(x)^2 + 1/2 K_H x^2 + 1/2 K_T max(x, 0)^2$ then falls by $b dot(x)^2$. So **every** "
        "$K_T >= 0$ is stable without delay."
    )


def with_delay(context: Context, tissues: list[TissueLimit]) -> str:
    """Explain the stability limits due to delay and sampling."""
    rate = context.results["stability.link_rate"].number(3)
    late = any(f"stability.{tissue.log}.force_lag" in context.results for tissue in tissues)
    lag = " The filter's delay is the time from the peak of a push of 1 s to the peak of its estimate." if late else ""
    return (
        "A delay $d$ of the force reduces the damping of a hand in contact by about "
        f"$K_T d$. A communication link of {rate} holds each force for one period, which adds half a period of delay. "
        "All limits with delay apply to a hand that stays in contact. In simulation, a hand that bounces off is "
        f"stable up to at least twice this limit.{lag}"
    )


def limits_figure(context: Context, delayed: DelayLimit, tissues: list[TissueLimit]) -> Figure:
    """The map without delay, and the limit over the delay."""
    return Figure(
        "Limits of the tissue's stiffness. Left, without delay: up to which a Lyapunov function exists (points: LMI "
        "solver; line: exact), and up to which the worst switching is stable (dashed). Real tissue is stable above "
        "both, too. Right, with delay: for a hand that stays in contact (lines) or leaves it (points, simulated).",
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
    """The stiffest tissue with a Lyapunov function and the softest without, for each stiffness of the hand."""
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
    """The measured tissues; in simulations of the thesis's experiments, also the tissue of the thesis."""
    for i, tissue in enumerate(tissues):
        yield HLine(tissue.stiffness, "" if i else "measured", "green", "solid")
    if context.compares_with_thesis:
        yield HLine(THESIS_TISSUE, "thesis", "black", "dotted")


def delay_panel(context: Context, delayed: DelayLimit, tissues: list[TissueLimit]) -> Panel:
    """The limit over the delay."""
    delay = MS * delayed.delay
    tried = delayed.k_t_leaving == delayed.k_t_leaving
    marks: list[AnyMark] = [
        Line(delay, delayed.k_t_delay, "delay only", "blue", "solid"),
        Line(delay, delayed.k_t_held, f"delay and link of {delayed.link_rate:g} Hz", "vermillion", "dashed"),
        Points(delay[tried], delayed.k_t_leaving[tried], "leaving the tissue", "purple"),
        *tissue_lines(context, tissues),
    ]
    late = [tissue for tissue in tissues if tissue.force_lag > 0.0]
    marks += [VLine(MS * tissue.force_lag, "filter's delay") for tissue in late[:1]]
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
    header = ("Log", "Stiffness", "$K_H$ for a Lyapunov function", "Filter's delay", "Stable up to", "Damping needed")
    return Table(
        "The measured tissue: the stiffness of the hand above which a common quadratic Lyapunov function exists; the "
        "stiffest tissue that is stable with the filter's delay and the link; and the damping that a hand needs to be "
        "stable against the measured tissue with this delay.",
        header,
        rows,
        "stability-table",
        "lrrrrr",
    )


def motions(context: Context) -> Iterator[Figure]:
    """Fig 8.8 and 8.10: the same hand and tissue, under the worst switching and in real contact."""
    runs = [run for run in context.catalogue.records(HapticMotion) if run.switching in LAWS]
    if not runs:
        return
    k_t = context.size(runs[0], "tissue_stiffness", runs[0].tissue_stiffness, 3)
    phase, position, energy = (
        tuple(Line(getattr(run, x), getattr(run, y), *LAWS[run.switching], "solid") for run in runs)
        for x, y in (("hand_x", "hand_dx"), ("t", "hand_x"), ("t", "V"))
    )
    yield Figure(
        f"The same hand and tissue of {k_t}, above both limits of arbitrary switching. The motion is unstable under "
        "the worst switching, and stable if the tissue acts only in contact. Under the worst switching V is not the "
        "stored energy, so V can rise.",
        "A spiral that grows under the worst switching, and one that shrinks to rest if the tissue acts in contact.",
        (
            Panel("Phase plane", label(runs[0], "hand_x"), label(runs[0], "hand_dx"), phase),
            Panel("Position", "time [s]", label(runs[0], "hand_x"), position),
            Panel("Energy", "time [s]", label(runs[0], "V"), energy, y_log=True),
        ),
        "stability-motion",
        columns=3,
        height=52,
    )
