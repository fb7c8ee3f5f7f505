"""What a log of pushes says of the tissue: each push with its contact, its lines and its loop."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.smoothing import lowpass
from davinci_forces.maths.tissue.indentation import NONE, TOO_EARLY, WHOLE, Indentation, all_of, found
from davinci_forces.maths.tissue.probing import Probing, moves, parts, turned, ways
from davinci_forces.maths.tissue.stiffness import StraightLine, slope, slope_error, straight, work

USUAL = 0.95  # quantile of the speeds of a push that stands for its usual one
DEEPEST = 0.3  # [m] beyond which a slip of the unit is the likelier reason
SOFTEST, STIFFEST = 1.0, 1e5  # [N/m]
COUNTS = 0.9  # R2 of a straight line
NAMED = 5


class Pushed(NamedTuple):
    """One push of n samples."""

    number: int
    t: Array  # (n,) [s]; NaN without a clock
    depth: Array  # (n,) [m]
    force: Array  # (n,) [N]
    rate: Array  # (n,) [m/s] of the depth; 0 without a clock
    place: Array  # (n, 3) [m]
    contact: Indentation
    line: StraightLine | None  # through all of the contact; None where there is none
    k_loading: float  # [N/m] slope of loading alone, NaN where it is too short
    k_unloading: float
    k_std_model: float  # [N/m] by the error of the force that a joint's model leaves

    @property
    def below(self) -> Array:
        """Depth below first contact (n,) [m], or below the least that is pressed where first contact is not known."""
        onset = self.contact.onset
        return self.depth - (onset if np.isfinite(onset) else self.depth[self.contact.inside].min())

    @property
    def lost(self) -> tuple[float, float]:
        """Energy [J] that is kept between first contact and last, and its share of the work of loading; NaN of a push
        that does not come back.

        The loop is closed where it ends, along the force there.
        """
        inside, loading = self.contact.inside, self.contact.loading
        if not np.isfinite(self.k_unloading):
            return float("nan"), float("nan")
        force = self.force - self.force[inside].min()
        into, out = (work(self.depth[part], force[part]) for part in (inside & loading, inside & ~loading))
        return into + out, (into + out) / into if into > 0 else float("nan")


def palpated(
    given: Probing, windows: Sequence[tuple[float, float]], everything: bool, rate: float, cutoff: float
) -> list[Pushed]:
    """Every push of a log, with its contact found, or stated by windows [s], or by `everything` being contact.

    `rate` [Hz] is that of the samples, 0 without a clock; rates of depth are low-passed at `cutoff` [Hz].
    """
    given = given if everything or windows else turned(given)
    pushes = parts(given, windows)
    reach = int(np.ceil(rate / (2 * cutoff)))
    numbers = _numbers(given, pushes)
    return [
        _pushed(given, part, number, way, bool(everything or windows), rate, cutoff, reach)
        for part, number, way in zip(pushes, numbers, ways(given, pushes), strict=True)
    ]


def _numbers(given: Probing, pushes: Sequence[slice]) -> list[int]:
    """The numbers that a log gives its pushes, or from 1 on where it gives none, or one to several."""
    numbers = [int(given.push[part][0]) for part in pushes]
    return numbers if len(set(numbers)) == len(numbers) > 1 else list(range(1, len(pushes) + 1))


def _pushed(
    given: Probing, part: slice, number: int, way: tuple[Array, Array], stated: bool, rate: float, cutoff: float,
    reach: int,
) -> Pushed:  # fmt: skip
    (depth, force), speed = way, given.speed[part]
    counted = moves(speed, float(np.quantile(np.abs(speed), USUAL)), reach)
    contact = all_of(depth, counted, WHOLE) if stated else found(depth, force, counted)
    d_rate = (
        np.gradient(lowpass(depth, rate, cutoff), given.t[part]) if rate and len(depth) > 1 else np.zeros(len(depth))
    )
    inside, loading = contact.inside, contact.loading
    line = straight(depth[inside], force[inside]) if contact.touched else None
    common = float(np.sqrt(np.mean(given.std[part][inside] ** 2))) if line else 0.0
    error = slope_error(depth[inside], common) if line else 0.0
    if line and line.k:  # a force that is wrong by this bends as much deeper, or less deep
        contact = contact._replace(onset_std=float(np.hypot(contact.onset_std, common / abs(line.k))))
    loaded, unloaded = (slope(depth[i], force[i]) for i in (inside & loading, inside & ~loading))
    place = given.place[part]
    return Pushed(number, given.t[part], depth, force, d_rate, place, contact, line, loaded, unloaded, error)


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
