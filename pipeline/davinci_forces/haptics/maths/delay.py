"""The stiffest tissue for which a hand is stable: with a delayed force, a delayed and held force, or the whole loop.

In contact, m ddx + b dx + K_H x + K_T x(t - d) = 0.  A root reaches the imaginary axis, s = j w, where

    K_T = |m w^2 - K_H - j b w|   and   w d = arg(m w^2 - K_H + j b w) + 2 pi n.

The angle decreases from pi to 0 while w d increases, so that each n has one w.  The limit is the smallest K_T of all n:
below the limit no root crosses.  A computer samples x with period T and holds the resulting force, with a delay d.
With P(s) = 1 / (m s^2 + b s + K_H), z = exp(j w T) is then a root on the unit circle where

    K_T = -1 / sum_n P(s_n) (1 - exp(-s_n T)) / (s_n T) exp(-s_n d),   s_n = j (w + 2 pi n / T),

the sum over the images of the sampled position.

Both criteria apply to a hand that is pressed into tissue and stays in contact: above the limit, small motions about
this position grow.  Without a push the hand leaves the tissue in every period, and no delayed force acts there.

Other limits follow from the frequency response of the whole loop, or from simulations.  In the whole loop the felt
force is (G K_T + Z) x.  G(jw) contains arm, filter, link and hold, and is 1 if the hand feels the tissue directly.
Z(jw) [N/m] is what the hand feels of the arm's motion without tissue, because the filter's input is sampled.  The hand
in contact, m ddx + b dx + K_H x + (G K_T + Z) x = 0, has a root on the imaginary axis at each w for which

    K_T = (m w^2 - K_H - j b w - Z(jw)) / G(jw)

is real and positive; the limit is the smallest of these K_T.
"""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from davinci_forces.errors import BadRequest
from davinci_forces.haptics.maths.bimodal import Hand, mode
from davinci_forces.maths.arrays import Array

Complex = NDArray[np.complex128]

MAX_DELAY_SAMPLES = 1000  # with a longer delay, a held force is nearly continuous
POINTS_PER_SAMPLE = 40  # points on the unit circle, for each sample of delay and for each width of the resonance
MIN_CIRCLE_POINTS = 2000
IMAGES = np.arange(-20, 20)  # n of the images, in pairs at half the rate
RESPONSE_POINTS = 4000  # points of an interpolated frequency response
SUSTAINED_RATIO = 0.97  # an oscillation is sustained if the amplitude ratio of successive quarters is at least this
SEARCH_FACTOR = 64.0  # largest ratio of limit to first guess, and of guess to limit
SEARCH_STEP = 1.25  # ratio of successive trials: the first unstable one is sought, as stability may return beyond
TRIAL_HALVINGS, DAMPING_HALVINGS = 5, 40


def delay_limit(hand: Hand, delay: float) -> float:
    """The K_T [N/m] below which the hand in contact is stable, if the force is delayed by `delay` > 0 [s]."""
    peak = np.sqrt(max(hand.k / hand.m - 0.5 * (hand.b / hand.m) ** 2, 0.0))  # above this w, K_T increases with w
    limit, turn = np.inf, 0
    while True:
        w = crossing_frequency(hand, delay, turn)
        limit = min(limit, float(abs(complex(hand.m * w**2 - hand.k, -hand.b * w))))
        if w >= peak:
            return limit
        turn += 1


def crossing_frequency(hand: Hand, delay: float, turn: int) -> float:
    """The frequency [rad/s] at which a root crosses the imaginary axis, for the integer n = `turn`."""

    def excess(w: float) -> float:
        angle = np.arctan2(hand.b * w, hand.m * w**2 - hand.k)
        return float(w * delay - angle - 2.0 * np.pi * turn)

    return float(brentq(excess, 0.0, 2.0 * np.pi * (turn + 1) / delay, xtol=1e-14, rtol=1e-13))


def damping_needed(hand: Hand, k_t: float, limit: Callable[[Hand], float]) -> float:
    """The damping b [N s/m] of the hand from which `limit` [N/m] exceeds k_t > 0; that of the hand if it does already.

    A limit of NaN means no limit.
    """
    low = high = hand.b
    while limit(hand._replace(b=high)) < k_t:
        low, high = high, 2.0 * high
    for _ in range(DAMPING_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if limit(hand._replace(b=middle)) < k_t else (low, middle)
    return high


def sampled_limit(hand: Hand, delay: float, rate: float) -> float:
    """The K_T [N/m] below which the hand in contact is stable, if the force is held at `rate` [Hz] and delayed [s].

    Raises BadRequest if the delay has more than MAX_DELAY_SAMPLES samples.
    """
    if delay * rate > MAX_DELAY_SAMPLES:
        why = f"a delay of {delay:g} s is {delay * rate:.0f} samples of {rate:g} Hz, more than {MAX_DELAY_SAMPLES}"
        raise BadRequest(f"{why}; leave the rate out: the force is then nearly continuous")

    def root_stiffness(w: Array) -> Complex:
        p = 1j * (w + 2.0 * np.pi * rate * IMAGES[:, np.newaxis])
        held = -rate * np.expm1(-p / rate) / p * np.exp(-p * delay) / (hand.m * p**2 + hand.b * p + hand.k)
        return np.asarray(-1.0 / held.sum(axis=0))

    w = rate * unit_circle_angles(hand, rate, int(delay * rate))
    k_t = root_stiffness(w)
    _, below = lowest_crossing(k_t, w)
    near = np.linspace(below, w[w > below].min(initial=w[-1]), MIN_CIRCLE_POINTS)
    limits = lowest_crossing(root_stiffness(near), near)[0], float(k_t[-1].real)
    return min(limit for limit in limits if limit > 0.0)


def unit_circle_angles(hand: Hand, rate: float, samples: int) -> Array:
    """Angles in (0, pi], dense enough to separate the crossings, and densest around the hand's resonance."""
    even = np.linspace(0.0, np.pi, max(MIN_CIRCLE_POINTS, POINTS_PER_SAMPLE * (samples + 1)) + 1)[1:-1]
    width = 0.5 * hand.b / hand.m / rate
    swing = float(np.sqrt(max(hand.frequency**2 - (0.5 * hand.b / hand.m) ** 2, 0.0))) / rate
    near = swing + width / POINTS_PER_SAMPLE * np.arange(-10 * POINTS_PER_SAMPLE, 10 * POINTS_PER_SAMPLE + 1)
    folded = np.abs((near + np.pi) % (2.0 * np.pi) - np.pi)  # aliases of frequencies above half the rate
    low = np.geomspace(1e-6 * min(width, even[0]), even[0], MIN_CIRCLE_POINTS)
    return np.unique(np.concatenate([even, low, folded[(folded > 0.0) & (folded < np.pi)], [np.pi]]))


def zero_order_hold(hand: Hand, duration: float) -> tuple[Array, Array]:
    """The free hand's transition (2, 2), and its response (2,) to 1 N, over a duration [s]."""
    from scipy.signal import cont2discrete

    continuous = mode(hand, 0.0), np.array([[0.0], [1.0 / hand.m]]), np.eye(2), np.zeros((2, 1))
    Phi, Gamma, *_ = cont2discrete(continuous, duration)
    return Phi, Gamma[:, 0]


def harmonic(t: Array, x: Array, w: float) -> complex:
    """The complex amplitude of x (N,) at w [rad/s], over whole periods."""
    wave = np.exp(-1j * w * t)
    return complex(2.0 * np.mean((x - x.mean()) * (wave - wave.mean())))


def response_limit(hand: Hand, w: Array, G: Complex, Z: Complex) -> tuple[float, float]:
    """The K_T [N/m] below which a hand in contact is stable, and its w [rad/s], with G and Z (N,) [N/m] at w (N,).

    Both are NaN for no limit.  Between the frequencies, G and Z are interpolated by cubic splines over log w.
    """
    x = np.log(w)
    fine = np.linspace(x[0], x[-1], RESPONSE_POINTS)
    f = np.exp(fine)
    felt = hand.m * f**2 - hand.k - 1j * hand.b * f - CubicSpline(x, Z)(fine)
    return lowest_crossing(felt / CubicSpline(x, G)(fine), f)


def lowest_crossing(k_t: Complex, w: Array) -> tuple[float, float]:
    """The smallest positive real value of k_t (N,) between two w (N,), and its w; NaN for none."""
    i = np.flatnonzero(np.sign(k_t.imag[:-1]) * np.sign(k_t.imag[1:]) < 0)
    share = k_t.imag[i] / (k_t.imag[i] - k_t.imag[i + 1])
    limits = k_t.real[i] + share * (k_t.real[i + 1] - k_t.real[i])
    crossings = zip(limits[limits > 0.0].tolist(), w[i][limits > 0.0].tolist(), strict=True)
    return min(crossings, default=(math.nan, math.nan))


def formula(hand: Hand, w: float, G: complex, Z: complex) -> tuple[Hand, float, float]:
    """The hand, the delay [s] and the share of the force for which `delay_limit` / share is the limit at w [rad/s].

    Z adds to the hand's mass and damping.  The damping is not positive for a hand that oscillates without tissue.
    """
    moved = hand._replace(m=hand.m - Z.real / w**2, b=hand.b + Z.imag / w)
    return moved, float(-np.angle(G) % (2.0 * np.pi)) / w, abs(G)


def settles(x: Array, shift: float) -> bool:
    """Test whether a hand at x (N,) settles after a release that moves its rest position by `shift` [m].

    It settles if its motion in the last quarter is less than the shift, or if its motion decreases steadily.  The limit
    is not 0 because near rest the friction in the arm, and with it the felt force, may have any value.
    """
    parts = [float(np.ptp(part)) for part in np.array_split(x, 4)]
    return parts[-1] < shift or all(b < SUSTAINED_RATIO * a for a, b in pairwise(parts))


def max_stable(stable: Callable[[float], bool], guess: float) -> float:
    """The largest value for which `stable` is true; NaN if it is above 64 times the guess, or below 1/64 of it.

    The search goes outwards from the guess, to within 0.5 %.
    """
    low = high = guess
    if stable(guess):
        while stable(high := SEARCH_STEP * high):
            low = high
            if high >= SEARCH_FACTOR * guess:
                return math.nan
    else:
        while not stable(low := low / SEARCH_STEP):
            high = low
            if low <= guess / SEARCH_FACTOR:
                return math.nan
    for _ in range(TRIAL_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return math.sqrt(low * high)
