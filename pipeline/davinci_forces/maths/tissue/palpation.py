"""What a log of pushes says of the tissue: each push with its contact, its lines and its loop."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.smoothing import lowpass
from davinci_forces.maths.tissue.indentation import WHOLE, Indentation, all_of, found
from davinci_forces.maths.tissue.probing import Probing, moves, parts, turned, ways
from davinci_forces.maths.tissue.stiffness import StraightLine, slope, slope_error, straight, work

USUAL = 0.95  # quantile of the speeds of a push that stands for its usual one


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
