"""What describes the fits of a joint on screen: estimators, correlations, the swarm's search, and friction maps."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Fit, FrictionMap, Identifiability, Residual, SwarmSearch
from davinci_forces.report.content import Block, Figure, Panel, Prose, in_format
from davinci_forces.report.content.marks import Colour, Line, Points, Tiles
from davinci_forces.report.context import Context, estimator_name, label, name_in_sentence, title
from davinci_forces.report.sections.parts import explanation, run_name

LOOKS: dict[str, Colour] = {
    "lse": "vermillion", "wlse": "blue", "pso": "green", "consistent": "purple", "tls": "orange",
}  # fmt: skip
MEANT_TO_DIFFER = ("consistent", "tls")  # drawn only if they differ from least squares
ALIKE = 1e-3  # difference over the effort's standard deviation, below which two efforts are drawn as one
REACHED = 1e-6  # relative excess of the squared error, below which the least error is reached
WALLS: dict[str, Colour] = {"reflecting": "green", "clipping": "vermillion"}
MAX_PANELS = 6  # friction maps in a figure
BRANCHES: tuple[tuple[int, str, Colour], ...] = ((1, "gaining speed", "blue"), (0, "losing speed", "vermillion"))


def estimators(context: Context, fit: Fit) -> Iterator[Figure]:
    """The efforts of several estimators over the averaged effort of a joint's first log; those alike are named."""
    records = context.catalogue.select(Residual, joint=fit.group, model=fit.model, log=fit.logs[0])
    residuals = {residual.estimator: residual for residual in records if residual.estimator in LOOKS}
    plain = residuals.get("lse")
    if plain is None:
        return
    apart = {name: float(abs(r.tau_hat - plain.tau_hat).max()) for name, r in residuals.items()}
    same = [name for name in MEANT_TO_DIFFER if name in apart and apart[name] < ALIKE * plain.tau.std()]
    residuals = {name: r for name, r in residuals.items() if name not in same}
    others = {name: r for name, r in residuals.items() if name != "lse"}
    if not others:
        return
    effort = label(plain, "tau", "effort")
    name, named = run_name(plain), ", ".join(map(estimator_name, residuals))
    largest, verb = max(apart[name] for name in others), "is" if len(same) == 1 else "are"
    alike = f" {' and '.join(map(estimator_name, same))} {verb} the same as least squares." if same else ""
    models = (Line(r.t, r.tau_hat, estimator_name(e), LOOKS[e]) for e, r in residuals.items())
    differences = (Line(r.t, r.tau_hat - plain.tau_hat, estimator_name(e), LOOKS[e]) for e, r in others.items())
    caption = f"{name}: averaged effort, the model's effort by {named}, and the difference from least squares.{alike}"
    alt = f"{name}: the estimators' efforts differ from least squares by {largest:.2g} at most."
    panels = (
        Panel("Averaged effort and models", "time [s]", effort, (Line(plain.t, plain.tau, "measured", "sky"), *models)),
        Panel("Difference from least squares", "time [s]", effort, tuple(differences)),
    )
    yield Figure(caption, alt, panels, f"estimators-{fit.group}", columns=2, height=46)


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
    caption = explanation("joints-swarm", joint=title(joint), search=searches[0], ends=ends)
    alt = f"Squared error over iterations, falling until it stays: {ends}."
    panels = (Panel("", "iteration", unit, lines, x_log=True, y_log=True),)
    yield Figure(caption, alt, panels, f"swarm-{joint}", height=42)


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
        yield Prose(explanation("joints-correlation", condition=number))
        pairs = zip(record.correlation.tolist(), record.parameter, record.beside, strict=True)
        strongest = max((abs(r) for r, a, b in pairs if a != b), default=0.0)
        numbered = tuple(f"θ{i} {name}" for i, name in enumerate(names, start=1))
        caption = f"{title(joint)}: correlation of the errors of its parameters (least squares)."
        alt = f"A matrix of correlations between {', '.join(names)}: the strongest is {strongest:.2f}."
        panels = (Panel("", "", "", (Tiles(record.correlation, numbered),)),)
        yield Figure(caption, alt, panels, f"correlation-{joint}", height=12.0 + 9.0 * len(names))


def friction_maps(context: Context, joint: str) -> Iterator[Figure]:
    """The effort minus a fit's other terms, over velocity, one panel a log and model."""
    maps = [m for m in context.catalogue.select(FrictionMap, joint=joint) if len(m)]
    if not maps:
        return
    shown = sorted(maps, key=lambda m: (m.role != "friction", m.model))[:MAX_PANELS]
    more = f" Of {len(maps)} maps, {len(shown)} are shown." if len(maps) > len(shown) else ""
    caption = explanation("joints-friction", joint=title(joint), more=more)
    alt = f"Friction over velocity of {name_in_sentence(joint)}: {friction_in_words(shown[0])}"
    panels = tuple(friction_panel(m) for m in shown)
    yield Figure(caption, alt, panels, f"friction-{joint}", columns=2 if len(shown) > 1 else 1, height=48)


def friction_panel(m: FrictionMap) -> Panel:
    """One map."""
    branches = [(m.gaining == gaining, name, colour) for gaining, name, colour in BRANCHES]
    marks = [
        Points(m.dq[branch], m.tau_friction[branch], name, colour, y_std=m.tau_friction_std[branch])
        for branch, name, colour in branches
        if branch.any()
    ]
    velocity, friction = label(m, "dq", "velocity"), label(m, "tau_friction", "friction")
    return Panel(f"{m.log} ({m.model})", velocity, friction, (*marks, *friction_curves(m)))


def friction_curves(m: FrictionMap) -> Iterator[Line]:
    """The model's friction: one curve for both branches if it has no memory, else one curve for each."""
    branches = [m.gaining == 1, m.gaining == 0] if m.model != "independent" else [np.full(len(m), True)]
    order = np.argsort(m.dq, kind="stable")
    curves = (order[(branch & side)[order]] for branch in branches for side in (m.dq < 0, m.dq > 0))
    for i, rows in enumerate(rows for rows in curves if len(rows)):
        yield Line(m.dq[rows], m.tau_friction_hat[rows], "" if i else "model", "black", "solid")


def friction_in_words(m: FrictionMap) -> str:
    """State the mean friction in either direction."""
    sides = [float(m.tau_friction[side].mean()) if side.any() else 0.0 for side in (m.dq < 0, m.dq > 0)]
    return f"{in_format(sides[0], '.2g')} on average backwards and {in_format(sides[1], '.2g')} forwards."
