"""The estimators of a joint compared with each other, and how well they tell its parameters apart."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Fit, Identifiability, Residual, SwarmSearch
from davinci_forces.report.content import Block, Figure, Panel, Prose, literal
from davinci_forces.report.content.marks import Colour, Line, Tiles
from davinci_forces.report.context import Context, estimator_name, label, title

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
    same = [name for name in MEANT_TO_DIFFER if name in apart and apart[name] < ALIKE * plain.tau.std()]
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
        pairs = zip(record.correlation.tolist(), record.parameter, record.beside, strict=True)
        strongest = max((abs(r) for r, a, b in pairs if a != b), default=0.0)
        numbered = tuple(f"θ{i} {name}" for i, name in enumerate(names, start=1))
        yield Figure(
            f"{title(joint)}: correlation of the errors of its parameters (least squares).",
            f"A matrix of correlations between {', '.join(names)}: the strongest is {strongest:.2f}.",
            (Panel("", "", "", (Tiles(record.correlation, numbered),)),),
            f"correlation-{joint}",
            height=12.0 + 9.0 * len(names),
        )
