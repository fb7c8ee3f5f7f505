"""Errors of the fits on efforts that they were not fitted to."""

from collections.abc import Iterator

from davinci_forces.records import Prediction
from davinci_forces.report.content import Block, Cell, Figure, OnScreen, Panel, Prose, Table
from davinci_forces.report.content.marks import Line
from davinci_forces.report.context import Context, fit_name, label, title
from davinci_forces.report.sections import parts
from davinci_forces.report.verdicts import error_share, is_out_of_log, percent


@parts.section_of("Prediction", "prediction", Prediction)
def section(context: Context, predictions: list[Prediction]) -> Iterator[Block]:
    """Scores of the fit that the filter uses on every log, a comparison of the fits, and the worst predictions."""
    yield Prose(parts.explanation("prediction"))
    used = [p for p in predictions if f"{p.model}.{p.estimator}" in context.predicting_fits(p.joint)]
    header = ("Log", "Joint", "Left out", "New path", "Model error", "Mean", "Error / effort", "$R^2$", "Ceiling")
    caption = parts.explanation("prediction-table")
    rows = tuple(row(context, p) for p in used)
    yield from parts.paper_or_screen(Table(caption, header, rows, "prediction-table", "llllrrrrr"))
    scores = (*estimators(context, predictions), every_score(context, predictions))
    yield OnScreen("Every fit compared, and its scores in every run", "all-scores", scores)
    unseen = parts.of_free_motion(context, used)
    joints = context.joints_of(unseen)
    worst = [max((p for p in unseen if p.joint == joint), key=lambda p: p.model_error) for joint in joints]
    worst.sort(key=lambda p: -p.model_error / (p.effort_rms or 1.0))  # the worst of all on paper
    figures = [figure(context, p) for p in worst]
    yield from parts.first_on_paper(figures, "The worst predicted run of each other joint", "worst-predicted")


def row(context: Context, p: Prediction) -> tuple[Cell, ...]:
    """The scores of one run."""
    is_fitted = p.role == "identification"
    how = p.scheme.removeprefix("leave ").removesuffix(" out") if is_fitted else "never fitted"
    how = how if context.study.log(p.log).has_known_free_motion else f"{how}; contacts in it"
    key = f"path.{p.log}.{p.joint}.path_new"
    new = percent(context.results[key].value) if is_out_of_log(p) and key in context.results else p.path.split()[0]
    error, mean, r2, ceiling = context.numbers(p.prefix, ("model_error", "mean_error", "r2", "r2_ceiling"), 2)
    return *parts.run_cells(p), how, new, error, mean, error_share(p), r2, ceiling


def every_score(context: Context, predictions: list[Prediction]) -> Table:
    """All scores of all fits."""
    names = ("rmse", "nrmse", "r2", "r2_ceiling", "model_error", "relative_error")
    rows = tuple(
        (*parts.run_cells(p), fit_name(p.model, p.estimator), *context.numbers(p.prefix, names)) for p in predictions
    )
    header = ("Log", "Joint", "Fit", "RMSE", "RMSE over range", "$R^2$", "Ceiling", "Model error", "Relative residual")
    return Table(parts.explanation("scores-table"), header, rows, "scores-table", "lllrrrrrr")


def estimators(context: Context, predictions: list[Prediction]) -> Iterator[Table]:
    """The worst model error of every fit, joint by joint."""
    joints = context.joints_of(predictions)
    worst: dict[tuple[str, str], dict[str, Prediction]] = {(p.model, p.estimator): {} for p in predictions}
    for joint in joints:
        unseen = parts.of_free_motion(context, [p for p in predictions if p.joint == joint])
        for p in sorted(unseen, key=lambda p: p.model_error):
            worst[p.model, p.estimator][joint] = p
    if len(worst) < 2:
        return
    keys = {fit: [f"{of[j].prefix}.model_error" if j in of else "" for j in joints] for fit, of in worst.items() if of}
    rows = tuple((fit_name(*fit), *(context.number(key, 3) for key in of_fit)) for fit, of_fit in keys.items())
    caption = parts.explanation("estimators-table")
    yield Table(caption, ("Fit", *map(title, joints)), rows, "estimators-table", "l" + "r" * len(joints))


def figure(context: Context, p: Prediction) -> Figure:
    """Measured and predicted effort of one log."""
    name, windows = parts.run_name(p), parts.spans(context.study.log(p.log).contact, "contact")
    error, size = Line(p.t, p.tau - p.tau_hat, "", "blue"), context.number(f"{p.prefix}.model_error", 2)
    fit = fit_name(p.model, p.estimator)
    unfitted = parts.UNFITTED * (p.role != "identification")
    caption = parts.explanation("prediction-figure", run=name, unfitted=unfitted, fit=fit)
    alt = f"{name}: the model error is {size}."
    panels = (
        parts.effort_panel(p, *windows),
        Panel("Measured minus model", "time [s]", label(p, "tau", "effort"), (*windows, error)),
    )
    return Figure(caption, alt, panels, f"prediction-figure-{p.log}-{p.joint}", zoomable=True, height=32)
