"""The noise of position, velocity and effort, from the spread between periods.  (6.3.3)"""

from collections.abc import Iterator

import numpy as np

from pipeline.records import Average, PeriodResidual, Signal, Spectrum, Trajectory, Whiteness
from pipeline.report.content import (
    Block,
    Figure,
    Histogram,
    Line,
    Panel,
    Points,
    Prose,
    Reference,
    Section,
    Table,
    literal,
)
from pipeline.report.context import Context, label, title
from pipeline.report.plots import autocorrelation, histogram, normal_scores


def section(context: Context) -> Section | None:
    """A table of standard deviations, and for each identification log and joint what averaging removed."""
    averages = context.catalogue.all(Average)
    if not averages:
        return None
    return Section("Averaging and noise", "noise", tuple(blocks(context, averages)))


def blocks(context: Context, averages: list[Average]) -> Iterator[Block]:
    """The section's content."""
    yield Prose(
        "Every identification log repeats one period. Its periods are averaged, and what differs between them is "
        "taken as noise: its standard deviations set what the filter assumes of its measurements. The period itself is "
        "estimated from the joints' motion."
    )
    rows = tuple(
        (
            literal(a.log),
            title(a.joint),
            context.number(f"period.{a.log}", 6),
            context.count(f"period.{a.log}.periods"),
            *(context.number(f"noise.{a.log}.{a.joint}.{s}", 3) for s in ("sigma_q", "sigma_dq", "sigma_tau")),
        )
        for a in averages
    )
    header = ("Log", "Joint", "Period", "Periods", "Position noise", "Velocity noise", "Effort noise")
    yield Table(
        "Noise between periods (standard deviations of one sample). The standard error of a period takes what its "
        "harmonics leave as white, and is too small where it is not.",
        header,
        rows,
        "noise-table",
        "llrrrrr",
    )
    for average in averages:
        yield from average_figures(context, average)


def average_figures(context: Context, average: Average) -> Iterator[Block]:
    """The figures of one log and joint."""
    about = {"log": average.log, "joint": average.joint}
    period_residuals = context.catalogue.about(PeriodResidual, **about)
    trajectories = context.catalogue.about(Trajectory, **about)
    spectra, signals = context.catalogue.about(Spectrum, **about), context.catalogue.about(Signal, **about)
    if not (period_residuals and trajectories and spectra and signals):
        return
    whiteness = {w.signal: w for w in context.catalogue.about(Whiteness, **about)}
    name = f"{title(average.joint)} in {literal(average.log)}"
    yield Figure(
        f"{name}: the mean of {average.periods} periods and the first of them; the position's spectrum with the "
        "harmonics that are kept; velocity and acceleration from those harmonics and from differences of the logged "
        "position and velocity.",
        f"Four panels for {name}: averaged effort, spectrum of the position, velocity and acceleration.",
        (one_period(average, signals[0]), spectrum(spectra[0]), *derivatives(average, trajectories[0])),
        columns=2,
        height=45,
    )
    yield Figure(
        f"{name}: what averaging removed. Histogram of the effort noise with the normal density of the same "
        "standard deviation; normal probability plot of the position noise; autocorrelation of the velocity noise with "
        "the 95 % band of white noise.",
        f"Three panels for {name}: histogram, normal probability plot and autocorrelation of the noise.",
        tuple(noise_panels(period_residuals[0], whiteness)),
        columns=3,
        height=45,
    )


def one_period(average: Average, signal: Signal) -> Panel:
    """The mean period and the first one.  Fig 6.6"""
    first = signal.t - signal.t[0] < average.period
    marks = (
        Line(signal.t[first] - signal.t[0], signal.tau[first], "first period", "sky"),
        Line(average.t, average.tau, "mean", "vermillion"),
    )
    return Panel("Effort", "time [s]", label(average, "tau", "effort"), marks)


def spectrum(s: Spectrum) -> Panel:
    """The spectrum of the position, and the harmonics that are kept of it.  Fig 6.8"""
    shown = slice(0, min(len(s.amplitude), max(4 * s.harmonics, 20)))
    kept = np.arange(len(s.amplitude)) <= s.harmonics
    f, a = s.frequency[shown], np.maximum(s.amplitude[shown], 1e-12)
    k = kept[shown]
    marks = (Points(f[k], a[k], "kept", "blue"), Points(f[~k], a[~k], "taken as noise", "grey"))
    return Panel("Spectrum of the position", "frequency [Hz]", label(s, "amplitude", "amplitude"), marks, y_log=True)


def derivatives(average: Average, trajectory: Trajectory) -> tuple[Panel, Panel]:
    """Velocity and acceleration from the harmonics and by differences.  Fig 6.9"""
    step = average.t[1] - average.t[0]
    velocity = (
        Line(average.t, np.gradient(average.q, step), "difference of position", "sky"),
        Line(trajectory.t, trajectory.dq, "harmonics", "vermillion"),
    )
    acceleration = (
        Line(average.t, np.gradient(average.dq, step), "difference of velocity", "sky"),
        Line(trajectory.t, trajectory.ddq, "harmonics", "vermillion"),
    )
    return (
        Panel("Velocity", "time [s]", label(trajectory, "dq", "velocity"), velocity),
        Panel("Acceleration", "time [s]", label(trajectory, "ddq", "acceleration"), acceleration),
    )


def noise_panels(period_residual: PeriodResidual, whiteness: dict[str, Whiteness]) -> Iterator[Panel]:
    """Histogram, normal probability plot and autocorrelation of what averaging removed.  Fig 6.7, 6.10, 6.11"""
    edges, densities, grid, normal = histogram(period_residual.tau_noise)
    bars = (Histogram(edges, densities, "", "sky"), Line(grid, normal, "normal", "vermillion"))
    yield Panel("Effort noise", label(period_residual, "tau_noise", "effort"), "density", bars)
    scores, ordered, slope, middle = normal_scores(period_residual.q_noise)
    yield Panel(
        "Position noise",
        "normal quantile",
        label(period_residual, "q_noise", "position"),
        (Points(scores, ordered, "", "blue"), Reference(slope, middle, "normal", "vermillion")),
    )
    if w := whiteness.get("dq_noise"):
        yield autocorrelation(w, "Velocity noise")
