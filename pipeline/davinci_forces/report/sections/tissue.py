"""Stiffness of tissue: force against depth, residual of a straight line, hysteresis loop, and map of a surface."""

from collections.abc import Iterator, Sequence

import numpy as np

from davinci_forces.maths.arrays import evenly
from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records import Column, Push, Stiffness, TissueModel
from davinci_forces.report.content import Block, Cell, Figure, OnScreen, Panel, Prose, Table, Verdict, literal
from davinci_forces.report.content.marks import AnyMark, Band, Colour, Histogram, HLine, Line, Points, VSpan
from davinci_forces.report.context import Context, count, title
from davinci_forces.report.sections.parts import MM, THESIS_TISSUE, explanation, section_of
from davinci_forces.report.verdicts import is_minority, stiffness_level

FIGURES_ON_PAPER = 1  # figures of force, and as many maps, in the PDF; the others are on screen only
PUSHES_PER_PANEL = 8
SAMPLES_PER_PUSH = 60  # samples drawn of each push in a panel of several pushes
MAX_PUSHES_LISTED = 20  # pushes of a log; with more, a histogram of their stiffness replaces the loop of one push
MIN_SPACING_MAP = 1e-3  # [m] extent of the pushed places, below which no map is drawn
CLASSES: tuple[Colour, ...] = ("blue", "sky", "orange", "vermillion")
WAYS: tuple[tuple[int, str, Colour], ...] = ((1, "in", "blue"), (0, "out", "orange"))


@section_of("Tissue", "tissue", Stiffness)
def section(context: Context, tissues: list[Stiffness]) -> Iterator[Block]:
    """All tissue logs."""
    yield from (verdict(context, tissue) for tissue in tissues)
    yield Prose(explanation("tissue"))
    yield comparison(context, tissues)
    forces = [figure for tissue in tissues for figure in force_figure(context, tissue)]
    maps = [surface_map(tissue) for tissue in tissues if spread(tissue) > MIN_SPACING_MAP]
    yield from (*forces[:FIGURES_ON_PAPER], *maps[:FIGURES_ON_PAPER])
    models = context.catalogue.records(TissueModel)
    details: tuple[Block, ...] = (
        *forces[FIGURES_ON_PAPER:],
        *maps[FIGURES_ON_PAPER:],
        *each_push(context, tissues),
        *model_tables(context, models),
    )
    if details:
        yield OnScreen("More on the tissue: other logs, every push, and models", "more-tissue", details)


def verdict(context: Context, tissue: Stiffness) -> Verdict:
    """Grade the stiffness of one log by its standard error."""
    name = f"**{literal(tissue.log)}**"
    if not tissue.pushes:
        text = f"a straight line explains 90 % of the force beyond noise in none of {count(len(tissue), 'push')}"
        return Verdict("bad", f"{name}: {text}.")
    stiffness = context.results[f"tissue.{tissue.log}.stiffness"].number()
    law = next((model.chosen for model in context.catalogue.select(TissueModel, log=tissue.log)), "")
    text = f"{name}: {stiffness} from {tissue.pushes} of {count(len(tissue), 'push')}"
    text += (f"; best model: {law}" if law else "") + ("; most pushes do not count" if is_minority(tissue) else "")
    true = context.true_stiffness(tissue.log)
    if true is not None:
        missed = abs(tissue.stiffness - true) > NORMAL_95 * tissue.stiffness_std
        text += f"; the 95 % interval {'misses' if missed else 'contains'} the true {true:g} N/m"
    return Verdict(stiffness_level(tissue, true), f"{text}.")


def comparison(context: Context, tissues: Sequence[Stiffness]) -> Table:
    """One row a log; in simulations of the thesis's experiments, also the stiffness that the thesis states."""
    rows: list[tuple[Cell, ...]] = []
    for tissue in tissues:
        key, source = f"tissue.{tissue.log}", "sensor" if tissue.source == "force sensor" else title(tissue.source)
        numbers = context.numbers(key, ("stiffness", "stiffness_q1", "stiffness_q3"), 4)
        used, in_contact = context.count(f"{key}.pushes"), f"{len(tissue)} of {tissue.swings}"
        rows.append((literal(tissue.log), source, *numbers, used, in_contact))
    if context.compares_with_thesis:
        rows.append(("thesis, section 8.2", "Instrument slide", f"{THESIS_TISSUE}", "–", "–", "1", "1 of 1"))
    header = ("Log", "Force from", "Stiffness", "Quartile 1", "Quartile 3", "Used", "In contact")
    return Table(explanation("tissue-table"), header, tuple(rows), "tissue-table", "llrrrrr")


def nearest(tissue: Stiffness) -> int:
    """The push whose stiffness is nearest to that of the log; if no push is used, the push with the best line."""
    if not tissue.pushes:
        return int(np.argmax(tissue.r2))
    return int(np.argmin(np.where(tissue.counted == 1, np.abs(tissue.k_t - tissue.stiffness), np.inf)))


def force_figure(context: Context, tissue: Stiffness) -> Iterator[Figure]:
    """Pushes with the line of a typical push, the residual of this line, and its hysteresis or a histogram."""
    recorded = {push.push: push for push in context.catalogue.select(Push, log=tissue.log)}
    typical = recorded.get(int(tissue.push[nearest(tissue)]))
    if typical is None:
        return
    few = tissue.push[evenly(len(tissue), PUSHES_PER_PANEL)].tolist()
    pushes = [recorded[number] for number in few if number in recorded]
    name, many = literal(tissue.log), len(tissue) > MAX_PUSHES_LISTED
    last = spread_panel(tissue) if many else hysteresis_panel(typical)
    misfit = typical.force - typical.intercept - typical.k_t * typical.depth
    residual = Panel("Residual", "depth [mm]", "force [N]", (HLine(0.0), *in_and_out(typical, misfit)))
    why = "The stiffness of this push is nearest to that of the log." if tissue.pushes else "No push counts."
    third = "the distribution of the stiffness of pushes" if many else "its force on the way in and out (hysteresis)"
    caption = explanation("tissue-force", log=name, push=typical.push, third=third, why=why)
    alt = f"Force over depth in {name}, with a line of slope {typical.k_t:.4g} N/m that explains {typical.r2:.0%}."
    panels = (line_panel(pushes, typical), residual, last)
    yield Figure(caption, alt, panels, f"tissue-{tissue.log}", columns=3, height=46)


def line_panel(pushes: Sequence[Push], typical: Push) -> Panel:
    """Force against depth of several pushes, and the line of the typical one with its interval."""
    marks: list[AnyMark] = []
    for push in pushes:
        contact = np.flatnonzero(push.inside)
        few = contact[:: max(len(contact) // SAMPLES_PER_PUSH, 1)]
        marks.append(Points(MM * push.depth[few], push.force[few], "contact" if push is pushes[0] else "", "sky"))
    depth = typical.depth[typical.inside == 1]
    x = np.linspace(depth.min(), depth.max(), 50)
    y = typical.intercept + typical.k_t * x
    wide = NORMAL_95 * typical.k_t_std * np.abs(x - depth.mean())
    marks += [Band(MM * x, y - wide, y + wide, "95 %", "vermillion"), Line(MM * x, y, "line", "black", "solid")]
    return Panel("Force against depth", "depth [mm]", "force [N]", tuple(marks))


def hysteresis_panel(push: Push) -> Panel:
    """The hysteresis of one push, with the force of the chosen model."""
    touching = push.inside == 1  # the way to the tissue would set the scale
    model = Line(MM * push.depth[touching], push.fitted[touching], "model", "black", "solid")
    heading = f"Hysteresis of push {push.push}"
    return Panel(heading, "depth [mm]", "force [N]", (*in_and_out(push, push.force), model))


def in_and_out(push: Push, y: Column) -> Iterator[Points]:
    """The samples of contact on the way in and on the way out."""
    for loading, name, colour in WAYS:
        way = (push.inside == 1) & (push.loading == loading)
        if loading or way.any():
            yield Points(MM * push.depth[way], y[way], name, colour)


def spread_panel(tissue: Stiffness) -> Panel:
    """A histogram of the stiffness of the used pushes, with its quartiles."""
    counts, edges = np.histogram(tissue.k_t[tissue.counted == 1], bins=40)
    quartiles = VSpan(tissue.stiffness_q1, tissue.stiffness_q3, "quartiles")
    return Panel("Stiffness of pushes", "stiffness [N/m]", "pushes", (quartiles, Histogram(edges, counts, "", "blue")))


def spread(tissue: Stiffness) -> float:
    """The second largest extent [m] of the pushed places among x, y and z."""
    reach = [float(np.ptp(places)) if np.isfinite(places).all() else 0.0 for places in (tissue.x, tissue.y, tissue.z)]
    return sorted(reach)[1] if len(tissue) > 3 else 0.0


def surface_map(tissue: Stiffness) -> Figure:
    """The stiffness over the surface, along its two longest axes, in four classes of equally many pushes."""
    places = {"x": tissue.x, "y": tissue.y, "z": tissue.z}
    across, along = sorted(sorted(places, key=lambda name: -float(np.ptp(places[name])))[:2])
    k = tissue.k_t
    edges = np.quantile(k, [0.0, 0.25, 0.5, 0.75, 1.0])
    place = np.clip(np.searchsorted(edges, k, side="right") - 1, 0, 3)
    marks = []
    for i, colour in enumerate(CLASSES):
        x, y = MM * places[across][place == i], MM * places[along][place == i]
        marks.append(Points(x, y, f"{edges[i]:.0f} to {edges[i + 1]:.0f} N/m", colour))
    name, number = literal(tissue.log), count(len(tissue), "push")
    caption = f"{name}: stiffness over the surface, at the deepest sample of each push in contact."
    alt = f"Where {number} of {name}, coloured by stiffness, from {edges[0]:.0f} to {edges[4]:.0f} N/m."
    panels = (Panel("Stiffness", f"{across} [mm]", f"{along} [mm]", tuple(marks)),)
    return Figure(caption, alt, panels, f"tissue-map-{tissue.log}", height=70)


def each_push(context: Context, tissues: Sequence[Stiffness]) -> Iterator[Table]:
    """Every push of the logs with few pushes."""
    header = ("Push", "Stiffness", "R2", "First contact", "On the way in", "On the way out", "Energy lost", "Share")
    names = ("k_t", "r2", "onset_depth", "k_t_loading", "k_t_unloading", "lost", "lost_share")
    for tissue in (tissue for tissue in tissues if len(tissue) <= MAX_PUSHES_LISTED):
        prefix, caption = f"tissue.{tissue.log}", explanation("pushes", log=literal(tissue.log))
        rows = tuple((str(push), *context.numbers(f"{prefix}.{push}", names)) for push in tissue.push.tolist())
        yield Table(caption, header, rows, f"pushes-{tissue.log}", "lrrrrrrr")


def model_tables(context: Context, models: Sequence[TissueModel]) -> Iterator[Table]:
    """The errors of the models of the tissue on pushes that were left out of the fit."""
    header = ("Log", "Model", "Error on pushes left out", "Stiffness", "Damping", "Exponent", "")
    rows = []
    for model in models:
        for name in model.law.tolist():
            prefix = f"tissue.{model.log}.{name.lower().replace('-', '_').replace(' ', '_')}"
            numbers = context.numbers(prefix, ("error", "tangent", "damping", "exponent"))
            rows.append((literal(model.log), name, *numbers, "chosen" if name == model.chosen else ""))
    if rows:
        yield Table(explanation("tissue-models"), header, tuple(rows), "tissue-models", "llrrrrl")
