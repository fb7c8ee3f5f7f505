"""How stiff the tissue is: force against depth, what a straight line leaves, the loop, and the map of a surface."""

from collections.abc import Iterator, Sequence

import numpy as np

from davinci_forces.maths.arrays import Booleans, evenly
from davinci_forces.records import Column, Push, Stiffness, TissueModel
from davinci_forces.report.content import (
    Band,
    Block,
    Cell,
    Figure,
    Histogram,
    HLine,
    Line,
    OnScreen,
    Panel,
    Points,
    Prose,
    Section,
    Table,
    Verdict,
    VSpan,
    literal,
)
from davinci_forces.report.content.marks import AnyMark, Colour
from davinci_forces.report.context import Context, title
from davinci_forces.report.sections.parts import THESIS_TISSUE
from davinci_forces.report.verdicts import NORMAL_95, STIFF, STIFFER, graded

THESIS_ROBOT = "davinci"
SHOWN = 1  # figures of force, and maps; the others are on screen
TOGETHER = 8  # pushes in one panel
SAMPLES = 60  # of a push in a panel of several
MANY = 20  # pushes, beyond which their spread says more than one loop
EVEN = 1e-3  # [m] between places, below which there is no map
CLASSES: tuple[Colour, ...] = ("blue", "sky", "orange", "vermillion")
MM = 1e3


def section(context: Context) -> Section | None:
    """All tissue logs; None of a study without any."""
    tissues = context.catalogue.all(Stiffness)
    return Section("Tissue", "tissue", tuple(blocks(context, tissues))) if tissues else None


def blocks(context: Context, tissues: list[Stiffness]) -> Iterator[Block]:
    """The section's content."""
    yield from (verdict(context, tissue) for tissue in tissues)
    yield Prose(
        "The stiffness of a push is the slope of an ordinary straight line, with an intercept, through its contact, "
        "which begins and ends where the force bends; of a log, the median over pushes of which the line explains 90 %."
        " The error allows for correlated residuals, for tissue that differs from place to place, and for the error of "
        "a joint's model, in whatever way along the depth it moves the slope most. A joint's force is its effort less "
        "the model's, low-passed without delay, as the filter's would come late; at rest, where friction takes any "
        "value, it does not count."
    )
    yield comparison(context, tissues)
    forces = [figure for tissue in tissues for figure in force_figures(context, tissue)]
    maps = [surface_map(tissue) for tissue in tissues if spread(tissue) > EVEN]
    yield from (*forces[:SHOWN], *maps[:SHOWN])
    models = context.catalogue.all(TissueModel)
    details: tuple[Block, ...] = (
        *forces[SHOWN:],
        *maps[SHOWN:],
        *each_push(context, tissues),
        *model_tables(context, models),
    )
    if details:
        yield OnScreen("More on the tissue: other logs, every push, and models", "more-tissue", details)


def verdict(context: Context, tissue: Stiffness) -> Verdict:
    """How well one log tells the stiffness."""
    name = f"**{literal(tissue.log)}**"
    if not tissue.pushes:
        return Verdict("bad", f"{name}: a straight line explains 90 % of the force in none of {pushes(len(tissue))}.")
    level = graded(tissue.stiffness_std / tissue.stiffness, STIFF, STIFFER) if tissue.stiffness > 0 else "bad"
    stiffness = context.results[f"tissue.{tissue.log}.stiffness"].number()
    model = f"; {chosen(context, tissue.log)}" if chosen(context, tissue.log) else ""
    text = f"{name}: {stiffness}, {tissue.pushes} of {pushes(len(tissue))}{model}{true_words(context, tissue)}."
    return Verdict("warn" if level == "good" and tissue.pushes == 1 else level, text)


def true_words(context: Context, tissue: Stiffness) -> str:
    """Whether the interval of 95 % holds what is true of a simulated log."""
    value = true_stiffness(context, tissue.log)
    if value is None:
        return ""
    held = abs(tissue.stiffness - value) <= NORMAL_95 * tissue.stiffness_std
    return f"; {'holds' if held else 'does **not** hold'} the true {value:g} N/m"


def true_stiffness(context: Context, log: str) -> float | None:
    """The stiffness that a simulation put in."""
    entries = [entry for entry in context.study.truth.get("log", []) if entry.get("name") == log]
    return float(entries[0]["stiffness"]) if entries and "stiffness" in entries[0] else None


def chosen(context: Context, log: str) -> str:
    """The model that predicts the pushes of a log, or "" where none could be chosen."""
    return next((model.chosen for model in context.catalogue.about(TissueModel, log=log)), "")


def comparison(context: Context, tissues: Sequence[Stiffness]) -> Table:
    """One row a log, and what the thesis states of the same robot."""
    rows: list[tuple[Cell, ...]] = [
        (
            literal(tissue.log),
            "sensor" if tissue.source == "force sensor" else title(tissue.source),
            context.number(f"tissue.{tissue.log}.stiffness"),
            context.number(f"tissue.{tissue.log}.stiffness_q1"),
            context.number(f"tissue.{tissue.log}.stiffness_q3"),
            context.count(f"tissue.{tissue.log}.pushes"),
            f"{len(tissue)} of {tissue.swings}",
        )
        for tissue in tissues
    ]
    if context.study.robot.name == THESIS_ROBOT:
        rows.append(("thesis, section 8.2", "Instrument slide", f"{THESIS_TISSUE}", "–", "–", "1", "1 of 1"))
    header = ("Log", "Force of", "Stiffness", "Quartile 1", "Quartile 3", "Count", "In contact")
    return Table(
        "Stiffness of the tissue; how many pushes count, and in how many of those looked at there is contact.",
        header,
        tuple(rows),
        "tissue-table",
        "llrrrrr",
    )


def force_figures(context: Context, tissue: Stiffness) -> Iterator[Figure]:
    """Force against depth of one log, where its pushes are at hand."""
    own = {push.push: push for push in context.catalogue.about(Push, log=tissue.log)}
    typical = own.get(int(tissue.push[nearest(tissue)]))
    if typical is not None:
        few = evenly(len(tissue), TOGETHER)
        yield force_figure(tissue, [own[number] for number in tissue.push[few].tolist() if number in own], typical)


def nearest(tissue: Stiffness) -> int:
    """The push whose stiffness is nearest to that of the log; where none counts, the one of the best line."""
    if not tissue.pushes:
        return int(np.argmax(tissue.r2))
    return int(np.argmin(np.where(tissue.counted == 1, np.abs(tissue.k_t - tissue.stiffness), np.inf)))


def force_figure(tissue: Stiffness, pushes: Sequence[Push], typical: Push) -> Figure:
    """Pushes with the typical line and its interval, what the line leaves, and the loop or the spread."""
    name = literal(tissue.log)
    last = spread_panel(tissue) if len(tissue) > MANY else loop_panel(typical)
    third = "how the stiffness of pushes is spread" if len(tissue) > MANY else "its loop, on the way in and out"
    return Figure(
        f"{name}: force against depth of contact, with the line of push {typical.push}, which is nearest to the "
        f"stiffness of the log, and its 95 % interval; what the line leaves; and {third}.",
        f"Force over depth in {name}, with a line of slope {typical.k_t:.4g} N/m that explains {typical.r2:.0%}.",
        (line_panel(pushes, typical), residual_panel(typical), last),
        f"tissue-{tissue.log}",
        columns=3,
        height=46,
    )


def line_panel(pushes: Sequence[Push], typical: Push) -> Panel:
    """Force against depth of several pushes, and the line of the typical one with its interval."""
    marks: list[AnyMark] = []
    for push in pushes:
        contact = np.flatnonzero(push.inside)
        few = contact[:: max(len(contact) // SAMPLES, 1)]
        marks.append(Points(MM * push.depth[few], push.force[few], "contact" if push is pushes[0] else "", "sky"))
    depth = typical.depth[typical.inside == 1]
    x = np.linspace(depth.min(), depth.max(), 50)
    y = typical.intercept + typical.k_t * x
    wide = NORMAL_95 * typical.k_t_std * np.abs(x - depth.mean())
    marks += [Band(MM * x, y - wide, y + wide, "95 %", "vermillion"), Line(MM * x, y, "line", "black", "solid")]
    return Panel("Force against depth", "depth [mm]", "force [N]", tuple(marks))


def residual_panel(push: Push) -> Panel:
    """What the straight line of one push leaves."""
    inside, loading = push.inside == 1, push.loading == 1
    left = push.force - push.intercept - push.k_t * push.depth
    marks: tuple[AnyMark, ...] = (HLine(0.0), *in_and_out(MM * push.depth, left, inside, loading))
    return Panel("Residual", "depth [mm]", "force [N]", marks)


def loop_panel(push: Push) -> Panel:
    """The loop of one push, with what the chosen model gives."""
    inside, loading = push.inside == 1, push.loading == 1
    model = Line(MM * push.depth, push.fitted, "model", "black", "solid")
    marks: tuple[AnyMark, ...] = (*in_and_out(MM * push.depth, push.force, inside, loading), model)
    return Panel(f"Loop of push {push.push}", "depth [mm]", "force [N]", marks)


def in_and_out(x: Column, y: Column, inside: Booleans, loading: Booleans) -> tuple[Points, ...]:
    """The samples of contact on the way in and on the way out."""
    into, out = inside & loading, inside & ~loading
    first = Points(x[into], y[into], "in", "blue")
    return (first, Points(x[out], y[out], "out", "orange")) if out.any() else (first,)


def spread_panel(tissue: Stiffness) -> Panel:
    """How the stiffness of the pushes that count is spread, with its quartiles."""
    counts, edges = np.histogram(tissue.k_t[tissue.counted == 1], bins=40)
    quartiles = VSpan(tissue.stiffness_q1, tissue.stiffness_q3, "quartiles")
    return Panel("Stiffness of pushes", "stiffness [N/m]", "pushes", (quartiles, Histogram(edges, counts, "", "blue")))


def spread(tissue: Stiffness) -> float:
    """The second largest distance [m] between places that pushes go to, along x, y and z."""
    reach = [float(np.ptp(places)) if np.isfinite(places).all() else 0.0 for places in (tissue.x, tissue.y, tissue.z)]
    return sorted(reach)[1] if len(tissue) > 3 else 0.0


def surface_map(tissue: Stiffness) -> Figure:
    """The stiffness over the surface, in four classes of as many pushes each, along its two longest axes."""
    places = {"x": tissue.x, "y": tissue.y, "z": tissue.z}
    across, along = sorted(sorted(places, key=lambda name: -float(np.ptp(places[name])))[:2])
    k = tissue.k_t
    edges = np.quantile(k, [0.0, 0.25, 0.5, 0.75, 1.0])
    place = np.clip(np.searchsorted(edges, k, side="right") - 1, 0, 3)
    marks = tuple(
        Points(
            MM * places[across][place == i], MM * places[along][place == i],
            f"{edges[i]:.0f} to {edges[i + 1]:.0f} N/m", colour,
        )
        for i, colour in enumerate(CLASSES)
    )  # fmt: skip
    name = literal(tissue.log)
    return Figure(
        f"{name}: stiffness over the surface, at the deepest sample of each push in contact.",
        f"Where {pushes(len(tissue))} of {name}, coloured by stiffness, from {edges[0]:.0f} to {edges[4]:.0f} N/m.",
        (Panel("Stiffness", f"{across} [mm]", f"{along} [mm]", marks),),
        f"tissue-map-{tissue.log}",
        height=70,
    )


def each_push(context: Context, tissues: Sequence[Stiffness]) -> Iterator[Table]:
    """Every push of logs that hold few."""
    header = ("Push", "Stiffness", "R2", "First contact", "On the way in", "On the way out", "Energy lost", "Share")
    names = ("k_t", "r2", "onset_depth", "k_t_loading", "k_t_unloading", "lost", "lost_share")
    for tissue in tissues:
        prefix = f"tissue.{tissue.log}"
        rows = tuple((str(push), *context.numbers(f"{prefix}.{push}", names)) for push in tissue.push.tolist())
        if len(rows) <= MANY:
            yield Table(f"{literal(tissue.log)}: every push.", header, rows, f"pushes-{tissue.log}", "lrrrrrrr")


def model_tables(context: Context, models: Sequence[TissueModel]) -> Iterator[Table]:
    """What models of the tissue come to on pushes that they have not seen."""
    header = ("Log", "Model", "Error on pushes left out", "Stiffness", "Damping", "Exponent", "")
    rows = []
    for model in models:
        for name in model.law.tolist():
            prefix = f"tissue.{model.log}.{name.lower().replace('-', '_').replace(' ', '_')}"
            numbers = context.numbers(prefix, ("error", "tangent", "damping", "exponent"))
            rows.append((literal(model.log), name, *numbers, "chosen" if name == model.chosen else ""))
    if rows:
        caption = "Models of the tissue; stiffness and damping are at half the usual depth below first contact."
        yield Table(caption, header, tuple(rows), "tissue-models", "llrrrrl")


def pushes(number: int) -> str:
    """A number of pushes in words: count() makes '2 pushs' of it."""
    return f"{number} push" if number == 1 else f"{number} pushes"
