"""How stiff the tissue is: force against depth, what a straight line leaves, the loop, and the map of a surface."""

from collections.abc import Iterator, Sequence

import numpy as np

from pipeline.maths.arrays import Booleans
from pipeline.records import Column, Push, Tissue, TissueModel
from pipeline.report.content import (
    Band,
    Block,
    Cell,
    Figure,
    Histogram,
    HLine,
    Level,
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
from pipeline.report.content.marks import AnyMark, Colour
from pipeline.report.context import Context, title
from pipeline.report.verdicts import STIFF, STIFFER, graded

THESIS = ("davinci", 457.24)  # robot, and the stiffness [N/m] that section 8.2 states of it
NORMAL_95 = 1.96
SHOWN = 2  # figures; the others are on screen
TOGETHER = 8  # pushes in one panel
MANY = 20  # pushes, beyond which their spread says more than one loop
EVEN = 1e-3  # [m] between places, below which there is no map
CLASSES: tuple[Colour, ...] = ("blue", "sky", "orange", "vermillion")
MM = 1e3


def section(context: Context) -> Section | None:
    """All tissue logs; None of a study without any."""
    tissues = context.catalogue.all(Tissue)
    return Section("Tissue", "tissue", tuple(blocks(context, tissues))) if tissues else None


def blocks(context: Context, tissues: list[Tissue]) -> Iterator[Block]:
    """The section's content."""
    yield from (verdict(context, tissue) for tissue in tissues)
    yield Prose(
        "Where contact begins is found from force and depth, on the way in and on the way out. The stiffness is the "
        "slope of an ordinary straight line, with an intercept, through all samples of the contact; that of a log is "
        "the median over the pushes of which the line explains more than 90 %. Intervals are of 95 %: they allow for "
        "residuals that are correlated, for tissue that differs from place to place, and, where the force is that of a "
        "joint, for the error of its model, taken to change with depth in whatever way moves the slope most. At rest "
        "friction takes any value, so a joint's samples at rest do not count; its effort less the model's is low-passed"
        " without delay, because the filter's estimate lags behind the depth and would open a loop."
    )
    yield comparison(context, tissues)
    figures = [figure for tissue in tissues for figure in figures_of(context, tissue)]
    yield from figures[:SHOWN]
    models = context.catalogue.all(TissueModel)
    details: tuple[Block, ...] = (*figures[SHOWN:], *each_push(context, tissues), *model_tables(context, models))
    if details:
        yield OnScreen("More on the tissue: other logs, every push, and models", "more-tissue", details)


def verdict(context: Context, tissue: Tissue) -> Verdict:
    """How well one log tells the stiffness."""
    name = f"**{literal(tissue.log)}**"
    if not tissue.pushes:
        return Verdict("bad", f"{name}: a straight line explains 90 % of the force in none of {pushes(len(tissue))}.")
    level = graded(tissue.stiffness_std / abs(tissue.stiffness), STIFF, STIFFER) if tissue.stiffness > 0 else "bad"
    levels: dict[bool, Level] = {True: "warn", False: level}
    number = context.results[f"tissue.{tissue.log}.stiffness"].number()
    model = f", by {literal(context_model)}" if (context_model := chosen(context, tissue.log)) else ""
    return Verdict(
        levels[level == "good" and tissue.pushes == 1],
        f"{name}: {number}, from {tissue.pushes} of {pushes(len(tissue))} in contact{true_words(context, tissue)}; "
        f"the force is {'a sensor’s' if tissue.source == 'force sensor' else 'that of ' + title(tissue.source).lower()}"
        f"{', and is best predicted' + model if model else ''}.",
    )


def true_words(context: Context, tissue: Tissue) -> str:
    """Whether the interval holds what is true of a simulated log."""
    value = true_stiffness(context, tissue.log)
    if value is None:
        return ""
    held = abs(tissue.stiffness - value) <= NORMAL_95 * tissue.stiffness_std
    return f"; the true {value:g} N/m {'lies' if held else 'does **not** lie'} in the interval"


def true_stiffness(context: Context, log: str) -> float | None:
    """The stiffness that a simulation put in."""
    entries = [entry for entry in context.study.truth.get("log", []) if entry.get("name") == log]
    return float(entries[0]["stiffness"]) if entries and "stiffness" in entries[0] else None


def chosen(context: Context, log: str) -> str:
    """The model that predicts the pushes of a log, or "" where none could be chosen."""
    return next((model.chosen for model in context.catalogue.about(TissueModel, log=log)), "")


def comparison(context: Context, tissues: Sequence[Tissue]) -> Table:
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
    if context.study.robot.name == THESIS[0]:
        rows.append(("thesis, section 8.2", "Instrument slide", f"{THESIS[1]} N/m", "–", "–", "1", "1 of 1"))
    header = ("Log", "Force of", "Stiffness", "Lower quartile", "Upper quartile", "Pushes that count", "In contact")
    return Table("Stiffness of the tissue.", header, tuple(rows), "tissue-table", "llrrrrr")


def figures_of(context: Context, tissue: Tissue) -> Iterator[Figure]:
    """Force against depth of one log, and the map of its surface where places differ."""
    own = {push.push: push for push in context.catalogue.about(Push, log=tissue.log)}
    typical = own.get(int(tissue.push[nearest(tissue)]))
    if typical is not None:
        few = np.linspace(0, len(tissue) - 1, min(len(tissue), TOGETHER)).round().astype(int)
        yield force_figure(tissue, [own[number] for number in tissue.push[few].tolist() if number in own], typical)
    if spread(tissue) > EVEN:
        yield surface_map(tissue)


def nearest(tissue: Tissue) -> int:
    """The push whose stiffness is nearest to that of the log; where none counts, the one of the best line."""
    if not tissue.pushes:
        return int(np.argmax(tissue.r2))
    return int(np.argmin(np.where(tissue.counted == 1, np.abs(tissue.k_t - tissue.stiffness), np.inf)))


def force_figure(tissue: Tissue, pushes: Sequence[Push], typical: Push) -> Figure:
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
        height=52,
    )


def line_panel(pushes: Sequence[Push], typical: Push) -> Panel:
    """Force against depth of several pushes, and the line of the typical one with its interval."""
    marks: list[AnyMark] = []
    for push in pushes:
        inside, first = push.inside == 1, push is pushes[0]
        marks.append(Points(MM * push.depth[inside], push.force[inside], "contact" if first else "", "sky"))
    depth = typical.depth[typical.inside == 1]
    x = np.linspace(depth.min(), depth.max(), 50)
    y = typical.intercept + typical.k_t * x
    wide = NORMAL_95 * typical.k_t_std * np.abs(x - depth.mean())
    marks += [Band(MM * x, y - wide, y + wide, "95 %", "vermillion"), Line(MM * x, y, "line", "vermillion", "solid")]
    return Panel("Force against depth", "depth [mm]", "force [N]", tuple(marks))


def residual_panel(push: Push) -> Panel:
    """What the straight line of one push leaves."""
    inside, loading = push.inside == 1, push.loading == 1
    left = push.force - push.intercept - push.k_t * push.depth
    marks: tuple[AnyMark, ...] = (HLine(0.0), *in_and_out(MM * push.depth, left, inside, loading))
    return Panel("What the line leaves", "depth [mm]", "force [N]", marks)


def loop_panel(push: Push) -> Panel:
    """The loop of one push, with what the chosen model gives."""
    inside, loading = push.inside == 1, push.loading == 1
    model = Line(MM * push.depth, push.fitted, "model", "black", "solid")
    marks: tuple[AnyMark, ...] = (*in_and_out(MM * push.depth, push.force, inside, loading), model)
    return Panel(f"Loop of push {push.push}", "depth [mm]", "force [N]", marks)


def in_and_out(x: Column, y: Column, inside: Booleans, loading: Booleans) -> tuple[Points, ...]:
    """The samples of contact on the way in and on the way out."""
    ways = ((loading, "in", "blue"), (~loading, "out", "orange"))
    return tuple(
        Points(x[inside & way], y[inside & way], name, colour) for way, name, colour in ways if (inside & way).any()
    )


def spread_panel(tissue: Tissue) -> Panel:
    """How the stiffness of the pushes that count is spread, with its quartiles."""
    counts, edges = np.histogram(tissue.k_t[tissue.counted == 1], bins=40)
    quartiles = VSpan(tissue.stiffness_q1, tissue.stiffness_q3, "quartiles")
    return Panel("Stiffness of pushes", "stiffness [N/m]", "pushes", (quartiles, Histogram(edges, counts, "", "blue")))


def spread(tissue: Tissue) -> float:
    """The second largest distance [m] between places that pushes go to, along x, y and z."""
    reach = [float(np.ptp(places)) if np.isfinite(places).all() else 0.0 for places in (tissue.x, tissue.y, tissue.z)]
    return sorted(reach)[1] if len(tissue) > 3 else 0.0


def surface_map(tissue: Tissue) -> Figure:
    """The stiffness over the surface, in four classes of as many pushes each, along its two longest axes."""
    places = {"x": tissue.x, "y": tissue.y, "z": tissue.z}
    across, along = sorted(sorted(places, key=lambda name: -float(np.ptp(places[name])))[:2])
    kept = tissue.counted == 1 if tissue.pushes > 3 else np.ones(len(tissue), bool)
    k = tissue.k_t[kept]
    edges = np.quantile(k, [0.0, 0.25, 0.5, 0.75, 1.0])
    place = np.clip(np.searchsorted(edges, k, side="right") - 1, 0, 3)
    marks = tuple(
        Points(
            MM * places[across][kept][place == i], MM * places[along][kept][place == i],
            f"{edges[i]:.0f} to {edges[i + 1]:.0f} N/m", colour,
        )
        for i, colour in enumerate(CLASSES)
    )  # fmt: skip
    name = literal(tissue.log)
    return Figure(
        f"{name}: stiffness over the surface, at the deepest sample of each push that counts.",
        f"Where {pushes(int(kept.sum()))} of {name}, coloured by stiffness, from {edges[0]:.0f} to {edges[4]:.0f} N/m.",
        (Panel("Stiffness", f"{across} [mm]", f"{along} [mm]", marks),),
        f"tissue-map-{tissue.log}",
        height=70,
    )


def each_push(context: Context, tissues: Sequence[Tissue]) -> Iterator[Table]:
    """Every push of logs that hold few."""
    header = ("Push", "Stiffness", "R2", "First contact", "On the way in", "On the way out", "Energy lost", "Share")
    names = ("k_t", "r2", "onset_depth", "k_t_loading", "k_t_unloading", "lost", "lost_share")
    for tissue in tissues:
        prefix = f"tissue.{tissue.log}"
        rows = tuple(
            (str(push), *(context.number(f"{prefix}.{push}.{name}", 3) for name in names))
            for push in tissue.push.tolist()
        )
        if len(rows) <= MANY:
            yield Table(f"{literal(tissue.log)}: every push.", header, rows, f"pushes-{tissue.log}", "lrrrrrrr")


def model_tables(context: Context, models: Sequence[TissueModel]) -> Iterator[Table]:
    """What models of the tissue come to on pushes that they have not seen."""
    header = ("Log", "Model", "Error on pushes left out", "Stiffness", "Damping", "Exponent", "")
    rows = []
    for model in models:
        for name in model.law.tolist():
            prefix = f"tissue.{model.log}.{name.lower().replace('-', '_').replace(' ', '_')}"
            numbers = (context.number(f"{prefix}.{field}", 3) for field in ("error", "tangent", "damping", "exponent"))
            rows.append((literal(model.log), name, *numbers, "chosen" if name == model.chosen else ""))
    if rows:
        caption = "Models of the tissue; stiffness and damping are at half the usual depth below first contact."
        yield Table(caption, header, tuple(rows), "tissue-models", "llrrrrl")


def pushes(number: int) -> str:
    """A number of pushes in words: count() makes '2 pushs' of it."""
    return f"{number} push" if number == 1 else f"{number} pushes"
