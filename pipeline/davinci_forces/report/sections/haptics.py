"""A simulated hand with haptic feedback from the tissue: forces over time, and their fidelity."""

from collections.abc import Iterator

from davinci_forces.maths.arrays import Array
from davinci_forces.records import HapticResponse, HapticRun
from davinci_forces.report.content import Block, Figure, Listing, OnScreen, Panel, Prose, literal
from davinci_forces.report.content.marks import AnyMark, HLine, Line, VLine
from davinci_forces.report.context import Context, title
from davinci_forces.report.sections.parts import MM, MS, explanation, section_of, spans_where

SAMPLES_DRAWN = 300  # samples of a run in its figure


@section_of("Haptic loop, simulated", "haptics", HapticRun)
def section(context: Context, runs: list[HapticRun]) -> Iterator[Block]:
    """The haptic loop.  Section 8.4"""
    responses = context.catalogue.records(HapticResponse)
    yield Prose(experiment(context, responses))
    for response in responses:
        yield OnScreen("The scenario of these limits", "haptic-scenario", (Listing(response.scenario),))
    figures = (*(traces(context, run) for run in runs), *map(response_figure, responses))
    yield OnScreen("The force that each hand feels, over time and over frequency", "haptic-loop", figures)


def experiment(context: Context, responses: list[HapticResponse]) -> str:
    """Describe the simulated experiment."""
    thesis = context.compares_with_thesis
    text = explanation("haptics", whose=": the experiment of the thesis’s section 8.4" if thesis else "")
    if not responses:
        return text
    response = responses[0]
    arm = {
        "the thesis": "that of the thesis" if thesis else "an assumed one",
        "the scenario": "that of the scenario",
    }.get(response.arm_from, explanation("haptics-fit", joint=title(response.arm_from).lower()))
    names = ("tissue_stiffness", "rendered_stiffness", "at_frequency", "felt_delay")
    true, felt, frequency, late = context.numbers("haptics", names)
    return (
        f"{text}\n\nThe model of the slide is {arm}; the model's error on the real arm is not included. To a hand that "
        f"moves at {frequency}, tissue of {true} feels like {felt}, with a delay of {late}.\n\n"
        f"{explanation('haptics-scenario')}"
    )


def traces(context: Context, run: HapticRun) -> Figure:
    """Fig 8.12 of one hand: positions above, forces below, contact shaded."""
    few = slice(None, None, max(len(run) // SAMPLES_DRAWN, 1))
    t = run.t[few]
    shaded = spans_where(run.t, run.true_force > 0.0, "contact")
    ends = " The run ends where the hand leaves the device's reach." if run.out_of_reach else ""
    positions: tuple[AnyMark, ...] = (
        *shaded,
        HLine(0.0),
        Line(t, MM * run.plan_x[few], "plan", "grey", "dotted"),
        Line(t, MM * run.hand_x[few], "hand", "blue", "solid"),
        Line(t, MM * run.arm_x[few], "arm", "orange", "dashed"),
    )
    forces: tuple[AnyMark, ...] = (
        *shaded,
        Line(t, run.true_force[few], "true", "black", "solid"),
        Line(t, run.felt_force[few], "felt", "vermillion", "dashed"),
    )
    hand, error = literal(run.hand), context.number(f"haptics.{run.hand}.felt_error", 2)
    caption = explanation("haptic-run", hand=hand, error=error, ends=ends)
    alt = (
        f"Positions of hand and arm over {run.t[-1] - run.t[0]:.0f} s, and below them a true force of at most "
        f"{run.true_peak:.2g} N and a felt force of at most {run.felt_peak:.2g} N."
    )
    panels = (
        Panel("Position", "time [s]", "position [mm]", positions),
        Panel("Force", "time [s]", "force [N]", forces),
    )
    return Figure(caption, alt, panels, f"haptic-{run.hand}", height=42)


def response_figure(response: HapticResponse) -> Figure:
    """The share of the tissue's stiffness that a hand feels, and the delay, over frequency."""

    def panel(name: str, unit: str, y: Array, *marks: AnyMark) -> Panel:
        line, at = Line(response.frequency, y, "", "blue", "solid"), VLine(response.at_frequency)
        return Panel(name, "frequency [Hz]", unit, (line, at, *marks), x_log=True)

    alt = (
        f"Two curves over frequency: the felt share of the stiffness, {response.felt_share.min():.2f} to "
        f"{response.felt_share.max():.2f}, and its delay, at most {MS * response.felt_late.max():.0f} ms."
    )
    panels = (
        panel("Felt stiffness over true", "share", response.felt_share, HLine(1.0)),
        panel("Delay of the felt force", "delay [ms]", MS * response.felt_late),
    )
    return Figure(explanation("haptic-response"), alt, panels, "haptic-response", columns=2, height=42)
