"""Simulate a hand that feels tissue through the arm: what it feels, and how far it is from unstable."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from davinci_forces.runner.console import echo

if TYPE_CHECKING:
    from davinci_forces.haptics.scenario import HapticScenario

Answer = dict[str, object]


def run(
    scenario: Annotated[
        Path | None, typer.Argument(help="The .toml file of a scenario; without one, the experiment of section 8.4.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
    csv: Annotated[
        Path | None, typer.Option(help="A folder in which to write what each hand felt over time, <hand>.csv.")
    ] = None,
    template: Annotated[
        Path | None, typer.Option(help="Write the file of section 8.4 there, to be changed, and do nothing else.")
    ] = None,
) -> None:
    """The whole loop, simulated: hand, device, link, arm with its controller, friction and filter, and tissue."""
    if template is not None:
        _write_template(template)
        return
    from davinci_forces.haptics import loop as haptic
    from davinci_forces.haptics import scenario as haptics

    whole = haptic.filled(haptics.read(scenario) if scenario else haptics.HapticScenario())
    answer = _answer(whole, csv)
    echo(json.dumps(answer, indent=2, allow_nan=False) if as_json else _format_text(answer))


def _write_template(file: Path) -> None:
    """The shipped scenario, as a file of the user's own.

    Raises
    ------
    BadRequest
        If there is a file already.
    """
    from importlib.resources import files

    from davinci_forces.errors import BadRequest
    from davinci_forces.files import write_bytes

    if file.exists():
        raise BadRequest(f"{file} is there already; name another file, or move it away")
    write_bytes(file, files("davinci_forces.haptics").joinpath("haptics.toml").read_bytes())
    echo(f"{file}: written; change its numbers, then run `davinci-forces haptics {file}`")


def _answer(scenario: "HapticScenario", csv: Path | None) -> Answer:
    """Everything that is said of a scenario; None is no limit."""
    from davinci_forces.haptics import loop as haptic

    response = haptic.response(scenario)
    hands = {}
    for name, hand in scenario.hands:
        run, margins = haptic.experiment(scenario, hand), haptic.margins(scenario, hand, response)
        if csv is not None:
            _write_csv(csv / f"{name}.csv", run)
        hands[name] = {
            "m": hand.m, "b_h": hand.b, "k_h": hand.k, "true_peak": float(run.true.max()),
            "felt_peak": float(run.felt.max()), "felt_error": run.error,
            "out_of_reach": float(run.t[-1]) if run.thrown else None, "k_t_settles": _known(margins.stiffness),
            "k_t_response": _known(margins.by_response), "delay_margin": _known(margins.delay),
        }  # fmt: skip
    rows = zip(response.frequency.tolist(), response.share.tolist(), response.late.tolist(), strict=True)
    felt = [dict(zip(("frequency", "share", "late"), row, strict=True)) for row in rows]
    return {"title": scenario.title, "tissue_stiffness": scenario.stiffness, "response": felt, "hands": hands}


def _known(value: float) -> float | None:
    return value if value == value else None


def _write_csv(file: Path, run: object) -> None:
    """What one hand felt, a row a turn of the controller."""
    from davinci_forces.files import write_bytes

    fields = {"t [s]": "t", "plan [m]": "plan", "hand [m]": "x", "arm [m]": "q", "true [N]": "true", "felt [N]": "felt"}
    rows = zip(*(getattr(run, name).tolist() for name in fields.values()), strict=True)
    lines = [",".join(fields), *(",".join(f"{x:.9g}" for x in row) for row in rows)]
    write_bytes(file, ("\n".join(lines) + "\n").encode())


def _format_text(answer: Answer) -> str:
    """A paragraph a hand, for people."""
    lines = [f"{answer['title']}, simulated, against tissue of {answer['tissue_stiffness']:.4g} N/m.", ""]
    lines += ["The stiffness that is felt over the true one, and how late it is:"]
    lines += [f"  {row['frequency']:5.2f} Hz {100 * row['share']:5.0f} %  {1e3 * row['late']:5.0f} ms"
              for row in answer["response"]]  # type: ignore[attr-defined]  # fmt: skip
    for name, hand in answer["hands"].items():  # type: ignore[attr-defined]
        lines += [
            "",
            f"Hand {name!r} of m = {hand['m']:g} kg, b_H = {hand['b_h']:g} N s/m and K_H = {hand['k_h']:g} N/m:",
        ]
        if hand["out_of_reach"] is not None:
            lines += [f"  unstable: it is thrown out of the device's reach after {hand['out_of_reach']:.1f} s"]
        lines += [
            f"  felt force at most {hand['felt_peak']:.3g} N where the true one is at most {hand['true_peak']:.3g} N, "
            f"off by {hand['felt_error']:.2g} N (rms)",
            f"  settles against tissue up to {_of(hand['k_t_settles'], 'N/m')}, by simulation; up to "
            f"{_of(hand['k_t_response'], 'N/m')} by the response",
            f"  bears {_of(hand['delay_margin'], 's')} more of delay",
        ]
    return "\n".join(lines)


def _of(value: float | None, unit: str) -> str:
    return f"any [{unit}]" if value is None else f"{value:.3g} {unit}"
