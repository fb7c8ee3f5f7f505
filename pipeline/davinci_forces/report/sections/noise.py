"""The noise of position, velocity and effort, from the spread between periods.  (6.3.3)"""

from collections.abc import Iterator
from itertools import product

import numpy as np

from davinci_forces.records import Average, Column, PeriodResidual, Signal, Spectrum, Trajectory, Whiteness
from davinci_forces.report.content import Block, Figure, OnScreen, Panel, Prose, Table, Verdict
from davinci_forces.report.content.marks import Bars, Histogram, Line, Points
from davinci_forces.report.context import Context, count, label
from davinci_forces.report.sections import parts
from davinci_forces.report.verdicts import MAX_PERIOD_NOISE

NOISE_FIELDS = {"q_noise": "position", "dq_noise": "velocity", "tau_noise": "effort"}
MAX_BARS = 24  # periods in the bar plot


@parts.section_of("Averaging and noise", "noise", Average)
def section(context: Context, averages: list[Average]) -> Iterator[Block]:
    """A table of standard deviations, the tests of the noise, and the noise that averaging removed from each log."""
    yield Prose(parts.explanation("noise"))
    rows = []
    for a in averages:
        key, period = f"noise.{a.log}.{a.joint}", context.number(f"period.{a.log}", 6)
        share = context.number(f"{key}.relative_noise", 2, std=None)
        rows.append((*parts.run_cells(a), period, *context.numbers(key, ("sigma_q", "sigma_dq", "sigma_tau")), share))
    header = ("Log", "Joint", "Period", "Position noise", "Velocity noise", "Effort noise", "Share")
    yield Table(parts.explanation("noise-table"), header, rows, "noise-table", "llrrrrr")
    yield tests(context, averages)
    for average in averages:
        yield from outliers(context, average)
    folded = tuple(
        OnScreen(parts.run_name(a), f"noise-{a.log}-{a.joint}", figures)
        for a in averages
        if (figures := tuple(average_figures(context, a)))
    )
    if folded:
        yield OnScreen("One period of each joint, its spectrum and derivatives, and its noise", "periods", folded)


def tests(context: Context, averages: list[Average]) -> Table:
    """Whether the noise is white and normal, signal by signal."""
    header = ("Log", "Joint", "Signal", "ACF(1)", "White, $p$", "Normal, $p$", "Skewness", "Excess kurtosis")
    rows = []
    for a, (signal, meaning) in product(averages, NOISE_FIELDS.items()):
        key = f"whiteness.{a.log}.{a.joint}.{signal}"
        tested = context.probabilities(key, ("ljung_box_p", "jarque_bera_p"))
        acf, *shape = context.numbers(key, ("acf1", "skewness", "kurtosis"), 2)
        rows.append((*parts.run_cells(a), meaning, acf, *tested, *shape))
    return Table(parts.explanation("noise-tests"), header, rows, "noise-tests", "lllrrrrr")


def outliers(context: Context, average: Average) -> Iterator[Verdict]:
    """Periods that are noisier than the others; a derived velocity errs at the ends of a log, whatever the arm does."""
    about = {"log": average.log, "joint": average.joint}
    derived = any(signal.velocity == "derived" for signal in context.catalogue.select(Signal, **about))
    for residual in context.catalogue.select(PeriodResidual, **about):
        for signal, meaning in NOISE_FIELDS.items():
            if derived and signal == "dq_noise":
                continue
            rms = by_period(residual, average, getattr(residual, signal))
            noisy = [i for i, value in enumerate(rms, 1) if len(rms) > 2 and value > MAX_PERIOD_NOISE * np.median(rms)]
            if noisy:
                times = ", ".join(f"{rms[i - 1] / np.median(rms):.1f}" for i in noisy[:5])
                name = f"**{parts.run_name(average)}**"
                which = f"period{'' if len(noisy) == 1 else 's'} {', '.join(map(str, noisy[:5]))} of {len(rms)}"
                message = f"{name}: {meaning} noise of {which} is {times} times that of the median period."
                start = " The arm may not yet have settled." if noisy[0] == 1 else ""
                yield Verdict("warn", message + start)


def by_period(residual: PeriodResidual, average: Average, noise: Column) -> Column:
    """The root mean square of the noise in each period (M,)."""
    number = np.minimum(((residual.t - average.t_start) / average.period + 1e-9).astype(int), average.periods - 1)
    squares = np.bincount(number, noise**2, average.periods)
    return np.sqrt(squares / np.maximum(np.bincount(number, minlength=average.periods), 1))


def average_figures(context: Context, average: Average) -> Iterator[Block]:
    """The figures of one log and joint."""
    about = {"log": average.log, "joint": average.joint}
    period_residuals = context.catalogue.select(PeriodResidual, **about)
    trajectories = context.catalogue.select(Trajectory, **about)
    spectra, signals = context.catalogue.select(Spectrum, **about), context.catalogue.select(Signal, **about)
    if not (period_residuals and trajectories and spectra and signals):
        return
    whiteness = {w.signal: w for w in context.catalogue.select(Whiteness, **about)}
    name = parts.run_name(average)
    alt = f"{name}: the mean of {count(average.periods, 'period')}, the spectrum of its position, and its derivatives."
    panels = (one_period(average, signals[0]), spectrum(spectra[0]), *derivatives(average, trajectories[0]))
    caption = parts.explanation("noise-period", run=name, periods=average.periods)
    yield Figure(caption, alt, panels, columns=2, height=42)
    caption = parts.explanation("noise-removed", run=name)
    alt = f"{name}: the noise of each period, and its distribution and autocorrelation."
    yield Figure(caption, alt, tuple(noise_panels(period_residuals[0], average, whiteness)), columns=2, height=42)


def one_period(average: Average, signal: Signal) -> Panel:
    """The mean period and the first one.  Fig 6.6"""
    since = signal.t - average.t_start
    first = (since >= 0.0) & (since < average.period)
    marks = (
        Line(since[first], signal.tau[first], "first period", "sky"),
        Line(average.t, average.tau, "mean", "vermillion"),
    )
    return Panel("Effort", "time [s]", label(average, "tau", "effort"), marks)


def spectrum(s: Spectrum) -> Panel:
    """The spectrum of the position, and the harmonics that are kept of it.  Fig 6.8"""
    shown = slice(0, min(len(s.amplitude), max(4 * s.harmonics, 20)))
    f, a = s.frequency[shown], np.maximum(s.amplitude[shown], 1e-12)
    k = np.arange(len(a)) <= s.harmonics
    marks = (Points(f[k], a[k], "kept", "blue"), Points(f[~k], a[~k], "taken as noise", "grey"))
    return Panel("Spectrum of the position", "frequency [Hz]", label(s, "amplitude", "amplitude"), marks, y_log=True)


def derivatives(average: Average, trajectory: Trajectory) -> tuple[Panel, Panel]:
    """Velocity and acceleration from the harmonics and by differences.  Fig 6.9"""
    step = average.t[1] - average.t[0]

    def panel(meaning: str, of: str, x: Column, field: str) -> Panel:
        marks = (
            Line(average.t, np.gradient(x, step), f"difference of {of}", "sky"),
            Line(trajectory.t, getattr(trajectory, field), "harmonics", "vermillion"),
        )
        return Panel(meaning.capitalize(), "time [s]", label(trajectory, field, meaning), marks)

    return panel("velocity", "position", average.q, "dq"), panel("acceleration", "velocity", average.dq, "ddq")


def noise_panels(residual: PeriodResidual, average: Average, whiteness: dict[str, Whiteness]) -> Iterator[Panel]:
    """Noise by period, histogram, normal probability plot and autocorrelation of what averaging removed.

    Fig 6.7, 6.10, 6.11
    """
    periods = min(average.periods, MAX_BARS)
    names = tuple(str(i) for i in range(1, periods + 1))
    bars = []
    for signal, meaning in NOISE_FIELDS.items():
        rms = by_period(residual, average, getattr(residual, signal))
        bars.append(Bars(names, rms[:periods] / (np.median(rms) or 1.0), meaning))
    yield Panel("Noise by period", "period", "over the median period", tuple(bars))
    edges, densities, grid, normal = histogram(residual.tau_noise)
    shape = (Histogram(edges, densities, "", "sky"), Line(grid, normal, "normal", "vermillion"))
    yield Panel("Effort noise", label(residual, "tau_noise", "effort"), "density", shape)
    yield parts.normal_plot("Position noise", residual.q_noise, label(residual, "q_noise", "position"))
    if w := whiteness.get("dq_noise"):
        yield parts.autocorrelation(w, "Velocity noise")


def histogram(x: Column, bins: int = 40) -> tuple[Column, Column, Column, Column]:
    """Edges and densities of a histogram, and the normal density of the same mean and standard deviation."""
    densities, edges = np.histogram(x, bins=bins, density=True)
    grid = np.linspace(edges[0], edges[-1], 200)
    sigma = float(x.std()) or 1.0
    normal = np.exp(-0.5 * ((grid - x.mean()) / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi))
    return edges, densities, grid, normal
