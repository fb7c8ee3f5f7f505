"""One page a joint: its equation, its parameters, and the residual of its fit."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.estimators import title_of
from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records import Fit, Identifiability, Residual
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.records.record import slug
from davinci_forces.report.content import (
    Block,
    Cell,
    Equation,
    Figure,
    OnScreen,
    Panel,
    Prose,
    Section,
    Table,
    Tiles,
    Verdict,
    literal,
)
from davinci_forces.report.context import Context, fit_name, title
from davinci_forces.report.results import format_unit
from davinci_forces.report.sections.joints.estimators import convergence, estimators, left_out, printed_beside
from davinci_forces.report.sections.joints.friction import friction_maps
from davinci_forces.report.sections.joints.residuals import residual_blocks
from davinci_forces.report.sections.parts import run_name
from davinci_forces.report.verdicts import is_impossible


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
    """Explain the columns of the tables."""
    return Prose(
        "The parameters of each joint are fitted to the averaged periods of its identification logs. The standard "
        "error of a value has two parts: of noise, by the differences between periods, and of the model, by the change "
        "without blocks of path, or with other friction. $z$ is the value over its standard error. A parameter with "
        "$abs(z) < 2$ may be zero in a better model; one within two errors of noise of zero is called not significant."
    )


def joint_blocks(context: Context, fits: list[Fit]) -> Iterator[Block]:
    """The content about one joint."""
    first = next((f for f in fits if f"{f.model}.{f.estimator}" == context.own_fit(f.group)), fits[0])
    terms = " + ".join(f"theta_{i} {phi}" for i, phi in enumerate(first.phi, start=1))
    yield Equation(f"tau = {terms}", f"effort is the sum of {', '.join(first.parameter)}, each times its parameter")
    yield parameters(context, first)
    yield from unidentified_parameters(context, first.group)
    residuals = context.catalogue.select(Residual, joint=first.group, model=first.model, estimator=first.estimator)
    for i, residual in enumerate(residuals):
        shown = tuple(residual_blocks(context, residual))
        if i == 0:
            yield from shown
        else:
            yield OnScreen(run_name(residual.log, residual.joint), f"residual-{residual.log}-{residual.joint}", shown)
    yield from implausible(fits)
    yield from left_out(context, first.group)
    yield comparison(context, fits)


def implausible(fits: list[Fit]) -> Iterator[Verdict]:
    """Each parameter that fits make negative although it is positive in every mechanism, once for all fits."""
    values: dict[str, list[tuple[float, float, str]]] = {}
    for fit in fits:
        for name, value, std, positive in zip(fit.parameter, fit.theta, fit.theta_std, fit.positive, strict=True):
            if value < 0 and positive:
                values.setdefault(str(name), []).append((value, std, title_of(fit.estimator)))
    for name, negative in values.items():
        clear = [each for each in negative if is_impossible(*each[:2])]
        value, std, _ = min(clear or negative, key=lambda each: each[0] + NORMAL_95 * each[1])
        who = ", ".join(dict.fromkeys(estimator for *_, estimator in clear or negative))
        follows = "which is physically impossible" if clear else "which cannot be distinguished from zero"
        text = f"**{literal(name)}** is negative ({value:.2g} ± {std:.1g}), {follows}, by {who}."
        yield Verdict("warn" if clear else "info", text)


def parameters(context: Context, fit: Fit) -> Table:
    """Parameters with their standard errors and how far they are from zero.  Tables 6.4-6.6"""
    rows: list[tuple[Cell, ...]] = []
    for i, name in enumerate(fit.parameter):
        key = ".".join(("fit", *fit.key, slug(name)))
        z = fit.theta[i] / fit.theta_std[i] if fit.theta_std[i] > 0 else np.nan
        unit = format_unit(fit.unit[i]) or "–"
        values = (context.number(f"{key}{part}", 2, unit="") for part in ("", ".std_noise", ".std_model"))
        rows.append((f"$theta_{i + 1}$", name, unit, *values, f"{z:.1f}" if np.isfinite(z) else "–"))
    mse = context.number(f"{'.'.join(('fit', *fit.key))}.mse", 3)
    return Table(
        f"Parameters of the {literal(fit.group.replace('_', ' '))}. Model: {fit.model} (without coupling to other "
        f"joints), {fit_in_use(context, fit)}. Estimator: {title_of(fit.estimator)}. Data: "
        f"{literal(', '.join(fit.logs))}. Mean squared error of the averaged effort: {mse}.",
        ("Symbol", "Parameter", "Unit", "Value", "Error of noise", "Error of the model", "$z$"),
        tuple(rows),
        label=f"theta-{fit.group}",
        align="lllrrrr",
    )


def fit_in_use(context: Context, fit: Fit) -> str:
    """State whether the filter uses this fit or another."""
    used = context.used_fit(fit.group)
    if used.removeprefix(f"{CHOSEN}.") == f"{fit.model}.{fit.estimator}":
        return "used by the filter"
    return f"while the filter uses {fit_name(*used.split('.', 1))}"


def comparison(context: Context, fits: list[Fit]) -> Block:
    """Parameters of all fits side by side, and how well each describes the averaged periods."""
    names = list(dict.fromkeys(name for fit in fits for name in fit.parameter))
    rows: list[tuple[Cell, ...]] = []
    for fit in fits:
        key = ".".join(("fit", *fit.key))
        values = (context.number(f"{key}.{slug(name)}", 3) for name in names)
        scores = context.numbers(key, ("mse", "r2", "condition"))
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
    return OnScreen(f"{title(group)}: all fits, and tests of them", f"all-fits-{group}", (table, *more))


def unidentified_parameters(context: Context, joint: str) -> Iterator[Verdict]:
    """Parameters that the identification logs of a joint do not determine."""
    for record in context.catalogue.select(Identifiability, group=joint):
        if text := "; ".join(literal(text) for text in (*record.together, *record.not_seen)):
            yield Verdict("info", f"{text[:1].upper()}{text[1:]}. {record.advice}.")


def correlations(context: Context, joint: str) -> Iterator[Block]:
    """The correlation matrix of a joint's parameters, and the condition number of their regressor."""
    for record in context.catalogue.select(Identifiability, group=joint):
        names = tuple(dict.fromkeys(map(str, record.parameter)))
        number = context.number(f"identifiability.{'.'.join(record.key)}.condition", 3)
        yield Prose(
            f"The columns of the regressor, scaled to one length, have the condition number {number}. The figure shows "
            "the correlation of the errors of each two parameters. If it is near 1 or −1, only a sum or a "
            "difference of the two parameters is known well."
        )
        strongest = max((abs(r) for r, a, b in pairs(record) if a != b), default=0.0)
        numbered = tuple(f"θ{i} {name}" for i, name in enumerate(names, start=1))
        yield Figure(
            f"{title(joint)}: correlation of the errors of its parameters (least squares).",
            f"A matrix of correlations between {', '.join(names)}: the strongest is {strongest:.2f}.",
            (Panel("", "", "", (Tiles(record.correlation, numbered),)),),
            f"correlation-{joint}",
            height=12.0 + 9.0 * len(names),
        )


def pairs(record: Identifiability) -> Iterator[tuple[float, str, str]]:
    """Each correlation with its two parameters."""
    return zip(record.correlation.tolist(), map(str, record.parameter), map(str, record.beside), strict=True)
