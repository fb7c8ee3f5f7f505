"""The estimators of a joint compared with each other, with published values, and on data left out."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Average, Fit, Prediction, Residual, SwarmSearch
from davinci_forces.records.prediction import CHOSEN, CHOSEN_BY_LOG
from davinci_forces.records.record import slug
from davinci_forces.report.content import Block, Bullets, Cell, Figure, Line, OnScreen, Panel, Prose, Table, literal
from davinci_forces.report.content.marks import Colour
from davinci_forces.report.context import Context, estimator_name, fit_name, label, title
from davinci_forces.report.results import format_unit
from davinci_forces.report.sections.parts import LEFT_OUT, MEASURES
from davinci_forces.robots.robot import Printed

LOOKS: dict[str, Colour] = {
    "lse": "vermillion",
    "wlse": "blue",
    "pso": "green",
    "consistent": "purple",
    "tls": "orange",
}
MEANT_TO_DIFFER = ("consistent", "tls")  # drawn only if they differ from least squares
ALIKE = 1e-3  # difference over the effort's standard deviation, below which two efforts are drawn as one
REACHED = 1e-6  # relative excess of the squared error, below which the least error is reached
WALLS: dict[str, Colour] = {"reflecting": "green", "clipping": "vermillion"}


def estimators(context: Context, fit: Fit) -> Iterator[Figure]:
    """The efforts of several estimators over the averaged effort of a joint's first log; those alike are named."""
    all_residuals = context.catalogue.select(Residual, joint=fit.group, model=fit.model, log=fit.logs[0])
    residuals = {residual.estimator: residual for residual in all_residuals if residual.estimator in LOOKS}
    if "lse" not in residuals or len(residuals) < 2:
        return
    plain = residuals["lse"]
    apart = {name: float(abs(r.tau_hat - plain.tau_hat).max()) for name, r in residuals.items()}
    same = [name for name in MEANT_TO_DIFFER if name in apart and apart[name] < ALIKE * (plain.tau.std() or 1.0)]
    residuals = {name: r for name, r in residuals.items() if name not in same}
    others = {name: r for name, r in residuals.items() if name != "lse"}
    if not others:
        return
    effort = label(plain, "tau", "effort")
    name = f"{title(fit.group)} in {literal(plain.log)}"
    named = ", ".join(map(estimator_name, residuals))
    largest, verb = max(apart[name] for name in others), "is" if len(same) == 1 else "are"
    alike = f" {' and '.join(map(estimator_name, same))} {verb} the same as least squares." if same else ""
    models = (Line(r.t, r.tau_hat, estimator_name(e), LOOKS[e]) for e, r in residuals.items())
    differences = (Line(r.t, r.tau_hat - plain.tau_hat, estimator_name(e), LOOKS[e]) for e, r in others.items())
    yield Figure(
        f"{name}: averaged effort, the model's effort by {named}, and the difference from least squares.{alike}",
        f"{name}: the estimators' efforts differ from least squares by {largest:.2g} at most.",
        (
            Panel("Averaged effort and models", "time [s]", effort,
                  (Line(plain.t, plain.tau, "measured", "sky"), *models)),
            Panel("Difference from least squares", "time [s]", effort, tuple(differences)),
        ),
        f"estimators-{fit.group}",
        columns=2,
        height=46,
    )  # fmt: skip


def convergence(context: Context, joint: str) -> Iterator[Figure]:
    """The smallest squared error of each swarm, over iterations.  Fig 6.14"""
    searches = context.catalogue.select(SwarmSearch, group=joint)
    if not searches:
        return
    ends = " and ".join(f"with {s.walls} walls it {excess_in_words(s.excess)}" for s in searches)
    lines = tuple(
        Line(np.arange(1.0, len(s) + 1.0), s.best_mse, f"{s.walls} walls", WALLS.get(s.walls, "")) for s in searches
    )
    unit = label(searches[0], "best_mse", "mean squared error")
    yield Figure(
        f"{title(joint)}: the least mean squared error of the swarm after each iteration, of "
        f"{searches[0].searched} parameters by {searches[0].particles} particles. The least error that the known signs "
        f"allow: {ends}.",
        f"Squared error over iterations, falling until it stays: {ends}.",
        (Panel("", "iteration", unit, lines, x_log=True, y_log=True),),
        f"swarm-{joint}",
        height=42,
    )


def excess_in_words(excess: float) -> str:
    """State the error of a search over the least possible one."""
    if excess < REACHED:
        return "is reached"
    return f"is exceeded by {100 * excess:.2g} %" if excess < 1 else f"is exceeded {1 + excess:.2g} times"


DIGITS = 3  # digits of a number without standard error


def printed_beside(context: Context, fit: Fit) -> Iterator[Block]:
    """The thesis's table of a joint, next to this study's values; none in a user's study."""
    joint = context.study.robot.joint(fit.group)
    printed = joint.printed
    if not context.compares_with_thesis or printed is None or joint.effort:
        return
    if any(len(column.theta) != len(fit.parameter) for column in printed.columns):
        return
    yield Prose(
        f"{printed.name} of the thesis, next to this study's values: first guesses, recomputed from the robot's masses "
        "and lengths, and every estimator on this study's periods. The study is simulated, so its values are those of "
        "the simulation, not of the arm."
    )
    yield table(context, fit, printed)
    yield Bullets(tuple(f"Misprint: {text[:1].lower()}{text[1:]}" for text in printed.misprints))


def table(context: Context, fit: Fit, printed: Printed) -> Table:
    """Parameters and mean squared error, printed and of this study."""
    header = ["Parameter", "Unit"]
    for column in printed.columns:
        header += [f"{estimator_name(column.estimator) or 'Guess'}, printed", "here"]
    rows: list[tuple[Cell, ...]] = []
    names, units = (*map(str, fit.parameter), "mse"), (*(format_unit(unit) or "–" for unit in fit.unit), "–")
    for i, (name, unit) in enumerate(zip(names, units, strict=True)):
        pairs: list[Cell] = []
        for column in printed.columns:
            prefix = f"fit.{fit.group}.{fit.model}.{column.estimator}" if column.estimator else f"guess.{fit.group}"
            value = f"{(*column.theta, column.mse)[i]:g}".replace("-", "−")
            pairs += [value, context.number(f"{prefix}.{slug(name)}", DIGITS, unit="", std=None)]
        rows.append(("mean squared error" if name == "mse" else name, unit, *pairs))
    caption = f"{title(fit.group)}: {printed.name} as printed, and this study's values."
    return Table(caption, tuple(header), tuple(rows), f"printed-{fit.group}", "ll" + "r" * (len(header) - 2))


def left_out(context: Context, joint: str) -> Iterator[Block]:
    """Every fit of a joint by its error on logs or periods left out; the chosen one also by blocks of path left out."""
    by_fit: dict[tuple[str, str], list[Prediction]] = {}
    for p in context.catalogue.select(Prediction, joint=joint, role="identification"):
        if p.model not in (CHOSEN, CHOSEN_BY_LOG):
            by_fit.setdefault((p.model, p.estimator), []).append(p)
    if not by_fit:
        return
    rows = tuple(left_out_row(context, joint, of_fit) for of_fit in by_fit.values())
    header = ("Fit", "Left out", "Relative error", "Path blocks left out, raw samples")
    caption = f"{title(joint)}: relative error of the errors of its fits on data that were left out, in the worst log."
    table = Table(caption, header, rows, f"left-out-{joint}", "llrr")
    says = Prose(f"{MEASURES}{noise_share(context, joint)}")
    yield OnScreen(
        f"{title(joint)}: the errors of its fits on data that were left out", f"all-left-out-{joint}", (says, table)
    )


def left_out_row(context: Context, joint: str, of_fit: list[Prediction]) -> tuple[Cell, ...]:
    """One fit by its worst log; the chosen fit also by blocks of path."""
    worst = max(of_fit, key=lambda p: p.relative_error)
    chosen = context.catalogue.select(Prediction, joint=joint, role="identification", model=CHOSEN)
    by_blocks = [p for p in chosen if p.estimator == f"{worst.model}.{worst.estimator}"]
    blocks: Cell = "–"
    if by_blocks:
        blocks = context.number(f"{max(by_blocks, key=lambda p: p.relative_error).prefix}.relative_error", 3)
    name = fit_name(worst.model, worst.estimator)
    which = LEFT_OUT.get(worst.scheme, worst.scheme.removeprefix("leave ").removesuffix(" out"))
    return f"**{name}**" if by_blocks else name, which, context.number(f"{worst.prefix}.relative_error", 3), blocks


def noise_share(context: Context, joint: str) -> str:
    """State the noise in either error, if the periods determine it."""
    logs = [average.log for average in context.catalogue.select(Average, joint=joint)]
    if not logs:
        return ""
    worst = max(logs, key=lambda log: context.results[f"noise.{log}.{joint}.relative_noise"].value)
    least = context.number(f"noise.{worst}.{joint}.relative_noise", 2)
    return (
        f" Noise alone makes {least} of either error. It neither repeats nor is as slow as motion, so no model can "
        "remove it."
    )
