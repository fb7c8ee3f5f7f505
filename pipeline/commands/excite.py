"""Design the trajectory that tells most about a joint, or judge one that is given."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipeline.excitation.trajectory import ExcitationTrajectory


def run(
    robot: Annotated[str, typer.Argument(help="A listed robot, or the path of a robot's .toml file.")],
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
    starts: Annotated[int, typer.Option(min=1, help="Random starts of the search.")] = 24,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the starts.")] = 0,
    rate: Annotated[float, typer.Option(help="Rate of the controller's table [Hz].")] = 100.0,
    csv: Annotated[Path | None, typer.Option(help="Write one period for the controller: t, q, dq, ddq.")] = None,
    plot: Annotated[Path | None, typer.Option(help="Draw the trajectory: .svg, .png or .pdf.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Minimise -log10 det(F'F) over a Fourier series whose limits hold at every instant."""
    from pipeline.errors import BadRequest
    from pipeline.excitation import trajectory
    from pipeline.excitation.request import Request, answer, arm_of, load

    request = Request(robot, joint, evaluate, period, harmonics, criterion, (q, dq, ddq), starts, seed)
    trajectories = answer(request)
    try:
        if csv:
            csv.write_text(trajectory.csv(trajectories, rate), encoding="utf-8", newline="\n")
        if plot:
            trajectory.plot(trajectories, plot)
    except OSError as error:
        raise BadRequest(f"{error.filename}: {error.strerror}") from None
    arm = arm_of(load(robot), trajectories) if joint == "all" else None
    typer.echo(
        json.dumps(_document(robot, trajectories, arm), indent=2) if as_json else _format_text(trajectories, arm)
    )


def _document(
    robot: str, trajectories: "Sequence[ExcitationTrajectory]", arm: tuple[float, float, int] | None
) -> dict[str, Any]:
    if len(trajectories) == 1:
        return {"robot": robot, **trajectories[0].facts()}
    joints = {e.joint.name: e.facts() for e in trajectories}
    if arm is None:
        return {"robot": robot, "joint": "all", "objective": sum(e.objective for e in trajectories), "joints": joints}
    objective, condition, parameters = arm
    totals = {"objective": objective, "condition": condition, "base_parameters": parameters}
    return {"robot": robot, "joint": "all", **totals, "joints": joints}


def _format_text(trajectories: "Sequence[ExcitationTrajectory]", arm: tuple[float, float, int] | None) -> str:
    lines = []
    if arm:
        lines.append(f"all joints: objective {arm[0]:.4f}, condition {arm[1]:.1f}, {arm[2]} base parameters")
    for e in trajectories:
        facts = e.facts()
        lines += [
            f"{e.joint.name}: objective {e.objective:.4f}, condition {e.condition:.1f}, period {e.series.period:g} s"
        ]
        lines += ["  " + "  ".join(f"{name} = {value:.6g}" for name, value in facts["coefficients"].items())]
        for symbol, (low, high) in facts["ranges"].items():
            lower, upper = facts["limits"][symbol]
            lines += [f"  {symbol:3} from {low:.5f} to {high:.5f}, limits {lower:g} and {upper:g}"]
        lines += [f"  LIMIT BROKEN: {text}" for text in e.broken]
    return "\n".join(lines)
