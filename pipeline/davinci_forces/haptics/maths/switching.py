"""The stiffest tissue under arbitrary switching, exactly: where the worst switching law just closes on itself.

The two modes differ in the force K_T x only, which pushes back.  The worst law leaves it out while the hand moves
away, and puts it in while it comes back, so that it switches on both axes of the phase plane, and alike in both halves.
With omega^2 = K/m and the damping ratio zeta, a mode takes a speed v to the displacement X, and X to the speed v':

    X  = v/omega   exp(-g(zeta)),        g = zeta/s  arccos(zeta)
    v' = X omega   exp(-h(zeta)),        h = zeta/s  (pi - arccos(zeta)),     s = sqrt(1 - zeta^2)

Half a turn of the worst law multiplies the speed by omega_1/omega_2 exp(-g(zeta_2) - h(zeta_1)), and K_T is the limit
where that is 1: below it every switching law dies out, above it one does not.  For planar systems that is exact.
"""

import math

from scipy.optimize import brentq

from davinci_forces.haptics.maths.bimodal import Hand, cqlf_limit

NEAR = 1e-6  # of a damping ratio to 1, where the series takes over


def switching_limit(hand: Hand) -> float:
    """The K_T [N/m] at which the worst switching law neither grows nor dies out."""
    high = cqlf_limit(hand)  # below which no law grows
    while log_growth(hand, high) < 0.0:
        high *= 2.0
    return float(brentq(lambda k_t: log_growth(hand, k_t), 0.5 * high, high, xtol=1e-12 * high, rtol=1e-12))


def log_growth(hand: Hand, k_t: float) -> float:
    """The logarithm of what half a turn of the worst law multiplies a speed by; -inf where it never turns."""
    soft, stiff = hand.damping_ratio(), hand.damping_ratio(k_t)
    if stiff >= 1.0:
        return -math.inf
    return 0.5 * math.log1p(k_t / hand.k) - away(soft) - back(stiff)


def away(zeta: float) -> float:
    """g: what damping takes of the speed, as a logarithm, on the way from the axis to the turning point."""
    if abs(1.0 - zeta) < NEAR:
        return 1.0 + (zeta - 1.0) * 2.0 / 3.0
    if zeta < 1.0:
        return zeta / math.sqrt(1.0 - zeta**2) * math.acos(zeta)
    return zeta / math.sqrt(zeta**2 - 1.0) * math.acosh(zeta)


def back(zeta: float) -> float:
    """h: the same on the way back, for zeta < 1; beyond, the axis is never reached."""
    return zeta / math.sqrt(1.0 - zeta**2) * (math.pi - math.acos(zeta))
