"""The residual of a fit: over time, against the motion, and its autocorrelation."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Column, Counts, Residual, Trajectory, Whiteness
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.report.content import Block, Figure, Panel, Prose
from davinci_forces.report.content.marks import HBand, Line, Points
from davinci_forces.report.context import Context, fit_name, label
from davinci_forces.report.sections.parts import autocorrelation, effort_panel, explanation, normal_plot, run_name
from davinci_forces.report.verdicts import percent

LAGS = 50  # lags of the cross-correlation on either side
MIN_SHARE_FOLLOWED = 0.1  # smallest share of a residual's variance by which the residual is said to follow a motion
MIN_RATIO_REVERSALS = 2.0  # smallest remarked ratio of the residual around reversals to that elsewhere
ADVICE = {
    "position": "Worth trying: a spring, gravity or friction that varies with position, or coupling to other joints.",
    "velocity": "Worth trying: friction with another shape, or coupling to other joints.",
    "reversals": "Worth trying: presliding friction (a dahl element).",
}
ALL_TRIED = "No other term that the search for the model tried lowers the error of what it leaves out clearly."


def residual_blocks(context: Context, residual: Residual) -> Iterator[Block]:
    """The residual of a fit in one log: over time, against the motion, and its autocorrelation."""
    name, place = run_name(residual), f"{residual.log}-{residual.joint}"
    errors, effort = residual.tau - residual.tau_hat, label(residual, "tau", "effort")
    who = fit_name(residual.model, residual.estimator)
    moved = context.catalogue.select(Trajectory, log=residual.log, joint=residual.joint)
    averaged = bool(moved) and len(moved[0].q) == len(errors)
    kind = "averaged" if averaged else "low-passed"
    caption = f"{name}: {kind} effort and model ({who}), the residual of the model, and its normal probability plot."
    alt = f"{name}: the model follows the {kind} effort up to {errors.std():.2g} (root mean square)."
    panels = (
        effort_panel(residual, heading=f"{kind.capitalize()} effort and model"),
        Panel("Residual", "time [s]", effort, (Line(residual.t, errors, "", "blue"),)),
        normal_plot("Residual", errors, label(residual, "tau", "residual")),
    )
    yield Figure(caption, alt, panels, f"fit-figure-{place}", columns=3, height=34)
    q = moved[0].q if averaged else None
    against = [motion_panel(residual, errors, residual.dq, label(residual, "dq", "velocity"), by_direction=True)]
    if q is not None:
        against.insert(0, motion_panel(residual, errors, q, label(moved[0], "q", "position")))
    alt = f"{name}: {in_words(residual, errors, q)}"
    drawn = (*against, *own_correlations(context, residual, errors, q))
    yield Figure(explanation("joints-residual", run=name), alt, drawn, f"residual-figure-{place}", columns=2, height=34)
    yield Prose(in_words(residual, errors, q))


def motion_panel(residual: Residual, errors: Column, x: Column, x_label: str, by_direction: bool = False) -> Panel:
    """Means of the residual in bins of position or velocity, flat at zero if no term is missing."""
    middle, mean, std = binned_means(x, errors)
    heading = f"Against {x_label.partition(' [')[0]}{' and direction' if by_direction else ''}"
    marks: list[Points | Line] = [Points(middle, mean, "", "blue", y_std=std)]
    for i, side in enumerate((x < 0, x > 0) if by_direction else ()):
        if side.any():
            ends, level = np.array([0.0, x[side][np.abs(x[side]).argmax()]]), np.full(2, errors[side].mean())
            marks.append(Line(ends, level, "" if i else "mean", "vermillion", "solid"))
    return Panel(heading, x_label, label(residual, "tau", "residual"), tuple(marks))


def own_correlations(context: Context, residual: Residual, errors: Column, q: Column | None) -> Iterator[Panel]:
    """The residual's correlation with itself and with the motion."""
    signal = f"tau.{residual.model}.{residual.estimator}"
    band = 0.0
    for w in context.catalogue.select(Whiteness, log=residual.log, joint=residual.joint, signal=signal):
        yield autocorrelation(w, "Autocorrelation")
        band = w.band
    lags = np.arange(-min(LAGS, len(errors) // 4), min(LAGS, len(errors) // 4) + 1)
    shown = lags.astype(np.float64)
    position = () if q is None else (Line(shown, correlation(errors, q, lags), "position", "green", "dashed"),)
    lines = (
        Line(shown, correlation(errors, residual.dq, lags), "velocity", "blue"),
        Line(shown, correlation(errors, np.sign(residual.dq), lags), "direction", "vermillion"),
        *position,
    )
    reach = max(4.0 * band, 0.1, *(1.1 * float(abs(line.y).max()) for line in lines))
    marks = (HBand(-band, band, ""), *lines)
    yield Panel("Cross-correlation", "lag [samples]", "correlation", marks, y_range=(-reach, reach))


def in_words(residual: Residual, errors: Column, q: Column | None) -> str:
    """State whether the residual follows position or velocity, and which terms to try if none was searched for.

    Least squares leave no straight line in a variable that is a column of the model, so means in bins are used.
    """
    is_plain = residual.model != CHOSEN
    motions = {"velocity": residual.dq} | ({} if q is None else {"position": q})
    shares = {name: explained_by(x, errors) for name, x in motions.items()}
    shares_in_words = " and ".join(f"{percent(max(share, 0.0))} against {name}" for name, share in shares.items())
    follows = max(shares, key=lambda name: shares[name])
    text = f"Share of the residual's variance that the means in bins explain: {shares_in_words}"
    if shares[follows] > MIN_SHARE_FOLLOWED:
        return f"{text}. So the residual follows the {follows}. {ADVICE[follows] if is_plain else ALL_TRIED}"
    slow = np.abs(residual.dq) < 0.1 * float(np.sqrt(np.mean(residual.dq**2)) or 1.0)
    near, far = (float(np.sqrt(np.mean(errors[which] ** 2))) if which.any() else 0.0 for which in (slow, ~slow))
    if far and near / far > MIN_RATIO_REVERSALS:
        larger = f"Around reversals of velocity the residual's RMS is {near / far:.1f} times its RMS elsewhere"
        return f"{text}. {larger}. {ADVICE['reversals'] if is_plain else ALL_TRIED}"
    return f"{text}. Neither is enough to show a missing term."


def binned_means(x: Column, y: Column, bins: int = 40) -> tuple[Column, Column, Column]:
    """Middles of the equal bins of x with samples, the mean of y in each bin, and its standard error."""
    number, middles, mean = full_bins(x, y, bins)
    return middles, mean, np.sqrt(np.bincount(number, (y - mean[number]) ** 2)) / np.bincount(number)


def full_bins(x: Column, y: Column, bins: int) -> tuple[Counts, Column, Column]:
    """Equal bins of x with samples: the number of each sample's bin, the middles, and the mean of y in each bin.

    `binned_statistic` does likewise, but importing it takes most of a second.
    """
    edges = np.linspace(x.min(), x.max(), bins + 1)
    full, number = np.unique(np.clip(np.searchsorted(edges, x, "right") - 1, 0, bins - 1), return_inverse=True)
    return number, (edges[full] + edges[full + 1]) / 2, np.bincount(number, y) / np.bincount(number)


def correlation(x: Column, y: Column, lags: Counts) -> Column:
    """The correlation of x(k) with y(k + lag) of periodic signals of one length, at every lag."""
    x, y = x - x.mean(), y - y.mean()
    scale = float(np.linalg.norm(x) * np.linalg.norm(y)) or 1.0
    return np.array([x @ np.roll(y, -int(lag)) for lag in lags]) / scale


def explained_by(x: Column, y: Column, bins: int = 40) -> float:
    """The share of the variance of y that its means in bins of x explain, less the share due to chance.

    The correlation ratio with Wherry's correction, 0 if y does not depend on x in any way.
    """
    number, _, means = full_bins(x, y, bins)
    unexplained, spread = float(np.sum((y - means[number]) ** 2)), float(y.var() * len(y))
    if not spread or len(y) <= len(means):
        return 0.0
    return 1.0 - unexplained / spread * (len(y) - 1) / (len(y) - len(means))
