"""Stability limits of haptic feedback from tissue: one headline, its checks, and what else limits it."""

from collections.abc import Iterator
from itertools import cycle

import numpy as np

from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records import HandLimit, HapticMotion, StabilityLimit, Stiffness
from davinci_forces.records.record import as_list
from davinci_forces.report.content import Block, Figure, OnScreen, Panel, Prose, Table, Verdict, literal
from davinci_forces.report.content.marks import AnyMark, Band, Colour, HLine, Line
from davinci_forces.report.context import Context, label
from davinci_forces.report.sections.parts import MS, THESIS_TISSUE, explanation, section_of

COLOURS: tuple[Colour, ...] = ("blue", "vermillion", "purple", "orange")
TISSUES: tuple[Colour, ...] = ("green", "sky", "yellow")
MAX_ADDED_DELAY = 0.1  # [s] longest delay that anybody would add to make a hand stable
SAME, NO_DELAY = "hand, link, arm, filter, sampling", "hand; no delay, link, arm or filter; any switching"
ROWS = (
    *((f"hand_{name}", f"{name.capitalize()} of the hand", "assumed") for name in ("mass", "damping", "stiffness")),
    ("k_t_limit", "**Limit**: formula", SAME),
    ("k_t_response", "Linear response", SAME),
    ("k_t_simulated", "Simulation", SAME),
    ("k_t_settles", "Simulation, all effects", f"{SAME}; friction of the arm, damping of the tissue"),
    ("k_t_cqlf", "Lyapunov function", NO_DELAY),
    ("k_t_switching", "Worst switching", NO_DELAY),
    ("limit_frequency", "Frequency at the limit", ""),
    ("filter_lag", "Filter’s lag", "at that frequency; in logs, if its error is stated"),
    ("filter_share", "Filter’s gain", "at that frequency; in logs, if its error is stated"),
    ("loop_delay", "Delay of the felt force", "filter, arm, link, sampling"),
    ("felt_damping", "Damping felt in free motion", "filter’s error; negative values drive the hand"),
    ("best_delay", "Added delay with the highest limit", "by the response"),
    ("k_t_best", "Limit with that delay", SAME),
    ("damping_needed", "Damping that suffices for the measured tissue", "by the response; the hand’s own may suffice"),
    ("delay_margin", "Added delay until unstable", "all effects; 0: already unstable; –: none up to 1 s"),
)
LAWS: dict[str, tuple[str, Colour]] = {"worst": ("worst switching", "vermillion"), "at contact": ("contact", "blue")}


@section_of("Stability of haptic feedback", "stability", HandLimit)
def section(context: Context, limits: list[HandLimit]) -> Iterator[Block]:
    """The stability limits of each simulated hand.  Section 8.3"""
    tissues = [tissue for tissue in context.catalogue.records(Stiffness) if tissue.pushes and tissue.stiffness > 0.0]
    yield from (verdict(context, limit, tissues) for limit in limits if tissues)
    yield Prose(model(context, limits))
    yield limits_table(context, limits)
    alt = "Limits of the tissue's stiffness over the stiffness of the hand, and over the delay of the force."
    followed = bool(np.isfinite(limits[0].loop_delay))  # else only limits that need no arm are known
    panels = (map_panel(context, tissues), *[delay_panel(context, limits, tissues)] * followed)
    loop = " Whole loop: the limit of each hand above over an added delay." * followed
    hands = [f"{of.hand_mass:g} kg and {of.hand_damping:g} N s/m" for of in context.catalogue.records(StabilityLimit)]
    caption = explanation("stability-limits", hand=as_list(hands), loop=loop)
    yield Figure(caption, alt, panels, "stability-limits", columns=2, height=62)
    yield OnScreen("More on stability: the hand's motion", "more-stability", tuple(motions(context)))


def verdict(context: Context, limit: HandLimit, tissues: list[Stiffness]) -> Verdict:
    """Whether a hand is stable against the stiffest measured tissue: the headline and its interval."""
    key, name = f"stability.{limit.hand}", literal(limit.hand)
    stiffest = max(tissues, key=lambda tissue: tissue.stiffness)
    tissue = context.number(f"tissue.{stiffest.log}.stiffness")
    if limit.k_t_limit != limit.k_t_limit:
        if np.isnan(limit.loop_delay):
            why = "no limit was computed, as the simulated controller does not hold this arm; see [@runs]"
            return Verdict("info", f"Hand “{name}”: {why}.")
        return Verdict("info", f"Hand “{name}”: no limit of the tissue's stiffness was found.")
    headline, settles, needed = context.numbers(key, ("k_t_limit", "k_t_settles", "damping_needed"))
    half = NORMAL_95 * limit.k_t_limit_std  # NaN without logs: then nothing is proved
    if np.isnan(limit.filter_lag_std):
        side = "above" if limit.k_t_limit > stiffest.stiffness else "below"
        text = f"Hand “{name}”: the limit, {headline}, is {side} the measured tissue, {tissue}."
        lag = context.number(f"{key}.filter_lag", 2)
        why = f"The filter's lag, {lag}, is assumed, or is of short logs, so stability is not rated."
        remedy = "To measure it, record more free motion of the prismatic joint, also for identification."
        return Verdict("info", f"{text} {why} {remedy}")
    stable = limit.k_t_limit - half > stiffest.stiffness and limit.delay_margin != 0.0  # NaN if no delay is too much
    words = f"{'**stable** against' if stable else 'may oscillate against'} the measured tissue, {tissue}"
    if limit.k_t_limit + half < stiffest.stiffness:
        words = f"**not stable** against the measured tissue, {tissue}; a damping of {needed} is needed"
    none = ", which cannot be told from none" if limit.k_t_limit <= half else ""
    return Verdict(
        "good" if stable else "warn",
        f"Hand “{name}”: {words}. Feedback is stable on elastic tissue of up to {headline}{none}. With friction of the "
        f"arm and damping of the tissue, simulation finds {settles}.",
    )


def model(context: Context, limits: list[HandLimit]) -> str:
    """State the assumed hands, device, link and controller, which limits are the same, and what they prove.  Fig 8.9"""
    haptics = context.study.haptics
    late = MS * (haptics.position_delay + haptics.force_delay)
    delay = f"{late:g} ms of delay" if late else "no delay"
    origin = " The thesis states no stiffness of the hand." if context.compares_with_thesis else ""
    rows = [(x.k_t_limit, x.k_t_response, x.k_t_simulated) for x in limits]
    apart = [max(row) / min(row) - 1.0 for row in rows if np.isfinite(row).all()]
    agree = f"{explanation('stability-agree')} Here they agree within {100.0 * max(apart):.1f} %. " if apart else ""
    region = "the red region of the thesis's Figure 8.9" if context.compares_with_thesis else "the shaded region"
    return explanation("stability", haptics=haptics, delay=delay, origin=origin, agree=agree, region=region)


def limits_table(context: Context, limits: list[HandLimit]) -> Table:
    """The limits of all hands, with what each includes."""
    rows = tuple(
        (name, *(dash(limit, field) or context.number(f"stability.{limit.hand}.{field}", 3) for limit in limits), what)
        for field, name, what in ROWS
        if np.isfinite(limits[0].loop_delay) or np.isfinite(getattr(limits[0], field))
    )
    header = ("Quantity", *(literal(limit.hand) for limit in limits), "Includes")
    return Table(explanation("stability-table"), header, rows, "stability-table", "l" + "r" * len(limits) + "l")


def dash(limit: HandLimit, field: str) -> str:
    """A dash in place of an additional delay so long that nobody would add it, and of its limit; else ""."""
    return "–" * (field in ("best_delay", "k_t_best") and limit.best_delay > MAX_ADDED_DELAY)


def map_panel(context: Context, tissues: list[Stiffness]) -> Panel:
    """Fig 8.9 with the exact curves and the tissues."""
    beyond = "red in Fig 8.9" if context.compares_with_thesis else "no Lyapunov function"
    marks: list[AnyMark] = []
    for limit in context.catalogue.records(StabilityLimit):
        top = np.full(len(limit.k_h), limit.k_t_switching.max())
        marks += [
            Band(limit.k_h, limit.k_t_cqlf, top, beyond, "vermillion"),
            Line(limit.k_h, limit.k_t_cqlf, "Lyapunov function", "black", "solid"),
            Line(limit.k_h, limit.k_t_switching, "worst switching", "vermillion", "dashed"),
        ]
    marks += tissue_lines(context, tissues)
    across, up = "stiffness of the hand [N/m]", "stiffness of tissue [N/m]"
    return Panel("Without delay", across, up, tuple(marks), x_log=True, y_log=True)


def tissue_lines(context: Context, tissues: list[Stiffness]) -> Iterator[HLine]:
    """The measured tissues by their logs; in simulations of the thesis's experiments, also the tissue of the thesis."""
    for tissue, colour in zip(tissues, cycle(TISSUES), strict=False):
        yield HLine(tissue.stiffness, literal(tissue.log), colour, "solid")
    if context.compares_with_thesis:
        yield HLine(THESIS_TISSUE, "thesis's tissue", "black", "dotted")


def delay_panel(context: Context, limits: list[HandLimit], tissues: list[Stiffness]) -> Panel:
    """The limit of each hand over an additional delay."""
    marks: list[AnyMark] = []
    for limit, colour in zip(limits, cycle(COLOURS), strict=False):
        known, name = limit.k_t_delay > 0.0, literal(limit.hand)
        marks.append(Line(MS * limit.delay[known], limit.k_t_delay[known], name, colour, "solid"))
    marks += tissue_lines(context, tissues)
    return Panel("Whole loop", "added delay [ms]", "stiffness of tissue [N/m]", tuple(marks), y_log=True)


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
    alt = "A spiral that grows under the worst switching, and one that shrinks to rest if the tissue acts in contact."
    panels = (
        Panel("Phase plane", label(runs[0], "hand_x"), label(runs[0], "hand_dx"), phase),
        Panel("Position", "time [s]", label(runs[0], "hand_x"), position),
        Panel("Energy", "time [s]", label(runs[0], "V"), energy, y_log=True),
    )
    yield Figure(explanation("stability-motion", stiffness=k_t), alt, panels, "stability-motion", columns=3, height=52)
