"""Say how stiff a tissue may be before the hand that feels it through a haptic device is no longer stable.

The hand is a mass on a spring and a damper, tissue a spring on one side of its surface, as in chapter 8 of the thesis.
"""

import json
from typing import TYPE_CHECKING, Annotated

import typer

from davinci_forces.runner.console import echo

if TYPE_CHECKING:
    from davinci_forces.haptics.maths.bimodal import Hand

Limits = dict[str, float | None]


def run(
    k_h: Annotated[float, typer.Option(help="Stiffness K_H of the hand [N/m]; the thesis states none.")] = 100.0,
    b_h: Annotated[float, typer.Option(help="Damping b_H of the hand [N s/m].")] = 1.0,
    m: Annotated[float, typer.Option(help="Mass m of the hand and what it holds [kg].")] = 1.0,
    delay: Annotated[
        float | None, typer.Option(help="How late the force comes [s]: the filter's lag and the link's.")
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Rate [Hz] at which the force is made and held.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """The largest stiffness K_T of tissue [N/m] by each criterion: (8.10), arbitrary switching, delay and sampling."""
    hand = _hand(k_h, b_h, m, delay, rate)
    limits = _limits(hand, delay, rate)
    if as_json:
        asked = {"k_h": k_h, "b_h": b_h, "m": m, "delay": delay, "rate": rate}
        echo(json.dumps(asked | limits, indent=2, allow_nan=False))
    else:
        echo(_format_text(hand, limits, delay, rate))


def _hand(k_h: float, b_h: float, m: float, delay: float | None, rate: float | None) -> "Hand":
    """The hand that was asked for.

    Raises
    ------
    BadRequest
        If a number cannot be one of a hand, of a delay or of a rate; every such number is named.
    """
    from davinci_forces.errors import BadRequest
    from davinci_forces.haptics.maths.bimodal import Hand
    from davinci_forces.toml import unlikely

    above = {"--k-h": (k_h, "N/m"), "--b-h": (b_h, "N s/m"), "--m": (m, "kg"), "--rate": (rate, "Hz")}
    wrong = [
        f"{option} {value:g}: must be a positive number [{unit}]"
        for option, (value, unit) in above.items()
        if value is not None and not 0.0 < value < float("inf")
    ]
    if delay is not None and not 0.0 <= delay < float("inf"):
        wrong.append(f"--delay {delay:g}: must be 0 or a positive number [s]")
    asked = (("--k-h", k_h, "stiffness"), ("--b-h", b_h, "damping"), ("--m", m, "mass"), ("--delay", delay, "time"),
             ("--rate", rate, "rate"))  # fmt: skip
    wrong = wrong or [f"{said}, not {x:g}" for option, x, kind in asked if (said := unlikely(option, x or 0.0, kind))]
    if wrong:
        without = "; a hand without damping never comes to rest" if b_h == 0.0 else ""
        raise BadRequest("; ".join(wrong) + without)
    return Hand(m, b_h, k_h)


def _limits(hand: "Hand", delay: float | None, rate: float | None) -> Limits:
    """Every limit [N/m] that was asked for; None is no limit."""
    from davinci_forces.haptics.maths import bimodal, lmi
    from davinci_forces.haptics.maths.delay import delay_limit, sampled_limit

    switching = bimodal.switching_limit(hand)
    limits: Limits = {
        "k_t_cqlf": bimodal.cqlf_limit(hand),
        "k_t_lmi": lmi.lmi_limit(hand, switching),
        "k_t_switching": switching,
    }
    if rate is not None:
        limits["k_t_delay"] = sampled_limit(hand, delay or 0.0, rate)
    elif delay is not None:
        limits["k_t_delay"] = delay_limit(hand, delay) if delay else None
    return limits


def _format_text(hand: "Hand", limits: Limits, delay: float | None, rate: float | None) -> str:
    """A sentence a limit, for people."""
    from davinci_forces.haptics.maths.bimodal import THESIS_TISSUE
    from davinci_forces.haptics.maths.delay import damping_needed

    lines = [
        f"A hand of m = {hand.m:g} kg, b_H = {hand.b:g} N s/m and K_H = {hand.k:g} N/m, against tissue of K_T:",
        f"  k_t_cqlf      {_newtons(limits['k_t_cqlf'])}  below it one quadratic Lyapunov function falls in both modes",
        f"  k_t_lmi       {_newtons(limits['k_t_lmi'])}  the same by Clarabel, from the inequality (8.10)",
        f"  k_t_switching {_newtons(limits['k_t_switching'])}  below it no switching makes it unstable, above it the "
        "worst does",
        "  without delay          any  as it really switches, at first contact: every K_T >= 0 is stable",
    ]
    if "k_t_delay" in limits:
        how = [f"{delay:g} s late"] if delay else []
        how += [f"held at {rate:g} Hz"] if rate is not None else []
        lines += [
            f"  k_t_delay     {_newtons(limits['k_t_delay'])}  below it the hand that stays in contact is stable, the "
            f"force {' and '.join(how) or 'not late at all'}"
        ]
    lines += ["", f"The thesis's tissue, {THESIS_TISSUE:g} N/m, is {_against(limits, THESIS_TISSUE)}."]
    if delay and (limits.get("k_t_delay") or THESIS_TISSUE) <= THESIS_TISSUE:
        needed = damping_needed(hand, THESIS_TISSUE, delay + (0.5 / rate if rate else 0.0))
        lines += [f"A hand damped by about {needed:.3g} N s/m would hold it."]
    return "\n".join(lines)


def _newtons(value: float | None) -> str:
    return f"{'any' if value is None else f'{value:.4g} N/m':>12}"


def _against(limits: Limits, k_t: float) -> str:
    """On which side of the limits a tissue is."""
    proved, worst, late = (limits.get(name) for name in ("k_t_cqlf", "k_t_switching", "k_t_delay"))
    if k_t < (proved or 0.0):
        said = "below all limits without delay"
    elif k_t < (worst or 0.0):
        said = "beyond the Lyapunov function, but no switching makes it unstable"
    else:
        said = "beyond both limits of arbitrary switching, which does not happen: without delay it is stable"
    if "k_t_delay" not in limits:
        return said + "; say --delay or --rate for what does limit it"
    if late is None or k_t < late:
        return said + "; so late, too"
    return said + "; so late, it is not: it is beyond k_t_delay"
