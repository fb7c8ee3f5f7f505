"""The estimated force compared with that of a force sensor, in logs that have one: error and lag."""

from collections.abc import Iterator, Sequence

from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records import SensorForce
from davinci_forces.report.content import Block, Cell, Figure, OnScreen, Panel, Prose, Table, literal
from davinci_forces.report.content.marks import Band, Line
from davinci_forces.report.context import Context, label, title
from davinci_forces.report.sections.parts import explanation, paper_or_screen, section_of
from davinci_forces.report.verdicts import band_in_words

PUBLISHED_ERROR = 0.0307  # root mean square error over range of a neural network on the dVRK, Yang et al. (2024)
VECTOR = "vector"  # the axis that stands for all three


@section_of("Against a force sensor", "sensor", SensorForce)
def section(context: Context, forces: list[SensorForce]) -> Iterator[Block]:
    """A table of all logs with a sensor and of the best published error for this arm, and both forces over time."""
    yield Prose(explanation("sensor", error=100 * PUBLISHED_ERROR))
    yield from paper_or_screen(table(context, forces))
    for i, log in enumerate(dict.fromkeys(force.log for force in forces)):
        shown = figure([force for force in forces if force.log == log])
        yield OnScreen(f"Both forces in {literal(log)}", f"sensor-{log}", (shown,)) if i else shown


def table(context: Context, forces: Sequence[SensorForce]) -> Table:
    """The errors of every log and axis; the published error last."""
    names = ("rmse", "bias", "largest", "range", "relative_error", "lag", "coverage")
    rows: list[tuple[Cell, ...]] = []
    for force in forces:
        axis = f"${force.axis}_0$" if force.axis in ("x", "y", "z") else title(force.axis).lower()
        numbers = context.numbers(f"sensor.{force.log}.{force.axis}", names)
        rows.append((literal(force.log), axis, *numbers, band_in_words(force.sensor_coverage)))
    rows.append(("Yang et al. 2024", "three axes", "–", "–", "–", "–", f"{PUBLISHED_ERROR}", "–", "–", "–"))
    header = ("Log", "Axis", "RMSE", "Bias", "Largest", "Range", "RMSE / range", "Lag", "Coverage", "Band")
    return Table(explanation("sensor-errors"), header, tuple(rows), "sensor-errors", "llrrrrrrrl")


def figure(forces: Sequence[SensorForce]) -> Figure:
    """Both forces of one log over time, axis by axis."""
    log = literal(forces[0].log)
    shown = [force for force in forces if force.axis != VECTOR] or [*forces]
    largest = max(force.force_error_max for force in shown)
    caption = f"{log}: the force by the sensor, and the estimated force with its 95 % band."
    alt = f"The estimated force in {log} over that of the sensor; they are at most {largest:.2g} N apart along an axis."
    panels = tuple(panel(force, i == 0) for i, force in enumerate(shown))
    return Figure(caption, alt, panels, f"sensor-time-{forces[0].log}", zoomable=True, height=32)


def panel(force: SensorForce, named: bool) -> Panel:
    """One axis."""
    half = force.estimated_force_std * NORMAL_95
    lower, upper = force.estimated_force - half, force.estimated_force + half
    band, sensor, estimate = ("95 % band", "sensor", "estimate") if named else ("", "", "")
    marks = (
        Band(force.t, lower, upper, band, "sky"),
        Line(force.t, force.measured_force, sensor, "black"),
        Line(force.t, force.estimated_force, estimate, "vermillion"),
    )
    what = f"Along {force.axis}0" if force.axis in ("x", "y", "z") else title(force.axis)
    return Panel(what, "time [s]", label(force, "measured_force", "force"), marks)
