"""Stability limits of haptic feedback from tissue: one headline, its checks, and what else limits it."""

from collections.abc import Iterator
from itertools import cycle

import numpy as np

from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records import HandLimit, HapticMotion, StabilityLimit, Stiffness
from davinci_forces.report.content import Block, Figure, OnScreen, Panel, Prose, Table, Verdict, literal
from davinci_forces.report.content.marks import AnyMark, Band, Colour, HLine, Line
from davinci_forces.report.context import Context, label
from davinci_forces.report.sections.parts import MS, THESIS_TISSUE, hand_name, section_of

COLOURS: tuple[Colour, ...] = ("blue", "vermillion", "purple", "orange")
TISSUES: tuple[Colour, ...] = ("green", "sky", "yellow")
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
    yield Prose(f"{model(context, limits)}\n\n{without_delay(context)}")
    yield limits_table(context, limits)
    caption = (
        "Limits of the tissue's stiffness. Left, without delay: the stiffness up to which a Lyapunov function exists "
        "(line), and up to which the worst switching is stable (dashed). Right: the whole loop over an added delay."
    )
    alt = "Limits of the tissue's stiffness over the stiffness of the hand, and over the delay of the force."
    panels = (map_panel(context, tissues), delay_panel(context, limits, tissues))
    yield Figure(caption, alt, panels, "stability-limits", columns=2, height=62)
    yield OnScreen("More on stability: the hand's motion", "more-stability", tuple(motions(context)))


def verdict(context: Context, limit: HandLimit, tissues: list[Stiffness]) -> Verdict:
    """Whether a hand is stable against the stiffest measured tissue: the headline and its interval."""
    key, name = f"stability.{limit.hand}", hand_name(context, limit.hand)
    stiffest = max(tissues, key=lambda tissue: tissue.stiffness)
    tissue = context.number(f"tissue.{stiffest.log}.stiffness")
    if limit.k_t_limit != limit.k_t_limit:
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
    """State the assumed hands, device, link and controller, and which of the limits are the same."""
    haptics = context.study.haptics
    late = MS * (haptics.position_delay + haptics.force_delay)
    delay = f"{late:g} ms of delay" if late else "no delay"
    scales = f"motion is scaled by {haptics.device.motion:g} and force by {haptics.device.force:g}"
    origin = " The thesis states no stiffness of the hand." if context.compares_with_thesis else ""
    rows = [(x.k_t_limit, x.k_t_response, x.k_t_simulated) for x in limits]
    apart = [max(row) / min(row) - 1.0 for row in rows if np.isfinite(row).all()]
    agree = f"Here they agree within {100.0 * max(apart):.1f} %. " if apart else ""
    return (
        "A surgeon's hand on a haptic device is modelled as a mass $m$ on a spring $K_H$ and a damper $b$; tissue is a "
        f"spring $K_T$ on one side of its surface. The hands are assumed.{origin} The limit is that of a hand that is "
        "pressed into elastic tissue and stays in contact. Formula, response and simulation state the same limit: the "
        "formula takes the filter's lag and gain, from logs if there are any, at the frequency at which the hand would "
        f"oscillate; the response and the simulation contain the filter itself. {agree}The last column of "
        f"[@stability-table] says what each row includes. They also assume messages at {haptics.link_rate:g} Hz with "
        f"{delay} but the wait for a message, and a controller at {haptics.rate:g} Hz; {scales}. State others, and "
        "other hands, in a scenario: `davinci-forces haptics --template` prints one, with all that it assumes."
    )


def without_delay(context: Context) -> str:
    """Explain what the map of Lyapunov functions proves, and what it does not prove.  Fig 8.9"""
    region = "the red region of the thesis's Figure 8.9" if context.compares_with_thesis else "the shaded region"
    return (
        "A common quadratic Lyapunov function exists if and only if $K_T < b^2/m + 2 b sqrt(K_H/m)$; see "
        "[@stability-limits]. This function covers tissue that switches at any time, but neither delay nor sampling. "
        f"In {region} no such function exists, which proves nothing about real tissue. Real tissue acts only in "
        "contact. Then $V = 1/2 m dot(x)^2 + 1/2 K_H x^2 + 1/2 K_T max(x, 0)^2$ falls at the rate $b dot(x)^2$, if the "
        "force comes at once. So delay and sampling set the limit, not switching. `davinci-forces stability` also "
        "solves the linear matrix inequality of the function."
    )


def limits_table(context: Context, limits: list[HandLimit]) -> Table:
    """The limits of all hands, with what each includes."""
    keys = [f"stability.{limit.hand}" for limit in limits]
    rows = tuple((name, *(context.number(f"{key}.{field}", 3) for key in keys), what) for field, name, what in ROWS)
    caption = (
        "Limits of the tissue's stiffness, and what they follow from. The standard error of the formula's limit "
        "includes those of the filter's lag and gain, by a jackknife over segments of logs, and of the arm's "
        "parameters. A dash marks a limit that was not found, or an error that is not known."
    )
    header = ("Quantity", *(hand_name(context, limit.hand) for limit in limits), "Includes")
    return Table(caption, header, rows, "stability-table", "l" + "r" * len(limits) + "l")


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
        known, name = limit.k_t_delay > 0.0, hand_name(context, limit.hand)
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
    caption = (
        f"The same hand and tissue of {k_t}, above both limits of arbitrary switching. The motion is unstable under "
        "the worst switching, and stable if the tissue acts only in contact. Under the worst switching V is not the "
        "stored energy, so V can rise."
    )
    alt = "A spiral that grows under the worst switching, and one that shrinks to rest if the tissue acts in contact."
    panels = (
        Panel("Phase plane", label(runs[0], "hand_x"), label(runs[0], "hand_dx"), phase),
        Panel("Position", "time [s]", label(runs[0], "hand_x"), position),
        Panel("Energy", "time [s]", label(runs[0], "V"), energy, y_log=True),
    )
    yield Figure(caption, alt, panels, "stability-motion", columns=3, height=52)
