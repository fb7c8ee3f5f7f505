"""Which model was chosen for the arm, from among what, and whether data that nobody fitted agree."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Choice, Fit, Prediction
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.records.record import slug
from davinci_forces.report.content import (
    Block,
    Cell,
    Figure,
    OnScreen,
    Panel,
    Points,
    Prose,
    Section,
    Table,
    Verdict,
    literal,
)
from davinci_forces.report.context import Context, fit_name, title
from davinci_forces.report.sections.parts import MEASURES, listed

SHOWN = 9  # runs at most in the PDF
SAME = 1e-9  # relative errors closer than this are one


def section(context: Context) -> Section | None:
    """The choice with its scores, and what it is worth on unseen logs; none where nothing was chosen."""
    choices = context.catalogue.all(Choice)
    return Section("Choice of the model", "choice", tuple(blocks(context, choices[0]))) if choices else None


def blocks(context: Context, choice: Choice) -> Iterator[Block]:
    """The section's content."""
    yield Prose(
        "Candidates are a structure, each joint by itself or coupled through the arm's links, with friction added to "
        "it, and a ridge. Each is refitted without a sixth of the path, without half of it, and without each log where "
        "there are several, and judged by the relative error where it was not fitted: measured motion, effort and "
        "prediction through one low-pass, the mean over joints, where they do not stand still. One candidate is taken "
        "for the whole arm, the smallest that is not clearly worse than the best and whose inertia is positive "
        f"definite along the trajectories. {MEASURES}"
    )
    yield Verdict("info", f"**Chosen: {literal(choice.chosen)}.** {literal(choice.why)}.")
    yield table(context, choice, leading(choice), "The best candidate of each variant.", "choice-table")
    yield figure(choice)
    every = np.argsort(choice.score, kind="stable").tolist()
    yield OnScreen(
        "Every candidate", "all-candidates",
        (table(context, choice, every, "Every candidate, the best first.", "candidates-table"),),
    )  # fmt: skip
    yield from overfitting(choice)
    yield from unseen(context)
    yield from parameters(context)


def leading(choice: Choice) -> list[int]:
    """The rows of the best candidate of each variant, and of the chosen one."""
    best: dict[str, int] = {}
    for i in np.argsort(choice.score, kind="stable").tolist():
        best.setdefault(str(choice.variant[i]), i)
    chosen = choice.row_number(choice.chosen)
    best[str(choice.variant[chosen])] = chosen
    return sorted(best.values(), key=lambda i: float(choice.score[i]))


def table(context: Context, choice: Choice, rows: list[int], caption: str, label: str) -> Table:
    """Scores of candidates."""
    header = ("Candidate", "Parameters", "Path blocks left out", "Where fitted", "Periods left out", "Physical")
    said = (
        f"{caption} Relative errors: on blocks of path left out (raw samples), where fitted, and on periods left out."
    )
    return Table(said, header, tuple(row(context, choice, i) for i in rows), label, "lrrrrl")


def row(context: Context, choice: Choice, i: int) -> tuple[Cell, ...]:
    """The scores of one candidate; the chosen one is bold."""
    name = literal(str(choice.candidate[i]))
    key = f"choice.{choice.group}.{slug(str(choice.candidate[i]))}"
    scores = context.numbers(key, ("score", "training", "over_periods"))
    named = f"**{name}**" if choice.candidate[i] == choice.chosen else name
    return named, context.count(f"{key}.parameters"), *scores, "yes" if choice.physical[i] else "no"


def figure(choice: Choice) -> Figure:
    """Errors against size: what was fitted always gains from more parameters, what was not does not."""
    size, chosen = choice.parameters.astype(float), choice.row_number(choice.chosen)
    marks = (
        Points(size, choice.training, "where fitted", "sky"),
        Points(size, choice.score, "blocks of path left out", "vermillion"),
        Points(size[[chosen]], choice.score[[chosen]], "chosen", "black", y_std=choice.score_std[[chosen]]),
    )
    known = np.isfinite(choice.over_periods)
    repeated = (Points(size[known], choice.over_periods[known], "periods left out", "green"),) if known.any() else ()
    return Figure(
        "Relative error of every candidate against its size, where it was fitted and where it was not.",
        "Relative error over number of parameters: falling where fitted, not always where data were left out.",
        (Panel("Candidates", "parameters", "relative error", (*marks, *repeated)),),
        label="choice-figure",
        height=46,
    )


def overfitting(choice: Choice) -> Iterator[Verdict]:
    """Whether the candidate that fits best predicts worse than the chosen one."""
    closest, chosen = int(np.argmin(choice.training)), choice.row_number(choice.chosen)
    if choice.score[closest] > choice.score[chosen] + SAME and choice.training[closest] < choice.training[chosen]:
        yield Verdict(
            "info",
            f"{literal(str(choice.candidate[closest]))} fits best and overfits: its error is "
            f"{choice.training[closest]:.3f} where it was fitted and {choice.score[closest]:.3f} where it was not; the "
            f"chosen one's are {choice.training[chosen]:.3f} and {choice.score[chosen]:.3f}.",
        )


def unseen(context: Context) -> Iterator[Block]:
    """The chosen model beside each joint by itself, on logs that nobody fitted."""
    predictions = [p for p in context.catalogue.about(Prediction, model=CHOSEN) if p.role != "identification"]
    if not predictions:
        return
    rows = tuple(
        (
            literal(p.log),
            title(p.joint),
            p.path.removesuffix(" path"),
            context.number(f"{p.prefix}.relative_error", 3),
            context.number(f"predict.{p.log}.{p.joint}.independent.lse.relative_error", 3),
        )
        for p in predictions
    )
    header = ("Log", "Joint", "Path", "Chosen", "Joint by itself")
    table = Table("Relative error on logs that no parameter was fitted to.", header, rows, "choice-unseen", "lllrr")
    yield from listed(table, "The chosen model beside each joint by itself, run by run", SHOWN)


def parameters(context: Context) -> Iterator[Block]:
    """The parameters of the chosen fits, where they are not those of a joint by itself."""
    used = {context.used_fit(joint) for joint in (j.name for j in context.study.robot.joints)}
    fits = [f for f in context.catalogue.all(Fit) if f"{CHOSEN}.{f.model}.{f.estimator}" in used]
    tables = tuple(parameter_table(context, fit) for fit in fits if fit.model != "independent")
    if tables:
        yield OnScreen("Parameters of the chosen model", "chosen-parameters", tables)


def parameter_table(context: Context, fit: Fit) -> Table:
    """Every parameter with its standard error."""
    key = ".".join(("fit", *fit.key))
    rows = tuple((literal(str(name)), context.number(f"{key}.{slug(str(name))}", 2)) for name in fit.parameter)
    caption = f"{title(fit.group)}: {fit_name(fit.model, fit.estimator)}, from {literal(', '.join(fit.logs))}."
    return Table(caption, ("Parameter", "Value"), rows, f"chosen-{fit.group}", "lr")
