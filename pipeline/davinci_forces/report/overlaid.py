"""The estimators of a joint over each other, and how a swarm came to its parameters.  Fig 6.14, 6.15, 6.18, 6.20"""

from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Fit, Residual, SwarmSearch
from davinci_forces.report.content import Figure, Line, Panel, literal
from davinci_forces.report.content.marks import Colour
from davinci_forces.report.context import Context, estimator_name, label, title

LOOKS: dict[str, Colour] = {
    "lse": "vermillion",
    "wlse": "blue",
    "pso": "green",
    "consistent": "purple",
    "tls": "orange",
}
MEANT_TO_DIFFER = ("consistent", "tls")  # where least squares cannot be: drawn only where they do
ALIKE = 1e-3  # of the effort's deviation, below which two efforts are drawn as one
REACHED = 1e-6  # of the squared error: what is less is none
WALLS: dict[str, Colour] = {"reflecting": "green", "clipping": "vermillion"}


def estimators(context: Context, fit: Fit) -> Iterator[Figure]:
    """The efforts of several estimators over the averaged effort of a joint's first log; those alike are named."""
    every = context.catalogue.about(Residual, joint=fit.group, model=fit.model, log=fit.logs[0])
    own = {residual.estimator: residual for residual in every if residual.estimator in LOOKS}
    if "lse" not in own or len(own) < 2:
        return
    plain = own["lse"]
    same = [name for name in MEANT_TO_DIFFER if name in own and apart(own[name], plain) < ALIKE]
    own = {name: r for name, r in own.items() if name not in same}
    others = {name: r for name, r in own.items() if name != "lse"}
    if not others:
        return
    effort = label(plain, "tau", "effort")
    name = f"{title(fit.group)} in {literal(plain.log)}"
    named = ", ".join(map(estimator_name, own))
    largest = max(float(abs(r.tau_hat - plain.tau_hat).max()) for r in others.values())
    yield Figure(
        f"{name}: averaged effort with the model's by {named}, and how far the others are from least squares."
        f"{alike(same)}",
        f"{name}: the estimators' efforts differ from least squares by {largest:.2g} at most.",
        (
            Panel(
                "Averaged effort and models", "time [s]", effort,
                (
                    Line(plain.t, plain.tau, "measured", "sky"),
                    *(Line(r.t, r.tau_hat, estimator_name(e), LOOKS[e]) for e, r in own.items()),
                ),
            ),
            Panel(
                "Less that of least squares", "time [s]", effort,
                tuple(Line(r.t, r.tau_hat - plain.tau_hat, estimator_name(e), LOOKS[e]) for e, r in others.items()),
            ),
        ),
        f"estimators-{fit.group}",
        columns=2,
        height=46,
    )  # fmt: skip


def apart(one: Residual, other: Residual) -> float:
    """The largest difference of two models' efforts, in deviations of the effort."""
    return float(abs(one.tau_hat - other.tau_hat).max() / (other.tau.std() or 1.0))


def alike(names: list[str]) -> str:
    """Which estimators are not drawn, as they say the same as least squares."""
    verb = "is" if len(names) == 1 else "are"
    return f" {' and '.join(map(estimator_name, names))} {verb} least squares' own." if names else ""


def convergence(context: Context, joint: str) -> Iterator[Figure]:
    """The least squared error that swarms knew, over iterations.  Fig 6.14"""
    searches = context.catalogue.about(SwarmSearch, group=joint)
    if not searches:
        return
    ends = " and ".join(f"with {s.walls} walls it {reached(s.excess)}" for s in searches)
    lines = tuple(
        Line(np.arange(1.0, len(s) + 1.0), s.best_mse, f"{s.walls} walls", WALLS.get(s.walls, "")) for s in searches
    )
    unit = label(searches[0], "best_mse", "mean squared error")
    yield Figure(
        f"{title(joint)}: the least mean squared error that the swarm knew after each iteration, of "
        f"{searches[0].searched} parameters by {searches[0].particles} particles. The least that the known signs "
        f"allow: {ends}.",
        f"Squared error over iterations, falling until it stays: {ends}.",
        (Panel("", "iteration", unit, lines, x_log=True, y_log=True),),
        f"swarm-{joint}",
        height=42,
    )


def reached(excess: float) -> str:
    """How near a search came to the least squared error that there is."""
    if excess < REACHED:
        return "is reached"
    return f"is exceeded by {100 * excess:.2g} %" if excess < 1 else f"is exceeded {1 + excess:.2g} times"
