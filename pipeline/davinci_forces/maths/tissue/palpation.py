"""The pushes of a log into tissue: the contact, the straight lines and the hysteresis loop of each push.

A push consists of depths and forces along its direction.  If the log has the position of the tip instead of a depth,
the direction is that of the force.  For a force of one number, it points from the least force to the largest.  Depth
and force change sign together so that depths grow into the tissue: the slope stays that of the log.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.signals.smoothing import lowpass, segments
from davinci_forces.maths.tissue import indentation
from davinci_forces.maths.tissue.indentation import NONE, TOO_EARLY, Indentation, StraightLine

MIN_PROMINENCE = 0.15  # least prominence of a peak, as a share of the signal's range
MAX_REST_SPEED = 0.1  # a joint is at rest below this share of its usual speed
MIN_SAMPLES_SIGN = 4  # fewer samples do not determine the sign of depth or force
MIN_RATIO_SIDES = 2.0  # the side of the median with this many times larger excursions is pushing
USUAL_SPEED_QUANTILE = 0.95  # quantile of the speeds of a push that is its usual speed
MAX_DEPTH = 0.3  # [m] the unit of a larger depth is probably wrong
MIN_STIFFNESS, MAX_STIFFNESS = 1.0, 1e5  # [N/m]
MIN_EXPLAINED = 0.9  # smallest share of its force, beyond noise, that a straight line explains of a push that counts
MIN_EARLY_RISE = 0.05  # share of the force within the first quarter of the depth, if a push touches from its start
MAX_NAMED = 5  # largest number of pushes that a remark names


def between_troughs(x: Array) -> list[slice]:
    """Split a signal (N,) into swings, each from the lowest sample before a peak to the lowest after it.

    A peak's prominence is a share of the range without the extreme 1 % of samples; a peak at an end counts.
    """
    from scipy.signal import find_peaks

    low, high = np.quantile(x, [0.01, 0.99])
    if not high > low:
        return [slice(0, len(x))]
    padded = np.concatenate([[x.min()], x, [x.min()]])
    peaks = find_peaks(padded, prominence=MIN_PROMINENCE * (high - low))[0] - 1
    troughs = [a + int(np.argmin(x[a : b + 1])) for a, b in pairwise(peaks)]
    return [slice(a, b) for a, b in pairwise([0, *troughs, len(x)]) if b > a]


def touches_at_once(pushes: Sequence[tuple[Array, Array]]) -> bool:
    """Whether the force (N,) of most pushes rises with the depth (N,) from the first sample on, without an approach."""
    return bool(pushes) and float(np.median([_early_rise(*push) for push in pushes])) >= MIN_EARLY_RISE


def _early_rise(depth: Array, force: Array) -> float:
    """Rise of the force within the first quarter of a push's depth, as a share of its whole rise."""
    deepest = int(np.argmax(np.abs(depth - depth[0])))
    way = np.abs(depth[: deepest + 1] - depth[0])
    if deepest < MIN_SAMPLES_SIGN or not way[-1] > 0:
        return 0.0
    quarter, whole = np.interp(way[-1] / 4, way, force[: deepest + 1]) - force[0], force[deepest] - force[0]
    return float(quarter / whole) if whole else 0.0


class Probing(NamedTuple):
    """The samples (N,) of a log of pushes."""

    t: Array  # (N,) [s]; NaN without a clock
    push: Integers  # (N,) number of the push; one number throughout if pushes are not numbered
    depth: Array  # (N, 1) [m], or (N, 3) the position of the tip
    force: Array  # (N, 1) [N], or (N, 3)
    place: Array  # (N, 3) [m] position of the tip; NaN where it is not known
    speed: Array  # (N,) of a joint whose effort is the force; at rest that is not known; NaN with a force sensor
    std: Array  # (N,) [N] standard deviation of a model's error in the force; 0 with a force sensor

    @property
    def size(self) -> Array:
        """Magnitude of the force (N,), signed if it is one number."""
        return self.force[:, 0] if self.force.shape[1] == 1 else np.asarray(np.linalg.norm(self.force, axis=1))


def known_samples(probing: Probing) -> Probing:
    """Keep the samples at which both depth and force are finite."""
    whole = np.isfinite(probing.depth).all(axis=1) & np.isfinite(probing.force).all(axis=1)
    return probing if whole.all() else Probing._make(column[whole] for column in probing)


def moves(speed: Array, usual: float, reach: int) -> Booleans:
    """Whether the force is known at each sample (N,): at rest, friction hides any effort up to its Coulomb level.

    A joint is at rest below a tenth of its `usual` speed, and `reach` samples around, over which a low-pass spreads it.
    """
    from scipy.ndimage import maximum_filter1d

    at_rest = np.abs(speed) < MAX_REST_SPEED * usual
    return np.asarray(~maximum_filter1d(at_rest, 2 * reach + 1))


def orient_into_tissue(probing: Probing) -> Probing:
    """Choose the sign of depth and force so that the depths of the log grow into the tissue.

    In a log with positions of the tip, a single force gets the sign of its larger excursions.
    """
    counts = ~(np.abs(probing.speed) < MAX_REST_SPEED * np.median(np.abs(probing.speed)))
    if probing.force.shape[1] > 1 or counts.sum() < MIN_SAMPLES_SIGN:
        return probing
    depth, force = probing.depth[counts], probing.force[counts, 0]
    if depth.shape[1] > 1:
        low, middle, high = np.quantile(force, [0.01, 0.5, 0.99])
        return probing._replace(force=-probing.force) if middle - low > MIN_RATIO_SIDES * (high - middle) else probing
    inwards, outwards = (indentation.hinge(sign * depth[:, 0], force).squares for sign in (1.0, -1.0))
    if outwards * indentation.MIN_RATIO_BEND < inwards:  # the force clearly bends as depths shrink
        return probing._replace(depth=-probing.depth, force=-probing.force)
    return probing


def parts(probing: Probing, windows: Sequence[tuple[float, float]]) -> list[slice]:
    """Split a log into pushes: by the windows [s] if there are any, by the push numbers, or by the swings of depth."""
    if windows:
        bounds = [np.searchsorted(probing.t, (start, np.nextafter(end, np.inf))) for start, end in sorted(windows)]
        return [slice(int(a), int(b)) for a, b in bounds if b > a]
    if np.any(probing.push != probing.push[0]):
        return segments(probing.push)
    return between_troughs(probing.depth[:, 0] if probing.depth.shape[1] == 1 else probing.size)


def ways(probing: Probing, pushes: Sequence[slice]) -> list[tuple[Array, Array]]:
    """Depth [m] and force [N] of each push along its direction, (n,) each.

    All pushes of a log together decide whether a sensor gives the force on the tissue or that on the tool.
    """
    tracks = [_along(probing, part) for part in pushes]
    if probing.depth.shape[1] == 1 or probing.force.shape[1] == 1:
        return tracks
    rises = np.sum([np.sign(np.sum((d - d.mean()) * (f - f.mean()))) for d, f in tracks])
    return tracks if rises >= 0 else [(-d, f) for d, f in tracks]


def _along(probing: Probing, part: slice) -> tuple[Array, Array]:
    depth, force = probing.depth[part], probing.force[part]
    if force.shape[1] > 1:
        size = probing.size[part]
        way = _unit((size - size.min()) @ force)
        return (depth - depth[0]) @ -way if depth.shape[1] > 1 else depth[:, 0], force @ way
    if depth.shape[1] > 1:
        least, most = int(np.argmin(force[:, 0])), int(np.argmax(force[:, 0]))
        return (depth - depth[0]) @ _unit(depth[most] - depth[least]), force[:, 0]
    return depth[:, 0], force[:, 0]


def _unit(vector: Array) -> Array:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0 else np.zeros_like(vector)


class PalpatedPush(NamedTuple):
    """One push of n samples."""

    number: int
    t: Array  # (n,) [s]; NaN without a clock
    depth: Array  # (n,) [m]
    force: Array  # (n,) [N]
    rate: Array  # (n,) [m/s] of the depth; 0 without a clock
    place: Array  # (n, 3) [m]
    contact: Indentation
    line: StraightLine | None  # through all of the contact; None without contact
    k_loading: float  # [N/m] slope of loading alone; NaN if loading is too short
    k_loading_std: float
    k_unloading: float
    k_unloading_std: float
    k_t_std_model: float  # [N/m] by the error of a joint's model in the force
    explained: float  # share of the force in contact, beyond its noise, that the line explains; NaN without contact

    @property
    def depth_in_contact(self) -> Array:
        """Depth below first contact (n,) [m], or below the least depth in contact if first contact is not known."""
        onset = self.contact.onset_depth
        return self.depth - (onset if np.isfinite(onset) else self.depth[self.contact.inside].min())

    @property
    def dissipated_energy(self) -> tuple[float, float]:
        """Energy [J] dissipated between first and last contact, and its share of the work of loading.

        The loop is closed along the force at its end.  NaN for a push without unloading.
        """
        inside, loading = self.contact.inside, self.contact.loading
        if not np.isfinite(self.k_unloading):
            return float("nan"), float("nan")
        force = self.force - self.force[inside].min()
        ways = inside & loading, inside & ~loading
        into, out = (float(np.trapezoid(force[way], self.depth[way])) for way in ways)
        return into + out, (into + out) / into if into > 0 else float("nan")


def evaluate_pushes(
    probing: Probing, windows: Sequence[tuple[float, float]], everything: bool, rate: float, cutoff: float
) -> list[PalpatedPush]:
    """Evaluate every push of a log, with its contact detected, stated by windows [s], or all of it with `everything`.

    `rate` [Hz] is the sampling rate, 0 without a clock; rates of depth are low-passed at `cutoff` [Hz].
    """
    probing = probing if everything or windows else orient_into_tissue(probing)
    pushes = parts(probing, windows)
    numbers = _numbers(probing, pushes)
    return [
        _pushed(probing, part, number, way, bool(everything or windows), rate, cutoff)
        for part, number, way in zip(pushes, numbers, ways(probing, pushes), strict=True)
    ]


def _numbers(probing: Probing, pushes: Sequence[slice]) -> list[int]:
    """The numbers of the pushes in the log, or 1, 2, ... if the log has no numbers or repeats one."""
    numbers = [int(probing.push[part][0]) for part in pushes]
    return numbers if len(set(numbers)) == len(numbers) > 1 else list(range(1, len(pushes) + 1))


def _pushed(
    probing: Probing, part: slice, number: int, way: tuple[Array, Array], stated: bool, rate: float, cutoff: float
) -> PalpatedPush:
    (depth, force), speed = way, probing.speed[part]
    usual, spacing = float(np.quantile(np.abs(speed), USUAL_SPEED_QUANTILE)), int(np.ceil(rate / (2 * cutoff)))
    counted = moves(speed, usual, spacing)
    contact = indentation.all_of(depth, counted) if stated else indentation.find_contact(depth, force, counted)
    d_rate = np.zeros(len(depth))
    if rate and len(depth) > 1:
        d_rate = np.gradient(lowpass(depth, rate, cutoff), probing.t[part])
    inside, loading = contact.inside, contact.loading
    line = indentation.straight(depth[inside], force[inside]) if contact.state != NONE else None
    common = float(np.sqrt(np.mean(probing.std[part][inside] ** 2))) if line else 0.0
    error = indentation.slope_error(depth[inside], common) if line else 0.0
    if line and line.k:  # an error of the force, over the stiffness, moves the onset
        contact = contact._replace(onset_depth_std=float(np.hypot(contact.onset_depth_std, common / abs(line.k))))
    ways = (inside & loading, inside & ~loading)
    loaded, unloaded = (indentation.slope_with_std(depth[way], force[way], common) for way in ways)
    place, t = probing.place[part], probing.t[part]
    explained = explained_share(depth[inside], force[inside], line, max(spacing, 1)) if line else float("nan")
    return PalpatedPush(number, t, depth, force, d_rate, place, contact, line, *loaded, *unloaded, error, explained)


def explained_share(depth: Array, force: Array, line: StraightLine, spacing: int) -> float:
    """The share of a force (N,) at depths (N,), in order of time, that a line explains, noise apart.

    Noise is what changes from one sample to the next, `spacing` apart: a sixth of the squared second difference of what
    the line leaves.  It says nothing about how straight the force is.  A force that is mostly noise tells nothing: 0.
    """
    residual = force - line.c - line.k * depth
    second = residual[2 * spacing :] - 2.0 * residual[spacing:-spacing] + residual[: -2 * spacing]
    unexplained, whole = float(np.mean(residual**2)), float(np.var(force))
    noise = min(float(np.mean(second**2)) / 6.0, unexplained) if len(second) else 0.0
    return 1.0 - (unexplained - noise) / (whole - noise) if whole > 2.0 * noise else 0.0


def remarks(pushes: Sequence[PalpatedPush]) -> Iterator[str]:
    """Diagnostics of the pushes of one log, each once."""
    touched = [(push, push.line) for push in pushes if push.line is not None]
    yield from _contact(pushes, touched)
    if not touched:
        return
    yield from _units(touched)
    falling = [(push, line.k) for push, line in touched if line.k < 0 and push.explained > MIN_EXPLAINED]
    if falling:
        which, worst = _which([push for push, _ in falling], pushes), min(k for _, k in falling)
        remedy = "write sign = -1 for the channel of the depth or of the force"
        yield f"{which}: the force falls as the depth grows, by up to {-worst:.4g} N/m, which no tissue does; {remedy}"
    if not (best := max(push.explained for push, _ in touched)) > MIN_EXPLAINED:
        share = f"at most {best:.0%} of its force beyond noise, and {MIN_EXPLAINED:.0%} are needed"
        remedy = "push slower or deeper, or check what else the force contains"
        yield f"no push counts: a straight line explains {share}; {remedy}"


def _contact(pushes: Sequence[PalpatedPush], touched: Sequence[tuple[PalpatedPush, StraightLine]]) -> Iterator[str]:
    free = [push for push in pushes if push.contact.state == NONE]
    if not touched:
        largest = max(float(np.ptp(push.force)) for push in pushes)
        why = f"the force changes by {largest:.3g} N at most and does not follow the depth"
        remedy = 'check both channels, or state contact = [[start, end]] or contact = "all"'
        yield f"no contact is found in {_count(len(pushes))}: {why}; {remedy}"
    elif free and np.isnan([push.contact.onset_depth for push, _ in touched]).all():
        yield f"{_which(free, pushes)} of {_count(len(pushes))} without contact"
    early = [push for push, _ in touched if push.contact.state == TOO_EARLY]
    if early:
        what = "contact from the first sample, so where it begins is not known and every sample counts as contact"
        yield f'{_which(early, pushes)}: {what}; begin before contact, or state contact = "all"'


def _units(touched: Sequence[tuple[PalpatedPush, StraightLine]]) -> Iterator[str]:
    deep = float(np.median([np.ptp(push.depth[push.contact.inside]) for push, _ in touched]))
    k = float(np.median([abs(line.k) for _, line in touched]))
    doubt = "no tissue does so, so the depth is probably"
    if deep > MAX_DEPTH or k < MIN_STIFFNESS:
        remedy = 'write unit = "mm" for its channel, or check the unit of the force'
        yield f"pushes are {deep:.3g} m deep and meet {k:.3g} N/m: {doubt} in mm, not in m; {remedy}"
    elif k > MAX_STIFFNESS:
        remedy = "correct the unit of its channel, or check that of the force"
        yield f"pushes are {1e3 * deep:.3g} mm deep and meet {k:.3g} N/m: {doubt} in m, not in mm; {remedy}"


def _which(some: Sequence[PalpatedPush], pushes: Sequence[PalpatedPush]) -> str:
    if len(some) == len(pushes) > 1:
        return f"all {_count(len(pushes))}"
    names = ", ".join(str(push.number) for push in some[:MAX_NAMED])
    more = f" and {len(some) - MAX_NAMED} more" if len(some) > MAX_NAMED else ""
    return f"push{'es' if len(some) > 1 else ''} {names}{more}"


def _count(number: int) -> str:
    return f"{number} push{'es' if number > 1 else ''}"
