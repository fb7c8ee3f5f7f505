"""Design the trajectory that tells most about a joint, or judge one that is given."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from davinci_forces.runner.console import echo

if TYPE_CHECKING:
    from davinci_forces.simulation.excitation.request import Answer, ArmExcitation
    from davinci_forces.simulation.excitation.trajectory import ExcitationTrajectory


def run(
    robot: Annotated[str, typer.Argument(help="A listed robot, or the path of a robot's .toml or .urdf file.")],
    joint: Annotated[str, typer.Argument(help="A joint of it, or `all`, which then move together.")],
    evaluate: Annotated[str | None, typer.Option(help="Judge these coefficients: a0,a1,b1,a2,b2,...")] = None,
    period: Annotated[float | None, typer.Option(help="Period [s]; else 10, or 5 where all joints slide.")] = None,
    harmonics: Annotated[int | None, typer.Option(min=1, help="Harmonics of the series; else the joint's.")] = None,
    criterion: Annotated[
        str, typer.Option(help="determinant: -log10 det(F'F); condition: log10 cond(F).")
    ] = "determinant",
    q: Annotated[str | None, typer.Option(help="Limits of position, lower,upper, instead of the joint's.")] = None,
    dq: Annotated[str | None, typer.Option(help="Limits of velocity.")] = None,
    ddq: Annotated[str | None, typer.Option(help="Limits of acceleration.")] = None,
    starts: Annotated[int, typer.Option(min=1, help="Starts of the search; half as many for an arm.")] = 24,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the starts.")] = 0,
    samples: Annotated[int, typer.Option(min=2, help="K, the instants of a period that the criterion looks at.")] = 300,
    rate: Annotated[float, typer.Option(help="Rate of the controller's table [Hz].")] = 100.0,
    csv: Annotated[Path | None, typer.Option(help="Write its table for the controller: t, q, dq, ddq.")] = None,
    run_in: Annotated[
        bool, typer.Option(help="Begin the table at rest, before t = 0; else it is the period alone.")
    ] = True,
    plot: Annotated[Path | None, typer.Option(help="Draw the trajectory: .svg, .png or .pdf.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Minimise -log10 det(F'F) over a Fourier series whose limits hold at every instant.

    The best, the median and the worst of the starts tell whether the search is to be trusted: where they differ, more
    starts may find more. All joints of an arm take minutes; each start is told of when it is done.
    """
    from davinci_forces.errors import BadRequest
    from davinci_forces.simulation.excitation import trajectory
    from davinci_forces.simulation.excitation.request import Request, answer

    request = Request(robot, joint, evaluate, period, harmonics, criterion, (q, dq, ddq), starts, seed, samples)
    answered = answer(request, _say)
    try:
        if csv:
            csv.write_text(trajectory.table(answered.trajectories, rate, run_in), encoding="utf-8", newline="\n")
        if plot:
            trajectory.plot(answered.trajectories, plot)
    except OSError as error:
        raise BadRequest(f"{error.filename}: {error.strerror}") from None
    echo(json.dumps(_document(robot, answered), indent=2) if as_json else _format_text(answered))


def _say(start: int, starts: int, value: float) -> None:
    echo(f"start {start} of {starts}: objective {value:.4f}", err=True)


def _document(robot: str, answered: "Answer") -> dict[str, Any]:
    trajectories, arm = answered
    if len(trajectories) == 1:
        return {"robot": robot, **trajectories[0].facts()}
    totals = _totals(arm) if arm else {"objective": sum(e.objective for e in trajectories)}
    return {"robot": robot, "joint": "all", **totals, "joints": {e.joint.name: e.facts() for e in trajectories}}


def _totals(arm: "ArmExcitation") -> dict[str, Any]:
    from davinci_forces.simulation.excitation.trajectory import spread

    own = {"objective": arm.objective, "condition": arm.condition, "base_parameters": arm.base_parameters}
    return {**own, "starts": spread(arm.optima)}


def _format_text(answered: "Answer") -> str:
    trajectories, arm = answered
    lines = []
    if arm:
        base = f"{arm.base_parameters} base parameters"
        lines += [f"all joints: objective {arm.objective:.4f}, condition {arm.condition:.1f}, {base}"]
        lines += [_spread(_totals(arm)["starts"])]
    for e in trajectories:
        lines += _lines(e)
    return "\n".join(lines)


def _lines(e: "ExcitationTrajectory") -> list[str]:
    facts = e.facts()
    lines = [f"{e.joint.name}: objective {e.objective:.4f}, condition {e.condition:.1f}, period {e.series.period:g} s"]
    lines += [_spread(facts["starts"])] if "starts" in facts else []
    lines += ["  " + "  ".join(f"{name} = {value:.6g}" for name, value in facts["coefficients"].items())]
    for symbol, (low, high) in facts["ranges"].items():
        lower, upper = facts["limits"][symbol]
        lines += [f"  {symbol:3} from {low:.5f} to {high:.5f}, limits {lower:g} and {upper:g}"]
    return lines + [f"  LIMIT BROKEN: {text}" for text in e.broken]


def _spread(starts: dict[str, float | None]) -> str:
    """How far the starts agree: a search that has found the best there is finds it more than once."""
    optima = (
        f"{name} {starts[name]:.4f}" if starts[name] is not None else f"{name} none"
        for name in ("best", "median", "worst")
    )
    return f"  {starts['number']} starts of the search: {', '.join(optima)}"
