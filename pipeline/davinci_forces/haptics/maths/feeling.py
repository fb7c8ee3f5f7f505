"""What a hand feels against what there is: the loop's response, and the limits that follow from it or are tried out.

Between the force that the tissue would exert where the hand is, K_T x + D dx, and the one that is felt lies the loop's
response T(jw): arm, filter, link and what holds the force.  It is 1 where the hand feels the tissue itself.  The hand
in contact, m ddx + b dx + K_H x + T (K_T x + D dx) = 0, has a root on the imaginary axis where

    K_T = (m w^2 - K_H - j b w) / T(jw) - j D w

is real and positive; the smallest is the limit.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from davinci_forces.haptics.maths.bimodal import Hand
from davinci_forces.maths.arrays import Array

Complex = NDArray[np.complex128]

FINE = 4000  # places between the frequencies at which a response is known
SHRINKS = 0.97  # of a swing over a quarter of the time, from which it counts as lasting
WIDEST = 64.0  # times a first guess, as far as a limit is looked for
HALVINGS = 7


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
