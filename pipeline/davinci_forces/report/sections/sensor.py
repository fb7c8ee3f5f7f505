"""The estimated force beside that of a force sensor, in logs that have one: how far apart and how late."""

from collections.abc import Iterator, Sequence

from davinci_forces.records import SensorForce
from davinci_forces.report.content import (
    Band,
    Block,
    Cell,
    Figure,
    Line,
    OnScreen,
    Panel,
    Prose,
    Section,
    Table,
    literal,
)
from davinci_forces.report.content.marks import AnyMark
from davinci_forces.report.context import Context, label, title
from davinci_forces.report.sections.parts import listed
from davinci_forces.report.verdicts import NORMAL_95, band_in_words

ANCHOR = 0.0307  # root mean square error over range of a neural network on the dVRK, Yang et al. (2024)
WHOLE = "vector"


def section(context: Context) -> Section | None:
    """A table of all logs with a sensor, beside the best that is published for this arm, and both forces over time."""
    every = context.catalogue.all(SensorForce)
    return Section("Against a force sensor", "sensor", tuple(blocks(context, every))) if every else None


def blocks(context: Context, every: Sequence[SensorForce]) -> Iterator[Block]:
    """The section's content."""
    yield Prose(
        "A sensor measured the force in these logs; nothing was fitted to it. The error is the estimated force less "
        "what the sensor shows at that instant, over the whole log but the filter's first second and poses near a "
        "singularity. The lag is how much later the sensor shows a force than it is estimated, by their "
        "correlation; it is part of the error. Coverage is the share of samples whose 95 % band holds what the sensor "
        "shows, its noise included.\n\nAs a yardstick: a neural network on the da Vinci Research Kit came to "
        f"{100 * ANCHOR:.2f} % of range, the root mean square error averaged over axes by the range averaged over axes "
        "(Yang et al. 2024, arXiv:2405.07453), which is how the row **vector** states it here."
    )
    yield from listed(table(context, every))
    first, *others = dict.fromkeys(one.log for one in every)
    yield figure([one for one in every if one.log == first])
    for log in others:
        yield OnScreen(
            f"Both forces in {literal(log)}", f"sensor-{log}", (figure([one for one in every if one.log == log]),)
        )


def table(context: Context, every: Sequence[SensorForce]) -> Table:
    """The errors of every log and axis; the yardstick last."""
    names = ("rmse", "bias", "largest", "range", "relative_error", "lag", "coverage")
    rows: list[tuple[Cell, ...]] = [
        (
            literal(one.log),
            axis_name(one.axis),
            *context.numbers(f"sensor.{one.log}.{one.axis}", names),
            band_in_words(one.sensor_coverage),
        )
        for one in every
    ]
    rows.append(("Yang et al. 2024", "three axes", "–", "–", "–", "–", f"{ANCHOR}", "–", "–", "–"))
    return Table(
        "The estimated force less that of the sensor: root mean square, mean, and largest; the range of what the "
        "sensor shows, and the first as a share of it; lag of the sensor; share of samples within the 95 % band.",
        ("Log", "Axis", "RMSE", "Bias", "Largest", "Range", "Of range", "Lag", "Coverage", "Band"),
        tuple(rows),
        "sensor-errors",
        "llrrrrrrrl",
    )


def axis_name(axis: str) -> str:
    """An axis as a reader knows it."""
    return f"${axis}_0$" if axis in ("x", "y", "z") else title(axis).lower()


def figure(own: Sequence[SensorForce]) -> Figure:
    """Both forces of one log over time, axis by axis."""
    log = literal(own[0].log)
    shown = [one for one in own if one.axis != WHOLE] or [*own]
    largest = max(one.force_error_max for one in shown)
    return Figure(
        f"{log}: the force by the sensor, and as it is estimated with its 95 % band.",
        f"The estimated force in {log} over that of the sensor; they are at most {largest:.2g} N apart along an axis.",
        tuple(panel(one, i == 0) for i, one in enumerate(shown)),
        f"sensor-time-{own[0].log}",
        zoomable=True,
        height=32,
    )


def panel(one: SensorForce, named: bool) -> Panel:
    """One axis."""
    known = one.estimated_force_std * NORMAL_95
    lower, upper = one.estimated_force - known, one.estimated_force + known
    marks: tuple[AnyMark, ...] = (
        Band(one.t, lower, upper, "95 % band" if named else "", "sky"),
        Line(one.t, one.measured_force, "sensor" if named else "", "black"),
        Line(one.t, one.estimated_force, "estimate" if named else "", "vermillion"),
    )
    what = {"x": "Along x0", "y": "Along y0", "z": "Along z0"}.get(one.axis, title(one.axis))
    return Panel(what, "time [s]", label(one, "measured_force", "force"), marks)
