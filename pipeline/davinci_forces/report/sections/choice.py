"""The choice of the arm's model among all candidates."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Choice, ModelSearch
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.records.record import as_list, slug
from davinci_forces.report.content import Block, Figure, OnScreen, Panel, Prose, Table, Verdict, in_format, literal
from davinci_forces.report.content.marks import Points
from davinci_forces.report.context import Context, fit_name, title
from davinci_forces.report.sections.parts import explanation, section_of


@section_of("Choice of the model", "choice", Choice)
def section(context: Context, choices: list[Choice]) -> Iterator[Block]:
    """The choice with its scores."""
    choice = choices[0]
    yield from map(Prose, explanation("choice").split("\n\n"))
    yield Verdict("info", choice_in_words(context, choice))
    caption = "The best candidate of each structure and added friction. Bold: chosen by the scores."
    yield table(context, choice, best_rows(choice), caption, "choice-table")
    yield from search_tables(context)
    yield figure(choice)
    order = np.argsort(choice.score, kind="stable").tolist()
    every = table(context, choice, order, "Every candidate, the best first.", "candidates-table")
    yield OnScreen("Every candidate", "all-candidates", (every,))


def choice_in_words(context: Context, choice: Choice) -> str:
    """State the model in use, where it is not the chosen candidate as it was fitted, and why that one was chosen."""
    used = dict.fromkeys(context.used_fit(fit.group) for fit in context.own_fits())
    names = as_list([f"“{fit_name(*name.partition('.')[::2])}”" for name in used])
    why = choice.why.removeprefix(choice.chosen)  # the choice is named once
    why = f"{'It' if why != choice.why else ''}{literal(why)}."
    chosen = f"“{literal(choice.chosen)}”"
    if context.study.settings.fit != CHOSEN:
        return f"**In use: {names}, by the setting `fit`. By the scores: {chosen}.** {why}"
    if f"{CHOSEN}.consistent" in used:
        return f"**In use: {names}. First chosen: {chosen}.** {why} {explanation('choice-replaced')}"
    return f"**Chosen: {chosen}.** {why}"


def search_tables(context: Context) -> Iterator[Block]:
    """The steps of the search for the model of each joint, up to the chosen one."""
    header = ("Step", "Low-pass / Hz", "Lag / ms", "Ridge", "Parameters", "Path blocks left out")
    for search in (search for search in context.catalogue.records(ModelSearch) if search.used):
        columns = search.step, search.step_cutoff, search.step_lag, search.step_ridge, search.parameters, search.score
        rows = tuple(
            (literal(str(step)), f"{cutoff:g}", in_format(1e3 * lag, "g"), f"{ridge:g}", str(count), f"{score:.4f}")
            for step, cutoff, lag, ridge, count, score in zip(*columns, strict=True)
        )
        rows, last = rows[: search.chosen_step + 1], len(search) - 1
        end = f" A further step would reach {search.score[last]:.4f}, which is not clearly less."
        caption = f"{title(search.joint)}, {search.structure}: relative residual after each step of the search."
        caption += end if search.chosen_step < last else " No further step reduced the error."
        yield Table(caption, header, rows, f"search-{search.joint}", "lrrrrr")


def best_rows(choice: Choice) -> list[int]:
    """The rows of the best candidate of each variant, and of the chosen one."""
    best: dict[str, int] = {}
    for i in np.argsort(choice.score, kind="stable").tolist():
        best.setdefault(str(choice.variant[i]), i)
    return sorted({*best.values(), choice.row_number(choice.chosen)}, key=lambda i: float(choice.score[i]))


def table(context: Context, choice: Choice, rows: list[int], caption: str, label: str) -> Table:
    """Scores of the candidates in these rows of a choice; the chosen one is bold."""
    header = ("Candidate", "Parameters", "Path blocks left out", "Fitted data", "Periods left out", "Total inertia > 0")
    caption += f" {explanation('choice-table')}"
    cells = []
    for i in rows:
        name, physical = str(choice.candidate[i]), "yes" if choice.physical[i] else "no"
        key = f"choice.{choice.group}.{slug(name)}"
        scores = context.numbers(key, ("score", "training", "over_periods"))
        named = f"**{literal(name)}**" if name == choice.chosen else literal(name)
        cells.append((named, context.count(f"{key}.parameters"), *scores, physical))
    return Table(caption, header, cells, label, "lrrrrl")


def figure(choice: Choice) -> Figure:
    """Error over number of parameters: it falls on fitted data, but not always on data left out."""
    size, chosen = choice.parameters.astype(float), choice.row_number(choice.chosen)
    marks = (
        Points(size, choice.training, "fitted data", "sky"),
        Points(size, choice.score, "blocks of path left out", "vermillion"),
        Points(size[[chosen]], choice.score[[chosen]], "chosen", "black", y_std=choice.score_std[[chosen]]),
    )
    finite = np.isfinite(choice.over_periods)
    repeated = (Points(size[finite], choice.over_periods[finite], "periods left out", "green"),) if finite.any() else ()
    alt = "Relative residual over number of parameters: falling on fitted data, but not always on data left out."
    panels = (Panel("Candidates", "parameters", "relative residual", (*marks, *repeated)),)
    return Figure(explanation("choice-figure"), alt, panels, label="choice-figure", height=46)
