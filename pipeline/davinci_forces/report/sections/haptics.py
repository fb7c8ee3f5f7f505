"""A simulated hand that feels the tissue through the arm: what it feels over time, how truly, and its margins."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.records import HapticResponse, HapticRun
from davinci_forces.report.content import (
    Block,
    Cell,
    Figure,
    HLine,
    Line,
    OnScreen,
    Panel,
    Prose,
    Section,
    Table,
    Verdict,
    VLine,
    VSpan,
    literal,
)
from davinci_forces.report.content.marks import AnyMark
from davinci_forces.report.context import Context, title

MM, MS = 1e3, 1e3
SHOWN = 300  # samples of a run that are drawn


def section(context: Context) -> Section | None:
    """The haptic loop, where one was simulated."""
    runs = context.catalogue.all(HapticRun)
    return Section("Haptic loop, simulated", "haptics", tuple(blocks(context, runs))) if runs else None


def blocks(context: Context, runs: list[HapticRun]) -> Iterator[Block]:
    """The section's content.  Section 8.4"""
    yield from (verdict(context, run) for run in runs)
    responses = context.catalogue.all(HapticResponse)
    yield OnScreen(
        "The haptic loop, simulated: what each hand feels, how true it is, and its margins",
        "haptic-loop",
        (
            Prose(told(context, responses)),
            *(traces(run) for run in runs),
            *(response(one) for one in responses),
            margins(context, runs),
        ),
    )


def verdict(context: Context, run: HapticRun) -> Verdict:
    """Whether a hand is stable against the tissue, and where its limit is."""
    key, name = f"haptics.{run.hand}", f"**Simulated**, hand “{literal(run.hand)}”"
    limit, margin = context.numbers(key, ("k_t_settles", "stiffness_margin"), 2)
    where = f"it settles against tissue up to {limit}, {margin} times the measured one"
    if not run.k_t_settles > 0.0:
        where = "no limit of the tissue's stiffness was found"
    if run.out_of_reach:
        return Verdict("warn", f"{name}: **unstable**, thrown out of the device's reach at {run.t[-1]:.1f} s; {where}.")
    stable = run.delay_margin != 0.0  # NaN where no delay was found that it does not bear
    off = context.number(f"{key}.felt_error", 2)
    said = "stable" if stable else "goes in and out within reach, but is **unstable** when it stays in the tissue"
    return Verdict("good" if stable else "warn", f"{name}: {said}; {where}; what it feels is off by {off} (rms).")


def told(context: Context, responses: list[HapticResponse]) -> str:
    """What was simulated."""
    said = (
        "**Simulated**, not recorded: the experiment of the thesis's section 8.4. A hand, mass on spring and damper "
        "(8.2), holds the haptic device; its position crosses the link to the arm, whose cascaded controllers follow "
        "it against friction and tissue; of the arm's position, velocity and current the extended Kalman filter makes "
        "a force, one sample at a time, as it does in all logs; and that crosses the link back and is held by the "
        "device until the next message."
    )
    if not responses:
        return said
    one = responses[0]
    arm = {"the thesis": "as in the thesis", "the scenario": "of the scenario"}.get(
        one.arm_from, f"as the fit of the {title(one.arm_from).lower()} has it, which the filter knows, too"
    )
    names = ("tissue_stiffness", "rendered_stiffness", "at_frequency", "felt_delay")
    true, felt, frequency, late = context.numbers("haptics", names)
    return (
        f"{said}\n\nWhat slides is {arm}: the model's error on the real arm comes on top. Tissue of {true} feels like "
        f"{felt} to a hand that moves at {frequency}, {late} late. A hand in contact that no longer settles swings "
        "ever further, or without end, when it lets go of a quarter of its push. The limit by simulation knows the "
        "arm's friction, which makes the felt force hunt near rest; the one by response takes the loop as linear. Both "
        "count the damping of the tissue, which limits of delay alone leave out. Your own numbers: `davinci-forces "
        "haptics --help`."
    )


def traces(run: HapticRun) -> Figure:
    """Fig 8.12 of one hand: positions above, forces below, contact shaded."""
    few = slice(None, None, max(len(run) // SHOWN, 1))
    t = run.t[few]
    shaded = tuple(spans(run))
    ends = " The run ends where the hand leaves the device's reach." if run.out_of_reach else ""
    return Figure(
        f"Simulated, hand “{literal(run.hand)}” in and out of the tissue, contact shaded: where it would be if it felt "
        f"nothing, where it is and where the arm is, from the tissue's surface; and the true and the felt force.{ends}",
        f"Positions of hand and arm over {run.t[-1] - run.t[0]:.0f} s, and below them a true force of at most "
        f"{run.true_peak:.2g} N and a felt one of at most {run.felt_peak:.2g} N.",
        (
            Panel(
                "Position",
                "time [s]",
                "position [mm]",
                (
                    *shaded,
                    HLine(0.0),
                    Line(t, MM * run.plan_x[few], "plan", "grey", "dotted"),
                    Line(t, MM * run.hand_x[few], "hand", "blue", "solid"),
                    Line(t, MM * run.arm_x[few], "arm", "orange", "dashed"),
                ),
            ),
            Panel(
                "Force",
                "time [s]",
                "force [N]",
                (
                    *shaded,
                    Line(t, run.true_force[few], "true", "black", "solid"),
                    Line(t, run.felt_force[few], "felt", "vermillion", "dashed"),
                ),
            ),
        ),
        f"haptic-{run.hand}",
        height=42,
    )


def spans(run: HapticRun) -> Iterator[AnyMark]:
    """The contacts of a run."""
    touched = np.concatenate([[False], run.true_force > 0.0, [False]])
    edges = np.flatnonzero(touched[1:] != touched[:-1])
    for i, (start, end) in enumerate(edges.reshape(-1, 2).tolist()):
        yield VSpan(float(run.t[start]), float(run.t[min(end, len(run) - 1)]), "" if i else "contact")


def response(one: HapticResponse) -> Figure:
    """How much of the tissue is felt, and how late."""

    def panel(name: str, unit: str, y: Array, *others: AnyMark) -> Panel:
        at = VLine(one.at_frequency)
        return Panel(
            name, "frequency [Hz]", unit, (Line(one.frequency, y, "", "blue", "solid"), at, *others), x_log=True
        )

    return Figure(
        "Simulated: the stiffness that a hand feels over the one that there is, by the frequency of its motion in the "
        "tissue; and how late.",
        f"Two curves over frequency: the felt share of the stiffness, {one.felt_share.min():.2f} to "
        f"{one.felt_share.max():.2f}, and its delay, at most {MS * one.felt_late.max():.0f} ms.",
        (
            panel("Felt stiffness over true", "share", one.felt_share, HLine(1.0)),
            panel("How late it is felt", "delay [ms]", MS * one.felt_late),
        ),
        "haptic-response",
        columns=2,
        height=42,
    )


def margins(context: Context, runs: list[HapticRun]) -> Table:
    """One row a hand."""
    names = ("hand_mass", "hand_damping", "hand_stiffness", "true_peak", "felt_peak", "k_t_settles", "k_t_response")
    rows: list[tuple[Cell, ...]] = []
    for run in runs:
        cells = context.numbers(f"haptics.{run.hand}", (*names, "delay_margin"))
        rows.append((literal(run.hand), *cells))
    header = (
        "Hand", "Mass", "$b_H$", "$K_H$", "True peak", "Felt peak", "Settles up to", "By response", "Delay it bears",
    )  # fmt: skip
    return Table(
        "Simulated hands: peaks of the true and the felt force; the stiffest tissue that each settles against, by "
        "simulation and by the response of the loop; and how much later still the force may come, 0 where it is late "
        "enough to be unstable. A dash is where no limit was found.",
        header,
        tuple(rows),
        "haptic-margins",
        "lrrrrrrrr",
    )
