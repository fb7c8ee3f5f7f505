"""What changed since an earlier report of the same study, or of another, that the study names as its baseline."""

from collections.abc import Iterator, Mapping, Sequence

from davinci_forces.report.changes import Change, Stated, changes
from davinci_forces.report.content import Block, Listing, Number, OnScreen, Prose, Section, Table, literal
from davinci_forces.report.context import Context, count
from davinci_forces.report.results import format_unit
from davinci_forces.report.sections.parts import listed

MOST = 300  # rows of a table; `davinci-forces compare` has them all


def section(context: Context) -> Section | None:
    """How many numbers changed, the largest changes, and the keys that came or went."""
    if context.baseline is None:
        return None
    now = {key: Stated(r.value, r.std, r.unit) for key, r in context.results.items()}
    return Section(
        "Since the baseline", "baseline", tuple(blocks(context, context.baseline, changes(context.baseline, now)))
    )


def blocks(context: Context, before: Mapping[str, Stated], found: Sequence[Change]) -> Iterator[Block]:
    """What there is to say."""
    changed = sorted((each for each in found if each.before and each.after), key=weight, reverse=True)
    came, went = [c.key for c in found if not c.before], [c.key for c in found if not c.after]
    shared = sum(key in context.results for key in before)
    yield Prose(
        f"Of the {count(shared, 'number')} that this report shares with its baseline, "
        f"`{literal(context.study.baseline)}`, {len(changed)} changed; {len(came)} came and {len(went)} went. A number "
        "has changed where it differs by more than two standard errors of the difference, $sqrt(s_a^2 + s_b^2)$; where "
        "neither states one, by more than $10^(-9)$ of it. Of recordings that share nothing, one number in twenty that "
        "has a standard error changes by chance."
    )
    if changed:
        yield from table(context, changed)
    for keys, what, anchor in ((came, "came", "baseline-came"), (went, "went", "baseline-went")):
        if keys:
            more = [f"and {len(keys) - MOST} more"] if len(keys) > MOST else []
            listed = Listing("\n".join([*keys[:MOST], *more]))
            yield OnScreen(f"{count(len(keys), 'key')} that {what}", anchor, (listed,))


def weight(change: Change) -> float:
    """How far a change stands out: its standard errors, or without any, more than all that have them."""
    return abs(change.z) if change.z is not None else float("inf")


def table(context: Context, changed: Sequence[Change]) -> Iterator[Block]:
    """The changes, the largest first; on screen where they are many."""
    rows = tuple(
        (literal(c.key), before_text(c), context.number(c.key), "–" if c.z is None else f"{c.z:+.1f}")
        for c in changed[:MOST]
    )
    said = f"The {MOST} largest of {len(changed)} changes" if len(changed) > MOST else count(len(changed), "change")
    whole = Table(
        f"{said} since the baseline, the largest first: a, b, and their difference over its standard error.",
        ("Number", "a, the baseline", "b, now", "Standard errors"), rows, "baseline-changes", "lrrr",
    )  # fmt: skip
    yield from listed(whole, "Changes since the baseline")


def before_text(change: Change) -> str:
    """A number of the baseline as it is printed."""
    stated = change.before
    assert stated
    shown = str(stated.value) if stated.number is None else Number(stated.number, format_unit(stated.unit), stated.std)
    return literal(str(shown))
