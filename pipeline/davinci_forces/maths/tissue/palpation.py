"""What a log of pushes says of the tissue: each push with its contact, its lines and its loop.

A push is depths and forces along the way that it goes.  Where the log says no depth but where the tip is, a push goes
along the force that it meets, or where that is one number only, from where it is least to where it is most.  Forces and
depths are taken with the sign that makes depths grow into the tissue, both alike: the slope of one over the other stays
what the log says.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.signals.smoothing import lowpass, segments
from davinci_forces.maths.tissue import indentation
from davinci_forces.maths.tissue.indentation import NONE, TOO_EARLY, WHOLE, Indentation, StraightLine

RISES = 0.15  # of the range of what swings: a peak that stands out by less is none
AT_REST = 0.1  # of a usual speed
FEWEST = 4  # samples that say anything
ONE_SIDED = 2.0  # by how much further a force has to go to one side of its median to be pushing there
USUAL = 0.95  # quantile of the speeds of a push that stands for its usual one
DEEPEST = 0.3  # [m] beyond which a slip of the unit is the likelier reason
SOFTEST, STIFFEST = 1.0, 1e5  # [N/m]
COUNTS = 0.9  # R2 of a straight line
NAMED = 5


def between_troughs(x: Array, rises: float = RISES) -> list[slice]:
    """Each swing of a signal (N,) up and down again, from the lowest sample before its peak to the lowest after it.

    A peak is one that stands out by at least `rises` of the signal's range, but for the extreme 1 % of its samples; one
    at an end of the signal counts.
    """
    from scipy.signal import find_peaks

    low, high = np.quantile(x, [0.01, 0.99])
    if not high > low:
        return [slice(0, len(x))]
    padded = np.concatenate([[x.min()], x, [x.min()]])
    peaks = find_peaks(padded, prominence=rises * (high - low))[0] - 1
    troughs = [a + int(np.argmin(x[a : b + 1])) for a, b in pairwise(peaks)]
    return [slice(a, b) for a, b in pairwise([0, *troughs, len(x)]) if b > a]


class Probing(NamedTuple):
    """What a log of N samples says of pushes."""

    t: Array  # (N,) [s]; NaN without a clock
    push: Integers  # (N,) number of the push; one number throughout where they are not counted
    depth: Array  # (N, 1) [m], or (N, 3) the position of the tip
    force: Array  # (N, 1) [N], or (N, 3)
    place: Array  # (N, 3) [m] position of the tip; NaN where it is not known
    speed: Array  # (N,) of a joint whose effort is the force, which is not known at rest; NaN of a force sensor
    std: Array  # (N,) [N] standard deviation of the error that a model leaves in the force; 0 of a force sensor

    @property
    def size(self) -> Array:
        """How large the force is (N,): signed where it is one number."""
        return self.force[:, 0] if self.force.shape[1] == 1 else np.asarray(np.linalg.norm(self.force, axis=1))


def known(given: Probing) -> Probing:
    """The samples at which both depth and force are known."""
    whole = np.isfinite(given.depth).all(axis=1) & np.isfinite(given.force).all(axis=1)
    return given if whole.all() else Probing._make(column[whole] for column in given)


def moves(speed: Array, usual: float, reach: int) -> Booleans:
    """Whether the force is known at each sample (N,): a joint at rest meets any effort that friction can hold.

    It is at rest where it is slower than a tenth of its `usual` speed, and for the `reach` samples that a low-pass
    spreads that to either side.
    """
    from scipy.ndimage import maximum_filter1d

    rest = np.abs(speed) < AT_REST * usual
    return np.asarray(~maximum_filter1d(rest, 2 * reach + 1))


def turned(given: Probing) -> Probing:
    """The same with depths that grow into the tissue, where the log says them.

    Where it says where the tip is, a single force is taken with the sign that its larger excursions have.
    """
    counts = ~(np.abs(given.speed) < AT_REST * np.median(np.abs(given.speed)))
    if given.force.shape[1] > 1 or counts.sum() < FEWEST:
        return given
    depth, force = given.depth[counts], given.force[counts, 0]
    if depth.shape[1] > 1:
        low, middle, high = np.quantile(force, [0.01, 0.5, 0.99])
        return given._replace(force=-given.force) if middle - low > ONE_SIDED * (high - middle) else given
    sign = indentation.into_tissue(depth[:, 0], force)
    return given._replace(depth=sign * given.depth, force=sign * given.force)


def parts(given: Probing, windows: Sequence[tuple[float, float]]) -> list[slice]:
    """The pushes: those of the windows [s] where there are any, those that are counted, or those that are found."""
    if windows:
        bounds = [np.searchsorted(given.t, (start, np.nextafter(end, np.inf))) for start, end in sorted(windows)]
        return [slice(int(a), int(b)) for a, b in bounds if b > a]
    if np.any(given.push != given.push[0]):
        return list(segments(given.push))
    return between_troughs(given.depth[:, 0] if given.depth.shape[1] == 1 else given.size)


def ways(given: Probing, pushes: Sequence[slice]) -> list[tuple[Array, Array]]:
    """Depth [m] and force [N] of each push along the way that it goes, (n,) each.

    Whether a sensor gives the force on the tissue or that on the tool, the pushes of a log tell together.
    """
    gone = [_along(given, part) for part in pushes]
    if given.depth.shape[1] == 1 or given.force.shape[1] == 1:
        return gone
    rises = np.sum([np.sign(np.sum((d - d.mean()) * (f - f.mean()))) for d, f in gone])
    return gone if rises >= 0 else [(-d, f) for d, f in gone]


def _along(given: Probing, part: slice) -> tuple[Array, Array]:
    depth, force = given.depth[part], given.force[part]
    if force.shape[1] > 1:
        size = given.size[part]
        way = _unit((size - size.min()) @ force)
        return (depth - depth[0]) @ -way if depth.shape[1] > 1 else depth[:, 0], force @ way
    if depth.shape[1] > 1:
        least, most = int(np.argmin(force[:, 0])), int(np.argmax(force[:, 0]))
        return (depth - depth[0]) @ _unit(depth[most] - depth[least]), force[:, 0]
    return depth[:, 0], force[:, 0]


def _unit(vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else np.zeros_like(vector)


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
        into, out = (indentation.work(self.depth[part], force[part]) for part in (inside & loading, inside & ~loading))
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
    contact = indentation.all_of(depth, counted, WHOLE) if stated else indentation.found(depth, force, counted)
    d_rate = (
        np.gradient(lowpass(depth, rate, cutoff), given.t[part]) if rate and len(depth) > 1 else np.zeros(len(depth))
    )
    inside, loading = contact.inside, contact.loading
    line = indentation.straight(depth[inside], force[inside]) if contact.touched else None
    common = float(np.sqrt(np.mean(given.std[part][inside] ** 2))) if line else 0.0
    error = indentation.slope_error(depth[inside], common) if line else 0.0
    if line and line.k:  # a force that is wrong by this bends as much deeper, or less deep
        contact = contact._replace(onset_std=float(np.hypot(contact.onset_std, common / abs(line.k))))
    loaded, unloaded = (indentation.slope(depth[i], force[i]) for i in (inside & loading, inside & ~loading))
    place = given.place[part]
    return Pushed(number, given.t[part], depth, force, d_rate, place, contact, line, loaded, unloaded, error)


def remarks(pushes: Sequence[Pushed]) -> Iterator[str]:
    """What a reviewer should know of the pushes of one log, each remark once."""
    touched = [(push, push.line) for push in pushes if push.line is not None]
    yield from _contact(pushes, touched)
    if not touched:
        return
    yield from _units(touched)
    falling = [(push, line.k) for push, line in touched if line.k < 0 and line.r2 > COUNTS]
    if falling:
        which, worst = _which([push for push, _ in falling], pushes), min(k for _, k in falling)
        yield (
            f"{which}: the force falls as the depth grows, by up to {-worst:.4g} N/m, as no "
            "tissue has it; write sign = -1 for the channel of the depth or for that of the force"
        )
    if not (best := max(line.r2 for _, line in touched)) > COUNTS:
        yield (
            f"no push counts: a straight line explains at most {best:.0%} of the force of one, and {COUNTS:.0%} are "
            "needed; push slower or deeper, or look for what else the force holds"
        )


def _contact(pushes: Sequence[Pushed], touched: Sequence[tuple[Pushed, StraightLine]]) -> Iterator[str]:
    free = [push for push in pushes if push.contact.state == NONE]
    if not touched:
        largest = max(float(np.ptp(push.force)) for push in pushes)
        yield (
            f"no contact is found in {_count(len(pushes))}: the force changes by {largest:.3g} N at most, and not as "
            'the depth does; check both channels, or state contact = [[start, end]] or contact = "all"'
        )
    elif free and not any(push.contact.onset == push.contact.onset for push, _ in touched):
        yield f"{_which(free, pushes)} of {_count(len(pushes))} without contact"
    early = [push for push, _ in touched if push.contact.state == TOO_EARLY]
    if early:
        yield (
            f"{_which(early, pushes)}: contact from the first sample, so where it begins is not known and all of it is "
            'taken as contact; begin before contact, or say contact = "all"'
        )


def _units(touched: Sequence[tuple[Pushed, StraightLine]]) -> Iterator[str]:
    deep = float(np.median([np.ptp(push.depth[push.contact.inside]) for push, _ in touched]))
    k = float(np.median([abs(line.k) for _, line in touched]))
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
