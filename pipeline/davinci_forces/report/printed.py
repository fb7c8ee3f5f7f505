"""What was published of a joint's parameters beside what this study finds.  Tables 6.4-6.6"""

from collections.abc import Iterator
from dataclasses import replace

from davinci_forces.records import Fit
from davinci_forces.records.record import slug
from davinci_forces.report.content import Block, Bullets, Cell, Prose, Table
from davinci_forces.report.context import Context, estimator_name, title
from davinci_forces.report.results import format_unit
from davinci_forces.robots.robot import Printed

DIGITS = 3  # of a number that has no standard error


def printed_beside(context: Context, fit: Fit) -> Iterator[Block]:
    """The printed table of a joint, each column beside this study's own; none where nothing was printed of it."""
    joint = context.study.robot.joint(fit.group)
    printed = joint.printed
    if printed is None or joint.effort or any(len(c.theta) != len(fit.parameter) for c in printed.columns):
        return
    simulated = " The study is simulated: what it is made from, not the arm, is found here." * context.study.simulated
    yield Prose(
        f"{printed.name} of the thesis, with what this study finds: first guesses recomputed from the robot's masses "
        f"and lengths, and every estimator on this study's own periods.{simulated}"
    )
    yield table(context, fit, printed)
    yield Bullets(tuple(f"Misprint: {text[:1].lower()}{text[1:]}" for text in printed.misprints))


def table(context: Context, fit: Fit, printed: Printed) -> Table:
    """Parameters and mean squared error, printed and found."""
    header = ["Parameter", "Unit"]
    for column in printed.columns:
        header += [f"{estimator_name(column.estimator) or 'Guess'}, printed", "here"]
    rows: list[tuple[Cell, ...]] = []
    for i, name in enumerate((*map(str, fit.parameter), "mse")):
        last = i == len(fit.parameter)
        unit = f"{format_unit(fit.unit[i]) or '–'}" if not last else "–"
        pairs: list[Cell] = []
        for column in printed.columns:
            key = ".".join(
                ("fit", fit.group, fit.model, column.estimator) if column.estimator else ("guess", fit.group)
            )
            value = column.mse if last else column.theta[i]
            pairs += [f"{value:g}".replace("-", "−"), bare(context, f"{key}.{slug(name)}")]
        rows.append(("mean squared error" if last else name, unit, *pairs))
    caption = f"{title(fit.group)}: {printed.name} as printed, and as found here."
    return Table(caption, tuple(header), tuple(rows), f"printed-{fit.group}", "ll" + "r" * (len(header) - 2))


def bare(context: Context, key: str) -> Cell:
    """A number without its unit and its standard error, which the joint's own tables have."""
    number = context.number(key, DIGITS)
    return number if isinstance(number, str) else replace(number, unit="", std=None)
