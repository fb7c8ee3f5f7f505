"""Simulate haptic feedback through arm, controller and filter from a scenario: felt forces and stability margins."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from davinci_forces.commands import AsJson
from davinci_forces.errors import BadRequest
from davinci_forces.files import json_number, write_bytes
from davinci_forces.runner.console import echo

if TYPE_CHECKING:
    from davinci_forces.haptics.scenario import FullScenario
    from davinci_forces.records import HapticRun

Answer = dict[str, Any]


def run(
    scenario: Annotated[
        Path | None, Argument(help="A scenario (.toml); without one, the experiment of thesis section 8.4.")
    ] = None,
    as_json: AsJson = False,
    csv: Annotated[
        Path | None, Option(help="Folder for <hand>.csv: motion and force of each hand of the scenario.")
    ] = None,
    template: Annotated[
        Path | None, Option(help="Only write the scenario of thesis section 8.4 to this file, to be edited.")
    ] = None,
) -> None:
    """Simulate the whole loop: hand, device, link, arm with its controller, friction and filter, and tissue."""
    if template is not None:
        _write_template(template)
        return
    from davinci_forces.haptics import loop as haptic
    from davinci_forces.haptics import scenario as haptics

    answer = _answer(haptic.complete_scenario(haptics.read(scenario) if scenario else haptics.HapticScenario()), csv)
    echo(json.dumps(answer, indent=2, allow_nan=False) if as_json else _format_text(answer))


def _write_template(file: Path) -> None:
    """Write the shipped scenario to a new file; raises BadRequest if the file exists."""
    from importlib.resources import files

    if file.exists():
        raise BadRequest(f"{file} exists already; name another file, or move it away")
    write_bytes(file, files("davinci_forces.haptics").joinpath("haptics.toml").read_bytes())
    echo(f"{file}: written; change its numbers, then run `davinci-forces haptics {file}`")


def _answer(scenario: "FullScenario", csv: Path | None) -> Answer:
    """Results of a scenario as JSON values; None stands for no limit."""
    from davinci_forces.haptics import limits
    from davinci_forces.haptics import loop as haptic

    if not limits.has_limits(scenario):
        raise BadRequest(f"{scenario.title}: the arm follows no hand, as {limits.why_unstable(scenario)}")
    loop = limits.loop_response(scenario)
    hands = {}
    for name, hand in scenario.hands:
        run, found = haptic.experiment(scenario, name, hand), limits.limits_of(scenario, name, hand, loop)
        if csv is not None:
            _write_csv(csv / f"{name}.csv", run)
        numbers = {key: getattr(found, key) for key in found.scalars() if not key.startswith(("hand", "link"))}
        hands[name] = {
            "m": hand.m, "b_h": hand.b, "k_h": hand.k, "true_peak": run.true_peak, "felt_peak": run.felt_peak,
            "felt_error": run.felt_error, "out_of_reach": float(run.t[-1]) if run.out_of_reach else None,
            **{key: json_number(value) for key, value in numbers.items()},
        }  # fmt: skip
    response = haptic.response(scenario)
    rows = zip(response.frequency.tolist(), response.share.tolist(), response.late.tolist(), strict=True)
    felt = [dict(zip(("frequency", "share", "late"), row, strict=True)) for row in rows]
    return {"title": scenario.title, "tissue_stiffness": scenario.stiffness, "response": felt, "hands": hands}


def _write_csv(file: Path, run: "HapticRun") -> None:
    """Write the motion and force of one hand, one row per step of the controller."""
    columns = run.t, run.plan_x, run.hand_x, run.arm_x, run.true_force, run.felt_force
    rows = zip(*(column.tolist() for column in columns), strict=True)
    names = "t [s],plan [m],hand [m],arm [m],true [N],felt [N]"
    lines = [names, *(",".join(f"{x:.9g}" for x in row) for row in rows)]
    write_bytes(file, ("\n".join(lines) + "\n").encode())


def _format_text(answer: Answer) -> str:
    lines = [f"{answer['title']}, simulated, against tissue of {answer['tissue_stiffness']:.4g} N/m.", ""]
    lines += ["Frequency, felt stiffness in % of the true one, and delay of the felt force:"]
    for row in answer["response"]:
        lines += [f"  {row['frequency']:5.2f} Hz {100 * row['share']:5.0f} %  {1e3 * row['late']:5.0f} ms"]
    for name, hand in answer["hands"].items():
        of_hand = f"m = {hand['m']:g} kg, b_H = {hand['b_h']:g} N s/m and K_H = {hand['k_h']:g} N/m"
        lines += ["", f"Hand {name!r} of {of_hand}:"]
        if hand["out_of_reach"] is not None:
            lines += [f"  unstable: the hand is thrown out of the device's reach after {hand['out_of_reach']:.1f} s"]
        own, damping = hand["damping_needed"] <= hand["b_h"], f"{hand['damping_needed']:.3g} N s/m"
        needed = "the hand's own damping suffices" if own else f"a damping of {damping} is needed"
        lines += [
            f"  peak force: felt {hand['felt_peak']:.3g} N, true {hand['true_peak']:.3g} N; error of the felt force "
            f"{hand['felt_error']:.2g} N (rms)",
            f"  limit for elastic tissue: {_quantity(hand['k_t_limit'], 'N/m')} by the formula, with the force "
            f"{_quantity(hand['loop_delay'], 's')} late; {_quantity(hand['k_t_response'], 'N/m')} by the response, "
            f"{_quantity(hand['k_t_simulated'], 'N/m')} in simulation",
            f"  with the arm's friction and damping of tissue: {_quantity(hand['k_t_settles'], 'N/m')} in simulation",
            f"  {_quantity(hand['k_t_best'], 'N/m')} with the best additional delay, {hand['best_delay'] or 0:.3g} s; "
            f"for this tissue {needed}, by the response; no setting is changed",
            f"  additional delay until unstable: {_quantity(hand['delay_margin'], 's')}",
        ]
    return "\n".join(lines)


def _quantity(value: float | None, unit: str) -> str:
    return "not found" if value is None else f"{value:.3g} {unit}"
