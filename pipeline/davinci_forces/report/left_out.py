"""How a joint's fits predict identification logs that refits had not seen, by two measures under their own names."""

from collections.abc import Iterator

from davinci_forces.records import Average, Prediction
from davinci_forces.records.predict import CHOSEN
from davinci_forces.report.content import Block, Cell, OnScreen, Prose, Table
from davinci_forces.report.context import Context, fit_name, title

LEFT_OUT = {
    "leave one log out": "the log",
    "leave one period out": "a period",
    "leave a block of path out": "a block of path",
    "leave a segment out": "a segment",
}
MEASURES = (
    "With periods left out, or logs, the error says how well a model describes the motion that it was made of: a "
    "period repeats the path of the others, so every parameter gains. With path blocks left out, on raw samples, it "
    "says what to expect on a path that is new; that is larger, and what a model is chosen by."
)


def left_out(context: Context, joint: str) -> Iterator[Block]:
    """Every fit of a joint by the measure that all of them have, and the chosen one by that which it was chosen by."""
    made = [p for p in context.catalogue.about(Prediction, joint=joint, role="identification") if p.model != CHOSEN]
    if not made:
        return
    names = list(dict.fromkeys((p.model, p.estimator) for p in made))
    rows = tuple(row(context, joint, [p for p in made if (p.model, p.estimator) == name]) for name in names)
    header = ("Fit", "Left out", "Relative error", "Path blocks left out, raw samples")
    caption = f"{title(joint)}: relative error of its fits where they were not fitted, in the worst log."
    table = Table(caption, header, rows, f"left-out-{joint}", "llrr")
    says = Prose(f"{MEASURES}{noise(context, joint)}")
    yield OnScreen(f"{title(joint)}: its fits where they were not fitted", f"all-left-out-{joint}", (says, table))


def row(context: Context, joint: str, of_fit: list[Prediction]) -> tuple[Cell, ...]:
    """One fit, by its worst log, and the same of the chosen one by blocks of path."""
    worst = max(of_fit, key=lambda p: p.relative_error)
    chosen = context.catalogue.about(Prediction, joint=joint, role="identification", model=CHOSEN)
    own = [p for p in chosen if p.estimator == f"{worst.model}.{worst.estimator}"]
    blocks: Cell = "–"
    if own:
        blocks = context.number(f"{max(own, key=lambda p: p.relative_error).prefix}.relative_error", 3)
    name = fit_name(worst.model, worst.estimator)
    which = LEFT_OUT.get(worst.scheme, worst.scheme.removeprefix("leave ").removesuffix(" out"))
    return f"**{name}**" if own else name, which, context.number(f"{worst.prefix}.relative_error", 3), blocks


def noise(context: Context, joint: str) -> str:
    """What of either error is noise, where periods tell."""
    logs = [average.log for average in context.catalogue.about(Average, joint=joint)]
    if not logs:
        return ""
    worst = max(logs, key=lambda log: context.results[f"noise.{log}.{joint}.relative_noise"].value)
    least = context.number(f"noise.{worst}.{joint}.relative_noise", 2)
    return (
        f" Noise alone makes {least} of either: what neither repeats nor is as slow as motion, which no model can lose."
    )
