"""The stiffest tissue that a hand is stable against when its force comes late, or late and held.

In contact, m ddx + b dx + K_H x + K_T x(t - d) = 0.  A root reaches the imaginary axis, s = j w, where

    K_T = |m w^2 - K_H - j b w|   and   w d = arg(m w^2 - K_H + j b w) + 2 pi n.

The angle falls from pi to 0 while w d rises, so that each n has one w; the smallest K_T of all is the limit, below
which no root ever crosses.  A computer that reads x once in T and holds the force that it makes of it, d later, is the
same on the unit circle, z = exp(j w T), with the hand's exact response to a held force.

Both are criteria of the hand that is pressed into tissue and stays in contact, which small motions about a steady push
do: beyond the limit they grow.  A hand that nothing pushes leaves the tissue at every turn, where no force is late.

Other limits follow from the response of the whole loop, or are tried out.  Between the force that the tissue would
exert where the hand is, K_T x + D dx, and the one that is felt lies that response T(jw): arm, filter, link and what
holds the force.  It is 1 where the hand feels the tissue itself.  The hand in contact,

    m ddx + b dx + K_H x + T (K_T x + D dx) = 0,

has a root on the imaginary axis where

    K_T = (m w^2 - K_H - j b w) / T(jw) - j D w

is real and positive; the smallest is the limit.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

from davinci_forces.errors import BadRequest
from davinci_forces.haptics.maths.bimodal import Hand, mode
from davinci_forces.maths.arrays import Array

Complex = NDArray[np.complex128]

MOST_SAMPLES = 1000  # of delay, beyond which the held force is as good as continuous
EACH_TURN = 40  # places of the unit circle that each sample of delay, and each width of the resonance, is looked at by
FEWEST = 2000  # of such places
FINE = 4000  # places between the frequencies at which a response is known
SHRINKS = 0.97  # of a swing over a quarter of the time, from which it counts as lasting
WIDEST = 64.0  # times a first guess, as far as a limit is looked for
HALVINGS = 7


def delay_limit(hand: Hand, delay: float) -> float:
    """The K_T [N/m] below which the hand in contact is stable, force `delay` > 0 [s] late."""
    peak = np.sqrt(max(hand.k / hand.m - 0.5 * (hand.b / hand.m) ** 2, 0.0))  # beyond which stiffness grows with w
    limit, turn = np.inf, 0
    while True:
        w = crossing(hand, delay, turn)
        limit = min(limit, float(abs(complex(hand.m * w**2 - hand.k, -hand.b * w))))
        if w >= peak:
            return limit
        turn += 1


def crossing(hand: Hand, delay: float, turn: int) -> float:
    """The frequency [rad/s] at which a root crosses after so many whole turns."""

    def excess(w: float) -> float:
        angle = np.arctan2(hand.b * w, hand.m * w**2 - hand.k)
        return float(w * delay - angle - 2.0 * np.pi * turn)

    return float(brentq(excess, 0.0, 2.0 * np.pi * (turn + 1) / delay, xtol=1e-14, rtol=1e-13))


def damping_needed(hand: Hand, k_t: float, delay: float) -> float:
    """The damping b [N s/m] that the hand would need for tissue of k_t > 0 [N/m], force `delay` > 0 [s] late."""

    def lacking(exponent: float) -> float:
        return float(np.log(k_t / delay_limit(hand._replace(b=float(np.exp(exponent))), delay)))

    high = np.log(k_t * delay)  # enough of it for small delays, where K_T = b/d
    while lacking(high) > 0.0:
        high += 1.0
    low = high
    while lacking(low) < 0.0:
        low -= 1.0
    return float(np.exp(brentq(lacking, low, high, xtol=1e-10)))


def sampled_limit(hand: Hand, delay: float, rate: float) -> float:
    """The K_T [N/m] below which the hand in contact is stable, its force held at `rate` [Hz] and `delay` [s] late.

    Raises
    ------
    BadRequest
        If the delay is more samples than can be gone through.
    """
    if delay * rate > MOST_SAMPLES:
        said = f"a delay of {delay:g} s is {delay * rate:.0f} samples of {rate:g} Hz, and at most {MOST_SAMPLES} can be"
        raise BadRequest(f"{said} gone through; leave the rate out: the force is then as good as continuous")
    Phi, early, late, samples = discretised(hand, delay, rate)

    def needed(theta: Array) -> Complex:
        """The complex K_T for which z = exp(j theta) is a root."""
        z = np.exp(1j * theta)
        determinant = z**2 - np.trace(Phi) * z + np.linalg.det(Phi)
        force = response(Phi, early, z) + response(Phi, late, z) / z
        return np.asarray(-determinant * z**samples / force)

    theta = circle(hand, rate, samples)
    imaginary = needed(theta).imag
    crossings = np.flatnonzero(np.sign(imaginary[:-1]) * np.sign(imaginary[1:]) < 0)
    roots = [
        brentq(lambda angle: float(needed(np.array([angle])).imag[0]), theta[i], theta[i + 1], rtol=1e-13)
        for i in crossings.tolist()
    ]
    stiffness = needed(np.array([*roots, np.pi])).real
    return float(stiffness[stiffness > 0.0].min())


def response(Phi: Array, column: Array, z: Complex) -> Complex:
    """The first row of adj(z I - Phi) times a column (2,), at places z (N,): the numerator of a position."""
    return np.asarray((z - Phi[1, 1]) * column[0] + Phi[0, 1] * column[1])


def circle(hand: Hand, rate: float, samples: int) -> Array:
    """Angles in (0, pi) that are close enough to part the crossings, closest about the hand's resonance."""
    even = np.linspace(0.0, np.pi, max(FEWEST, EACH_TURN * (samples + 1)) + 1)[1:-1]
    width = 0.5 * hand.b / hand.m / rate
    swing = float(np.sqrt(max(hand.frequency**2 - (0.5 * hand.b / hand.m) ** 2, 0.0))) / rate
    near = swing + width / EACH_TURN * np.arange(-10 * EACH_TURN, 10 * EACH_TURN + 1)
    folded = np.abs((near + np.pi) % (2.0 * np.pi) - np.pi)  # what is faster than half the rate looks slower
    low = np.geomspace(1e-6 * min(width, even[0]), even[0], FEWEST)
    return np.unique(np.concatenate([even, low, folded[(folded > 0.0) & (folded < np.pi)]]))


def discretised(hand: Hand, delay: float, rate: float) -> tuple[Array, Array, Array, int]:
    """What a held force does to the free hand over one sample, exactly.

    x_(k+1) = Phi x_k + early u_(k-n) + late u_(k-n-1), where u = -K_T x is the tissue's force at a sample, n the whole
    samples of delay: the force of the sample before acts until the rest of the delay is over.
    """
    period = 1.0 / rate
    samples = int(delay * rate + 1e-9)
    rest = max(delay - samples * period, 0.0)
    Phi, whole = held(hand, period)
    _, early = held(hand, period - rest)
    return Phi, early, whole - early, samples


def held(hand: Hand, duration: float) -> tuple[Array, Array]:
    """The free hand's transition (2, 2) and what a force of 1 N does to it (2,) within a duration [s]."""
    block = np.zeros((3, 3))
    block[:2, :2] = mode(hand, 0.0)
    block[1, 2] = 1.0 / hand.m
    moved = np.asarray(expm(block * duration))
    return moved[:2, :2], moved[:2, 2]


def harmonic(t: Array, x: Array, w: float) -> complex:
    """The amplitude of x (N,) at w [rad/s], over whole turns of it."""
    wave = np.exp(-1j * w * t)
    return complex(2.0 * np.mean((x - x.mean()) * (wave - wave.mean())))


def response_limit(hand: Hand, w: Array, T: Complex, damping: float) -> float:
    """The K_T [N/m] below which a hand in contact is stable with a response T (N,) at w (N,) [rad/s]; NaN for none.

    `damping` is the tissue's D [N s/m], times what scales the force.

    Between the frequencies, size and angle of the response are taken to change evenly over log w.
    """
    x = np.log(w)
    fine = np.linspace(x[0], x[-1], FINE)
    size, angle = np.interp(fine, x, np.log(np.abs(T))), np.interp(fine, x, np.unwrap(np.angle(T)))
    f = np.exp(fine)
    needed = (hand.m * f**2 - hand.k - 1j * hand.b * f) / np.exp(size + 1j * angle) - 1j * damping * f
    i = np.flatnonzero(np.sign(needed.imag[:-1]) * np.sign(needed.imag[1:]) < 0)
    share = needed.imag[i] / (needed.imag[i] - needed.imag[i + 1])
    crossed = needed.real[i] + share * (needed.real[i + 1] - needed.real[i])
    return float(min(crossed[crossed > 0.0], default=math.nan))


def settles(x: Array, shift: float) -> bool:
    """Whether a hand x (N,) that was let go of, to rest a `shift` [m] away, settles.

    It does where its last quarter swings less than that shift, because an arm that rubs never lets it rest altogether:
    near rest friction takes any value, and so does what is felt; or where it swings ever less.
    """
    first, _, before, last = (float(np.ptp(part)) for part in np.array_split(x, 4))
    return bool(last < shift or (last < SHRINKS**3 * first and last < SHRINKS * before))


def largest(stable: Callable[[float], bool], guess: float) -> float:
    """The value up to which something is stable, by trying it: NaN where 64 times the guess still is, or a 64th not.

    It is looked for from the guess outwards, and is known to a half of a hundredth.
    """
    low = high = guess
    if stable(guess):
        while stable(high := 2.0 * high):
            low = high
            if high >= WIDEST * guess:
                return math.nan
    else:
        while not stable(low := 0.5 * low):
            high = low
            if low <= guess / WIDEST:
                return math.nan
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return math.sqrt(low * high)
