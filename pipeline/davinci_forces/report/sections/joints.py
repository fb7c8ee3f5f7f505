"""A page a joint: its equation, its parameters, and what the fit leaves unexplained."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from davinci_forces.records import Column, Fit, Residual, Trajectory, Whiteness
from davinci_forces.records.predict import CHOSEN
from davinci_forces.records.record import slug
from davinci_forces.report.content import (
    Block,
    Cell,
    Equation,
    Figure,
    Line,
    OnScreen,
    Panel,
    Points,
    Prose,
    Section,
    Stems,
    Table,
    Verdict,
    literal,
)
from davinci_forces.report.context import Context, fit_name, label, title
from davinci_forces.report.friction import friction_maps
from davinci_forces.report.identified import correlations, wanting
from davinci_forces.report.left_out import left_out
from davinci_forces.report.overlaid import convergence, estimators
from davinci_forces.report.plots import autocorrelation, binned_means, correlation, explained_by
from davinci_forces.report.printed import printed_beside
from davinci_forces.report.results import format_unit
from davinci_forces.report.verdicts import percent

NAMES = {
    "lse": "least squares",
    "wlse": "weighted least squares",
    "pso": "particle swarm",
    "bounded": "bounded least squares",
    "prior": "least squares with a prior",
    "huber": "robust least squares",
    "iv": "instrumental variables",
    "tls": "total least squares",
    "consistent": "physically consistent least squares",
}
LAGS = 50  # of the cross-correlation, each way
SEEN = 0.1  # share of a residual's variance that a motion explains, from which on the residual follows it
REVERSALS = 2.0  # times as large around reversals as elsewhere, from which on that is said


def section(context: Context) -> Section | None:
    """One subsection per joint."""
    fits = context.own_fits()
    if not fits:
        return None
    joints = dict.fromkeys(fit.group for fit in fits)
    parts = (
        Section(title(joint), f"fit-{joint}", tuple(joint_blocks(context, [f for f in fits if f.group == joint])))
        for joint in joints
    )
    return Section("Joints", "joints", (intro(), *parts))


def intro() -> Prose:
    """How to read the tables."""
    return Prose(
        "The parameters of each joint come from the averaged periods of all its identification logs together. The "
        "standard error after each value allows for residuals that are correlated; the classical one "
        "takes them as independent. Where the two differ much, the model misses something that repeats in every "
        "period. $z$ is the value over its standard error: a parameter with $abs(z) < 2$ cannot be told from zero."
    )


def joint_blocks(context: Context, fits: list[Fit]) -> Iterator[Block]:
    """The content about one joint."""
    first = next((f for f in fits if f"{f.model}.{f.estimator}" == context.own_fit(f.group)), fits[0])
    terms = " + ".join(f"theta_{i} {phi}" for i, phi in enumerate(first.phi, start=1))
    yield Equation(f"tau = {terms}", f"effort is the sum of {', '.join(first.parameter)}, each times its parameter")
    yield parameters(context, first)
    yield from wanting(context, first.group)
    residuals = context.catalogue.about(Residual, joint=first.group, model=first.model, estimator=first.estimator)
    for i, residual in enumerate(residuals):
        shown = tuple(residual_blocks(context, residual))
        if i == 0:
            yield from shown
        else:
            yield OnScreen(
                f"{title(residual.joint)} in {literal(residual.log)}",
                f"residual-{residual.log}-{residual.joint}",
                shown,
            )
    yield from implausible(fits)
    yield from left_out(context, first.group)
    yield compared(context, fits)


def implausible(fits: list[Fit]) -> Iterator[Verdict]:
    """Parameters that no mechanism has."""
    for fit in fits:
        negative = [
            f"{name} ({value:.2g} ± {std:.1g})"
            for name, value, std in zip(fit.parameter, fit.theta, fit.theta_std, strict=True)
            if value < 0 and physical(name)
        ]
        if negative:
            who = f"{NAMES.get(fit.estimator, fit.estimator)} ({fit.model})"
            yield Verdict("warn", f"{who} finds a negative {', '.join(negative)}, which no mechanism has.")


def physical(name: str) -> bool:
    """Whether a parameter cannot be negative."""
    return name in ("inertia", "lifted mass", "viscous friction", "Coulomb friction")


def parameters(context: Context, fit: Fit) -> Table:
    """Parameters with their standard errors and how far they are from zero.  Tables 6.4-6.6"""
    rows: list[tuple[Cell, ...]] = []
    for i, name in enumerate(fit.parameter):
        key = ".".join(("fit", *fit.key, slug(name)))
        z = fit.theta[i] / fit.theta_std[i] if fit.theta_std[i] > 0 else np.nan
        unit = format_unit(fit.unit[i]) or "–"
        values = (unitless(context, name) for name in (key, f"{key}.std_classical"))
        rows.append((f"$theta_{i + 1}$", name, unit, *values, f"{z:.1f}" if np.isfinite(z) else "–"))
    mse = context.number(f"{'.'.join(('fit', *fit.key))}.mse", 3)
    return Table(
        f"Parameters of the {literal(fit.group.replace('_', ' '))} ({fit.model}, "
        f"{NAMES.get(fit.estimator, fit.estimator)}), {standing(context, fit)}, from {literal(', '.join(fit.logs))}; "
        f"mean squared error {mse} of the averaged effort.",
        ("Symbol", "Parameter", "Unit", "Value", "Classical standard error", "$z$"),
        tuple(rows),
        label=f"theta-{fit.group}",
        align="lllrrr",
    )


def standing(context: Context, fit: Fit) -> str:
    """Whether the filter runs with a fit, or with what."""
    used = context.used_fit(fit.group)
    if used.removeprefix(f"{CHOSEN}.") == f"{fit.model}.{fit.estimator}":
        return "which the filter runs with"
    return f"beside which the filter runs with {fit_name(*used.split('.', 1))}"


def unitless(context: Context, key: str) -> Cell:
    """A number whose unit stands in a column of its own."""
    number = context.number(key, 2)
    return number if isinstance(number, str) else replace(number, unit="")


def compared(context: Context, fits: list[Fit]) -> Block:
    """Parameters of all fits side by side, and how well each describes the averaged periods."""
    names = list(dict.fromkeys(name for fit in fits for name in fit.parameter))
    rows: list[tuple[Cell, ...]] = []
    for fit in fits:
        key = ".".join(("fit", *fit.key))
        values = (context.number(f"{key}.{slug(name)}", 3) for name in names)
        scores = (context.number(f"{key}.{name}", 3) for name in ("mse", "r2", "condition"))
        rows.append((fit_name(fit.model, fit.estimator), *scores, *values))
    group = fits[0].group
    caption = (
        f"Every fit of the {literal(group.replace('_', ' '))}: mean squared error of the averaged effort, share of its "
        "variance explained, condition number of the regressor, and the parameters."
    )
    header = ("Fit", "MSE", "$R^2$", "Condition", *(name[:1].upper() + name[1:] for name in names))
    table = Table(caption, header, tuple(rows), f"fits-{group}", "l" + "r" * (len(header) - 1))
    first = next((fit for fit in fits if fit.estimator == "lse"), fits[0])
    more = (
        *estimators(context, first),
        *printed_beside(context, first),
        *convergence(context, group),
        *correlations(context, group),
        *friction_maps(context, group),
    )
    return OnScreen(f"{title(group)}: all fits, and what they rest on", f"all-fits-{group}", (table, *more))


def residual_blocks(context: Context, residual: Residual) -> Iterator[Block]:
    """What a fit leaves of one log: over time, against the motion, and against itself."""
    name = f"{title(residual.joint)} in {literal(residual.log)}"
    errors, effort = residual.tau - residual.tau_hat, label(residual, "tau", "effort")
    who = fit_name(residual.model, residual.estimator)
    yield Figure(
        f"{name}: averaged effort and model ({who}), and what the model leaves of it.",
        f"{name}: the model follows the averaged effort up to {errors.std():.2g} (root mean square).",
        (
            Panel(
                "Averaged effort and model", "time [s]", effort,
                (
                    Line(residual.t, residual.tau, "measured", "sky"),
                    Line(residual.t, residual.tau_hat, "model", "vermillion", "dashed"),
                ),
            ),
            Panel("Residual", "time [s]", effort, (Line(residual.t, errors, "", "blue"),)),
        ),
        f"fit-figure-{residual.log}-{residual.joint}",
        columns=2,
        height=42,
    )  # fmt: skip
    moved = context.catalogue.about(Trajectory, log=residual.log, joint=residual.joint)
    q = moved[0].q if moved and len(moved[0].q) == len(errors) else None
    against = [motion_panel(residual, errors, residual.dq, label(residual, "dq", "velocity"), by_direction=True)]
    if q is not None:
        against.insert(0, motion_panel(residual, errors, q, label(moved[0], "q", "position")))
    tests = [*against, *own_correlations(context, residual, errors, q)]
    yield Figure(
        f"{name}: the residual against position and velocity (points: means of 1/40 of the range, bars: their "
        "standard errors) and direction (its mean), its autocorrelation, and its cross-correlation with the motion.",
        f"{name}: {in_words(residual, errors, q)}",
        tuple(tests),
        f"residual-figure-{residual.log}-{residual.joint}",
        columns=2,
        height=38,
    )
    yield Prose(in_words(residual, errors, q))


def motion_panel(residual: Residual, errors: Column, x: Column, x_label: str, by_direction: bool = False) -> Panel:
    """Means of the residual over ranges of one motion, flat at zero where no term is missing."""
    middle, mean, std = binned_means(x, errors)
    heading = f"Against {x_label.partition(' [')[0]}{' and direction' if by_direction else ''}"
    points = Points(middle, mean, "", "blue", y_std=std)
    lines = direction_means(x, errors) if by_direction else ()
    return Panel(heading, x_label, label(residual, "tau", "residual"), (points, *lines))


def direction_means(dq: Column, errors: Column) -> Iterator[Line]:
    """The residual's mean in each direction of motion: against sign(dq)."""
    for i, side in enumerate((dq < 0, dq > 0)):
        if side.any():
            ends, mean = np.array([0.0, dq[side][np.abs(dq[side]).argmax()]]), float(errors[side].mean())
            yield Line(ends, np.full(2, mean), "" if i else "mean", "vermillion", "solid")


def own_correlations(context: Context, residual: Residual, errors: Column, q: Column | None) -> Iterator[Panel]:
    """The residual's correlation with itself and with the motion."""
    signal = f"tau.{residual.model}.{residual.estimator}"
    for w in context.catalogue.about(Whiteness, log=residual.log, joint=residual.joint, signal=signal):
        yield autocorrelation(w, "Autocorrelation")
    lags = np.arange(-min(LAGS, len(errors) // 4), min(LAGS, len(errors) // 4) + 1)
    shown = lags.astype(np.float64)
    position = () if q is None else (Line(shown, correlation(errors, q, lags), "with position", "green", "dashed"),)
    marks = (
        Stems(shown, correlation(errors, residual.dq, lags), "with velocity", "sky"),
        Line(shown, correlation(errors, np.sign(residual.dq), lags), "with direction", "vermillion"),
        *position,
    )
    yield Panel("Cross-correlation", "lag [samples]", "correlation", marks, y_range=(-1.0, 1.0))


def in_words(residual: Residual, errors: Column, q: Column | None) -> str:
    """What the residual follows, and what to try.

    Least squares leave no straight line in any motion that is a column of the model, so means over ranges are asked.
    """
    motions = {"velocity": residual.dq} | ({} if q is None else {"position": q})
    shares = {name: explained_by(x, errors) for name, x in motions.items()}
    said = " and ".join(f"{percent(max(share, 0.0))} by {name}" for name, share in shares.items())
    follows = max(shares, key=lambda name: shares[name])
    text = f"Of the residual's variance, its means over ranges explain {said}"
    if shares[follows] > SEEN:
        tries = {
            "position": "a spring, gravity or friction that varies with position, or the coupling to other joints",
            "velocity": "friction with another shape, or coupling to other joints",
        }
        return f"{text}: it follows the {follows}. Worth trying: {tries[follows]}."
    within = share_within_reversals(errors, residual.dq)
    if within > REVERSALS:
        return f"{text}, but around reversals it is {within:.1f} times as large as elsewhere. Worth trying: presliding."
    return f"{text}: no term of one motion is missing that these plots could show."


def share_within_reversals(errors: Column, dq: Column) -> float:
    """Root mean square of the residual while slow, over that while fast; slow is a tenth of the rms velocity."""
    slow = np.abs(dq) < 0.1 * float(np.sqrt(np.mean(dq**2)) or 1.0)
    if not slow.any() or slow.all():
        return 1.0
    near, far = (float(np.sqrt(np.mean(errors[which] ** 2))) for which in (slow, ~slow))
    return near / far if far else 1.0
