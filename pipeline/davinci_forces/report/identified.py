"""What the data tell of a joint's parameters: which move together, which are not seen, and what to record next."""

from collections.abc import Iterator

from davinci_forces.records import Identifiability
from davinci_forces.report.content import Block, Figure, Panel, Prose, Tiles, Verdict, literal
from davinci_forces.report.context import Context, title


def wanting(context: Context, joint: str) -> Iterator[Verdict]:
    """What the identification logs of a joint do not tell; nothing where nothing is wanting."""
    for told in context.catalogue.about(Identifiability, group=joint):
        said = [literal(text) for text in (*told.together, *told.not_seen)]
        if said:
            text = "; ".join(said)
            yield Verdict("info", f"{text[:1].upper()}{text[1:]}. {told.advice}.")


def correlations(context: Context, joint: str) -> Iterator[Block]:
    """The correlation matrix of a joint's parameters, and the condition of what they were found from."""
    for told in context.catalogue.about(Identifiability, group=joint):
        names = tuple(dict.fromkeys(map(str, told.parameter)))
        number = context.number(f"identifiability.{'.'.join(told.key)}.condition", 3)
        yield Prose(
            f"The columns of the regressor, scaled to one length, have the condition number {number}. What errors "
            "in the effort make of two parameters is correlated as the figure shows: where it is near 1 or −1, only "
            "a sum or a difference of the two is known well."
        )
        strongest = max((abs(r) for r, a, b in rows(told) if a != b), default=0.0)
        numbered = tuple(f"θ{i} {name}" for i, name in enumerate(names, start=1))
        yield Figure(
            f"{title(joint)}: correlation of the errors of its parameters (least squares).",
            f"A matrix of correlations between {', '.join(names)}: the strongest is {strongest:.2f}.",
            (Panel("", "", "", (Tiles(told.correlation, numbered),)),),
            f"correlation-{joint}",
            height=12.0 + 9.0 * len(names),
        )


def rows(told: Identifiability) -> Iterator[tuple[float, str, str]]:
    """Each correlation with the two parameters that it is of."""
    return zip(told.correlation.tolist(), map(str, told.parameter), map(str, told.beside), strict=True)
