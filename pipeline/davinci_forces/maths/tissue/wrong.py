"""What is wrong with pushes, in words: no contact, none free of it, a unit or a sign that cannot be right."""

from collections.abc import Iterator, Sequence

import numpy as np

from davinci_forces.maths.tissue.indentation import NONE, TOO_EARLY
from davinci_forces.maths.tissue.palpation import Pushed

DEEPEST = 0.3  # [m] beyond which a slip of the unit is the likelier reason
SOFTEST, STIFFEST = 1.0, 1e5  # [N/m]
COUNTS = 0.9  # R2 of a straight line
NAMED = 5


def remarks(pushes: Sequence[Pushed]) -> Iterator[str]:
    """What a reviewer should know of the pushes of one log, each remark once."""
    touched = [push for push in pushes if push.line is not None]
    yield from _contact(pushes, touched)
    if not touched:
        return
    yield from _units(touched)
    falling = [push for push in touched if push.line is not None and push.line.k < 0 and push.line.r2 > COUNTS]
    if falling:
        worst = min(push.line.k for push in falling if push.line is not None)
        yield (
            f"{_which(falling, pushes)}: the force falls as the depth grows, by up to {-worst:.4g} N/m, as no "
            "tissue has it; write sign = -1 for the channel of the depth or for that of the force"
        )
    if not any(push.line is not None and push.line.r2 > COUNTS for push in touched):
        best = max(push.line.r2 for push in touched if push.line is not None)
        yield (
            f"no push counts: a straight line explains at most {best:.0%} of the force of one, and {COUNTS:.0%} are "
            "needed; push slower or deeper, or look for what else the force holds"
        )


def _contact(pushes: Sequence[Pushed], touched: Sequence[Pushed]) -> Iterator[str]:
    free = [push for push in pushes if push.contact.state == NONE]
    if not touched:
        largest = max(float(np.ptp(push.force)) for push in pushes)
        yield (
            f"no contact is found in {_count(len(pushes))}: the force changes by {largest:.3g} N at most, and not as "
            'the depth does; check both channels, or state contact = [[start, end]] or contact = "all"'
        )
    elif free and not any(push.contact.onset == push.contact.onset for push in touched):
        yield f"{_which(free, pushes)} of {_count(len(pushes))} without contact"
    early = [push for push in touched if push.contact.state == TOO_EARLY]
    if early:
        yield (
            f"{_which(early, pushes)}: contact from the first sample, so where it begins is not known and all of it is "
            'taken as contact; begin before contact, or say contact = "all"'
        )


def _units(touched: Sequence[Pushed]) -> Iterator[str]:
    deep = float(np.median([np.ptp(push.depth[push.contact.inside]) for push in touched]))
    k = float(np.median([abs(push.line.k) for push in touched if push.line is not None]))
    if deep > DEEPEST or k < SOFTEST:
        yield (
            f"pushes are {deep:.3g} m deep and meet {k:.3g} N/m: no tissue does so, and the depth is likelier to be in "
            'mm than in m; say unit = "mm" for its channel, or look at the unit of the force'
        )
    elif k > STIFFEST:
        yield (
            f"pushes are {1e3 * deep:.3g} mm deep and meet {k:.3g} N/m: no tissue does so, and the depth is likelier "
            "to be in m than in mm; correct the unit of its channel, or look at that of the force"
        )


def _which(some: Sequence[Pushed], pushes: Sequence[Pushed]) -> str:
    if len(some) == len(pushes) > 1:
        return f"all {_count(len(pushes))}"
    named = ", ".join(str(push.number) for push in some[:NAMED])
    return f"push{'es' if len(some) > 1 else ''} {named}{f' and {len(some) - NAMED} more' if len(some) > NAMED else ''}"


def _count(number: int) -> str:
    return f"{number} push{'es' if number > 1 else ''}"
