"""Simulated control studies: PD with gravity compensation, and PID where the masses are not known exactly."""

from collections.abc import Iterator

from davinci_forces.records import Control, Lyapunov
from davinci_forces.report.content import Block, Figure, Panel, Prose, Table, Verdict
from davinci_forces.report.content.marks import HLine, Line
from davinci_forces.report.context import Context, label, title
from davinci_forces.report.sections.parts import explanation, section_of
from davinci_forces.robots.robot import ControlStudy, Kind

SHARE_DRAWN = 0.5  # of a study's time, in which it settles


@section_of("Control, in simulation", "control", Control)
def section(context: Context, runs: list[Control]) -> Iterator[Block]:
    """Simulations of the robot's controllers.  Fig 5.2-5.6"""
    names = {run.controller for run in runs}
    studies = [study for study in context.study.robot.control if study.name in names]
    exact = [study for study in studies if study.known_masses == 1.0]
    light, thesis = [study for study in studies if study.known_masses != 1.0], context.compares_with_thesis
    gains = ", as in the thesis's chapter 5 (gains of Tables 5.1 and 5.4)" * thesis
    unstated = ", which the thesis does not state," * thesis
    friction = viscous_friction(context, studies[0])
    yield Prose(explanation("control", gains=gains, unstated=unstated, friction=friction))
    for study in exact:
        rise, start = (context.results.get(f"control.{study.name}.{name}") for name in ("V_rise", "V_0"))
        if rise and start:
            verdict = f"{study.title}: $V$ starts at {start.number(4)} and rises by {rise.number(2)} at the most."
            yield Verdict("good" if rise.value == 0 else "bad", verdict)
        yield response(context, study)
    if exact:
        caption = "Time after which each joint stays within 2 % of its step, overshoot over the step, and error at the "
        columns = {"Settling time": "settling_time", "Overshoot": "overshoot", "Error at the end": "error_end"}
        yield table(context, exact, f"{caption}end.", columns)
    if light:
        faster = " The thesis calls the response faster, which this simulation does not confirm." * thesis
        yield Prose(explanation("control-masses", faster=faster))
        share, end = light[0].known_masses, f"{light[0].duration:g} s"
        caption = f"Position error when gravity is compensated with {share:g} of the masses, after 10, 20 and {end}."
        columns = {"After 10 s": "error_10", "After 20 s": "error_20", f"After {end}": "error_end"}
        yield table(context, light, caption, columns)


def viscous_friction(context: Context, study: ControlStudy) -> str:
    """The friction that a study assumes, joint by joint."""
    kinds = {joint.name: joint.kind for joint in context.study.robot.joints}  # the coordinates of a wrist turn
    values = zip(context.study.robot.coordinates, study.viscous, strict=False)
    rubbing = [
        f"{value:g} {kinds.get(name, Kind.REVOLUTE).unit('{effort} s/{position}')} at the {title(name).lower()}"
        for name, value in values if value
    ]  # fmt: skip
    return (", ".join(rubbing) + ", and none elsewhere") if rubbing else "of none"


def response(context: Context, study: ControlStudy) -> Figure:
    """Positions, velocities and the Lyapunov function of a study."""
    until = SHARE_DRAWN * study.duration
    runs = context.catalogue.select(Control, controller=study.name)
    names = [joint.name for joint in context.study.robot.joints]
    q = tuple(Line(run.t[run.t < until], run.q[run.t < until], title(run.joint)) for run in runs)
    identified = [run for run in runs if run.joint in names]
    dq = tuple(Line(run.t[run.t < until], run.dq[run.t < until], title(run.joint)) for run in identified)
    panels = [
        Panel("Position", "time [s]", "position [rad or m]", q),
        Panel("Velocity of the joints that are identified", "time [s]", "velocity [rad/s or m/s]", dq),
    ]
    for lyapunov in context.catalogue.select(Lyapunov, controller=study.name):
        early = lyapunov.t < until
        line = (Line(lyapunov.t[early], lyapunov.V[early], "", "black"), HLine(0.0))
        panels.append(Panel("Lyapunov function", "time [s]", label(lyapunov, "V"), line))
    caption = f"Simulated: {study.title}."
    alt = f"Positions and velocities over time, and the Lyapunov function falling to zero: {study.title}."
    return Figure(caption, alt, tuple(panels), columns=3, height=52)


def table(context: Context, studies: list[ControlStudy], caption: str, columns: dict[str, str]) -> Table:
    """Some numbers of each joint of studies: the header of each column, and the end of its keys."""
    rows = tuple(
        (study.name, title(run.joint), *context.numbers(f"control.{run.controller}.{run.joint}", columns.values()))
        for study in studies
        for run in context.catalogue.select(Control, controller=study.name)
    )
    return Table(caption, ("Study", "Joint", *columns), rows, align="llrrr")
