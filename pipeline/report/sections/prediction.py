"""How well the fits predict effort that they have not seen."""

from collections.abc import Iterator

from pipeline.records import Prediction
from pipeline.report.content import Block, Figure, Line, Panel, Prose, Section, Table, VSpan, literal
from pipeline.report.context import Context, label, title

FIGURES = 4  # predictions that are drawn, the worst ones


def section(context: Context) -> Section | None:
    """Scores of all fits on all logs, and the predictions themselves."""
    predictions = context.catalogue.all(Prediction)
    if not predictions:
        return None
    return Section("Prediction", "prediction", tuple(blocks(context, predictions)))


def blocks(context: Context, predictions: list[Prediction]) -> Iterator[Block]:
    """The section's content."""
    yield Prose(
        "A fit is judged on data that it has not seen: validation logs, contact logs outside their contact windows, "
        "and identification logs predicted from refits that leave the log out, with its neighbours where a joint has "
        "more than 20, or, where it has only one, each of its periods in turn. Scores are of the raw effort; the "
        "relative error compares low-passed efforts."
    )
    rows = tuple(
        (
            literal(p.log),
            title(p.joint),
            p.estimator.upper(),
            p.scheme,
            *(context.number(f"{p.prefix}.{name}", 3) for name in ("rmse", "nrmse", "r2", "relative_error")),
        )
        for p in predictions
    )
    header = ("Log", "Joint", "Fit", "Unseen data", "RMSE", "RMSE over range", "$R^2$", "Relative error")
    yield Table("Prediction of unseen effort.", header, rows, "prediction-table", "llllrrrr")
    drawn = [
        p for p in predictions if p.role != "identification" and f"{p.model}.{p.estimator}" == context.used_fit(p.joint)
    ]
    worst = sorted(drawn, key=lambda p: p.r2)[:FIGURES]
    if len(drawn) > FIGURES:
        yield Prose(f"Figures show the {FIGURES} of {len(drawn)} predictions that explain the least.")
    yield from (figure(context, p) for p in drawn if p in worst)


def figure(context: Context, p: Prediction) -> Figure:
    """Measured and predicted effort of one log."""
    name, effort = f"{title(p.joint)} in {literal(p.log)}", label(p, "tau", "effort")
    windows = tuple(
        VSpan(start, end, "contact" if i == 0 else "")
        for i, (start, end) in enumerate(context.study.log(p.log).contact)
    )
    return Figure(
        f"{name}: measured effort and the {p.estimator.upper()} model's, and their difference.",
        f"Two panels for {name}: measured and predicted effort over time, and the difference.",
        (
            Panel(
                "Effort", "time [s]", effort,
                (*windows, Line(p.t, p.tau, "measured", "sky"), Line(p.t, p.tau_hat, "model", "vermillion")),
            ),
            Panel("Measured minus model", "time [s]", effort, (*windows, Line(p.t, p.tau - p.tau_hat, "", "blue"))),
        ),
        zoomable=True,
        height=40,
    )  # fmt: skip
