"""Compute the stiffest tissue at which a given hand on a haptic device is stable, by formulas; needs no study.

The hand is a mass on a spring and a damper. The tissue is a spring that acts only below its surface, as in chapter 8
of the thesis.
"""

import json
from typing import TYPE_CHECKING, Annotated

from typer import Option

from davinci_forces.commands import AsJson
from davinci_forces.errors import BadRequest
from davinci_forces.runner.console import echo

if TYPE_CHECKING:
    from davinci_forces.haptics.maths.bimodal import Hand

Limits = dict[str, float | None]
TRIED_DELAYS = 101


def run(
    k_h: Annotated[float, Option(help="Stiffness K_H of the hand [N/m]; the thesis states none.")] = 100.0,
    b_h: Annotated[float, Option(help="Damping b_H of the hand [N s/m].")] = 1.0,
    m: Annotated[float, Option(help="Mass m of the hand and what it holds [kg].")] = 1.0,
    delay: Annotated[
        float | None, Option(help="Delay [s] of the force on the hand, due to filter and data link.")
    ] = None,
    rate: Annotated[float | None, Option(help="Rate [Hz] at which the hand receives a new force.")] = None,
    as_json: AsJson = False,
) -> None:
    """Print the largest stable tissue stiffness K_T [N/m]: by (8.10), by arbitrary switching, by delay and sampling."""
    hand = _hand(k_h, b_h, m, delay, rate)
    limits = _limits(hand, delay, rate)
    if as_json:
        parameters = {"k_h": k_h, "b_h": b_h, "m": m, "delay": delay, "rate": rate}
        echo(json.dumps(parameters | limits, indent=2, allow_nan=False))
    else:
        echo(_format_text(hand, limits, delay, rate))


def _hand(k_h: float, b_h: float, m: float, delay: float | None, rate: float | None) -> "Hand":
    """The hand with these parameters, in SI units; raises BadRequest that names all impossible parameters."""
    from davinci_forces.haptics.maths.bimodal import Hand
    from davinci_forces.toml import unlikely

    options = {
        "--k-h": (k_h, "N/m", "stiffness"), "--b-h": (b_h, "N s/m", "damping"), "--m": (m, "kg", "mass"),
        "--delay": (delay, "s", "time"), "--rate": (rate, "Hz", "rate"),
    }  # fmt: skip
    wrong = [
        f"{option} {value:g}: must be a positive number [{unit}]"
        for option, (value, unit, _) in options.items()
        if option != "--delay" and value is not None and not 0.0 < value < float("inf")
    ]
    if delay is not None and not 0.0 <= delay < float("inf"):
        wrong.append(f"--delay {delay:g}: must be 0 or a positive number [s]")
    if not wrong:
        sizes = ((value, unlikely(option, value or 0.0, kind)) for option, (value, _, kind) in options.items())
        wrong = [f"{text}, not {value:g}" for value, text in sizes if text]
    if wrong:
        without = "; a hand without damping never comes to rest" if b_h == 0.0 else ""
        raise BadRequest("; ".join(wrong) + without)
    return Hand(m, b_h, k_h)


def _limits(hand: "Hand", delay: float | None, rate: float | None) -> Limits:
    """Limits of K_T [N/m] by each criterion, and the delay with the largest; None stands for no limit."""
    import numpy as np

    from davinci_forces.haptics.maths import bimodal, lmi
    from davinci_forces.haptics.maths.delay import delay_limit, sampled_limit

    switching = bimodal.switching_limit(hand)
    limits: Limits = {
        "k_t_cqlf": bimodal.cqlf_limit(hand),
        "k_t_lmi": lmi.lmi_limit(hand, switching),
        "k_t_switching": switching,
    }
    if delay is None and rate is None:
        return limits
    now, hold = delay or 0.0, 0.5 / rate if rate else 0.0
    if not now + hold:
        return limits | {"k_t_delay": None}
    tried = now + np.linspace(0.0, 2.0 * np.pi / hand.frequency, TRIED_DELAYS)
    best = max(tried.tolist(), key=lambda late: delay_limit(hand, late + hold))
    at_now, at_best = (sampled_limit(hand, d, rate) if rate else delay_limit(hand, d) for d in (now, best))
    return limits | {"k_t_delay": at_now, "best_delay": best, "k_t_best": at_best}


def _format_text(hand: "Hand", limits: Limits, delay: float | None, rate: float | None) -> str:
    from davinci_forces.haptics.maths.bimodal import THESIS_TISSUE
    from davinci_forces.haptics.maths.delay import damping_needed, delay_limit

    criteria = {
        "k_t_cqlf": "below it, one quadratic Lyapunov function decreases in both modes",
        "k_t_lmi": "the same, computed from the matrix inequality (8.10)",
        "k_t_switching": "below it, every switching is stable; above it, the worst switching is not",
        "k_t_delay": "below it, a hand that stays in contact is stable, with the delayed and held force",
    }
    of_hand = f"m = {hand.m:g} kg, b_H = {hand.b:g} N s/m and K_H = {hand.k:g} N/m"
    lines = [f"Limits of the tissue stiffness K_T for a hand of {of_hand}:"]
    lines += [f"  {key:13} {limits[key]:8.4g} N/m  {text}" for key, text in criteria.items() if limits.get(key)]
    limit = limits.get("k_t_delay")
    if limit is None:
        return "\n".join([*lines, "", "These know no delay, which limits a real hand: add --delay or --rate."])
    lines += [
        f"The first three allow any switching and know no delay; k_t_delay is the limit with delay. It is largest, "
        f"{limits['k_t_best']:.4g} N/m ({limits['k_t_best'] / limit:.3g} times), at a delay of "  # type: ignore[operator]
        f"{limits['best_delay']:.3g} s, of those up to a period of the free hand longer. No setting is changed."
    ]
    total = (delay or 0.0) + (0.5 / rate if rate else 0.0)
    damping = damping_needed(hand, THESIS_TISSUE, lambda damped: delay_limit(damped, total))
    needed = f"a damping of {damping:.3g} N s/m is needed" if damping > hand.b else "the hand's own damping suffices"
    return "\n".join([*lines, f"For tissue of {THESIS_TISSUE:g} N/m, as in the thesis, {needed}."])
