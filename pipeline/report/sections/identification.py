"""The parameters of every joint, and what the fits leave unexplained."""

from collections.abc import Iterator
from dataclasses import replace

from pipeline.records import Fit, Residual, Whiteness
from pipeline.records.record import slug
from pipeline.report.content import (
    Block,
    Equation,
    Figure,
    Histogram,
    Line,
    Panel,
    Points,
    Prose,
    Reference,
    Section,
    Table,
    Verdict,
    literal,
)
from pipeline.report.context import Context, label, title
from pipeline.report.plots import autocorrelation, histogram, normal_scores
from pipeline.report.results import format_unit

NAMES = {"lse": "least squares", "wlse": "weighted least squares"}


def section(context: Context) -> Section | None:
    """One subsection per joint."""
    fits = context.catalogue.all(Fit)
    if not fits:
        return None
    joints = dict.fromkeys(fit.group for fit in fits)
    parts = (
        Section(title(joint), f"fit-{joint}", tuple(joint_blocks(context, [f for f in fits if f.group == joint])))
        for joint in joints
    )
    return Section("Identification", "identification", (intro(), *parts))


def intro() -> Prose:
    """How to read the tables."""
    return Prose(
        "The parameters of each joint come from the averaged periods of all its identification logs together. Two "
        "standard errors are given: the one after each value allows for residuals that are correlated (Newey and "
        "West), the classical one takes them as independent. Where the two differ much, the model misses something "
        "that repeats in every period, usually friction."
    )


def joint_blocks(context: Context, fits: list[Fit]) -> Iterator[Block]:
    """The content about one joint."""
    first = fits[0]
    terms = " + ".join(f"theta_{i} {phi}" for i, phi in enumerate(first.phi, start=1))
    yield Equation(f"tau = {terms}", f"effort is the sum of {', '.join(first.parameter)}, each times its parameter")
    yield parameters(context, fits)
    yield quality(context, fits)
    for fit in fits:
        negative = [name for name, value in zip(fit.parameter, fit.theta, strict=True) if value < 0 and physical(name)]
        if negative:
            yield Verdict(
                "warn",
                f"{NAMES.get(fit.estimator, fit.estimator)} finds a negative {', '.join(negative)}, which no "
                "mechanism has: compare it with its standard error.",
            )
    for residual in context.catalogue.about(Residual, joint=first.group, estimator=first.estimator):
        yield from figures(context, residual)


def physical(name: str) -> bool:
    """Whether a parameter cannot be negative."""
    return name in ("inertia", "lifted mass", "viscous friction", "Coulomb friction")


def parameters(context: Context, fits: list[Fit]) -> Table:
    """Parameters with their standard errors, estimators side by side.  Tables 6.4-6.6"""
    header = ["", "Parameter", "Unit"]
    for fit in fits:
        header += [fit.estimator.upper(), "classical standard error"]
    rows = []
    for i, name in enumerate(fits[0].parameter):
        cells: list[object] = [f"$theta_{i + 1}$", name, format_unit(fits[0].unit[i])]
        for fit in fits:
            key = ".".join(("fit", *fit.key, slug(name)))
            cells += [unitless(context, key), unitless(context, f"{key}.std_classical")]
        rows.append(tuple(cells))
    return Table(
        f"Parameters of the {literal(fits[0].group.replace('_', ' '))}, from {literal(', '.join(fits[0].logs))}.",
        tuple(header),
        tuple(rows),  # type: ignore[arg-type]
        label=f"theta-{fits[0].group}",
    )


def unitless(context: Context, key: str) -> object:
    """A number whose unit stands in a column of its own."""
    number = context.number(key, 2)
    return number if isinstance(number, str) else replace(number, unit="")


def quality(context: Context, fits: list[Fit]) -> Table:
    """How well each fit describes the averaged periods."""
    rows = []
    for fit in fits:
        key = ".".join(("fit", *fit.key))
        numbers = (context.number(f"{key}.{name}") for name in ("mse", "r2", "condition"))
        counts = (context.count(f"{key}.{name}") for name in ("samples", "periods", "hac_lags"))
        rows.append((NAMES.get(fit.estimator, fit.estimator), *numbers, *counts))
    return Table(
        "Mean squared error of the averaged effort, share of its variance explained, condition number of the "
        "regressor, and the lags of correlation that the standard errors allow for.",
        ("Estimator", "MSE", "$R^2$", "Condition", "Samples", "Periods", "Lags"),
        tuple(rows),
        align="lrrrrrr",
    )


def figures(context: Context, residual: Residual) -> Iterator[Figure]:
    """Measured and predicted effort, and what is left."""
    name = f"{title(residual.joint)} in {literal(residual.log)}"
    errors = residual.tau - residual.tau_hat
    effort = label(residual, "tau", "effort")
    yield Figure(
        f"{name}: averaged effort, the {residual.estimator.upper()} model, and what the model leaves.",
        f"Two panels for {name}: measured and predicted effort, and the residual.",
        (
            Panel(
                "Averaged effort and model", "time [s]", effort,
                (
                    Line(residual.t, residual.tau, "measured", "sky"),
                    Line(residual.t, residual.tau_hat, "model", "vermillion"),
                ),
            ),
            Panel("Residual", "time [s]", effort, (Line(residual.t, errors, "", "blue"),)),
        ),
        columns=2,
        height=50,
    )  # fmt: skip
    yield from distribution(context, residual, name)


def distribution(context: Context, residual: Residual, name: str) -> Iterator[Figure]:
    """Histogram, normal probability plot and autocorrelation of a residual."""
    errors, effort = residual.tau - residual.tau_hat, label(residual, "tau", "residual")
    edges, densities, grid, normal = histogram(errors)
    scores, ordered, slope, middle = normal_scores(errors)
    panels = [
        Panel(
            "Histogram", effort, "density",
            (Histogram(edges, densities, "", "sky"), Line(grid, normal, "normal", "vermillion")),
        ),
        Panel(
            "Normal probability plot", "normal quantile", effort,
            (Points(scores, ordered, "", "blue"), Reference(slope, middle, "normal", "vermillion")),
        ),
    ]  # fmt: skip
    signal = f"tau.{residual.model}.{residual.estimator}"
    about = context.catalogue.about(Whiteness, log=residual.log, joint=residual.joint, signal=signal)
    panels += [autocorrelation(w, "Autocorrelation") for w in about]
    yield Figure(
        f"{name}: distribution and autocorrelation of the residual. A model that misses nothing leaves "
        "normal, white noise.",
        f"Panels for {name}: histogram, normal probability plot and autocorrelation of the residual.",
        tuple(panels),
        columns=3,
        height=45,
    )
