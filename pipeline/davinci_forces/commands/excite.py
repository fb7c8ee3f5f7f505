"""Design an excitation trajectory that identifies a joint's parameters best, or evaluate a given one."""

import json
import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from davinci_forces.commands import AsJson
from davinci_forces.runner.console import echo

if TYPE_CHECKING:
    from davinci_forces.maths.excitation.search import ReportStart
    from davinci_forces.simulation.excitation.request import Answer, ArmExcitation
    from davinci_forces.simulation.excitation.trajectory import ExcitationTrajectory, ExpectedParameter


def run(
    robot: Annotated[str, Argument(help="davinci, dvrk_psm, or the path of a robot's .toml or .urdf file.")],
    joint: Annotated[str, Argument(help="A joint of the robot, or `all` to move all joints together.")],
    evaluate: Annotated[str | None, Option(help="Evaluate these coefficients: a0,a1,b1,a2,b2,...")] = None,
    period: Annotated[float | None, Option(help="Period [s]; default 10, or 5 if all joints are prismatic.")] = None,
    harmonics: Annotated[int | None, Option(min=1, help="Number of harmonics; default: the joint's.")] = None,
    criterion: Annotated[
        str,
        Option(
            help="What to minimise, of regressor F: `determinant` is -log10 det(F'F), `condition` is log10 cond(F)."
        ),
    ] = "determinant",
    q: Annotated[str | None, Option(help="Position limits, lower,upper, instead of the joint's.")] = None,
    dq: Annotated[str | None, Option(help="Velocity limits, in the same form.")] = None,
    ddq: Annotated[str | None, Option(help="Acceleration limits, in the same form.")] = None,
    noise: Annotated[
        str | None,
        Option(help="Standard deviation of the effort noise, or one for each joint; prints the expected errors."),
    ] = None,
    floor: Annotated[
        float | None, Option(help="With JOINT `all`: no moving frame goes below this z [m], in base axes.")
    ] = None,
    box: Annotated[
        list[str] | None,
        Option(help="With JOINT `all`: a box that no frame may enter, by two corners x,y,z,x,y,z [m]. Repeatable."),
    ] = None,
    starts: Annotated[
        int | None, Option(min=1, help="Starting points of the search; default 24, or 2 if JOINT is `all`.")
    ] = None,
    seed: Annotated[int, Option(min=0, help="Seed of the random starting points.")] = 0,
    samples: Annotated[int, Option(min=2, help="Samples K per period at which the criterion is computed.")] = 300,
    rate: Annotated[float, Option(help="Sampling rate [Hz] of the table of --csv.")] = 100.0,
    csv: Annotated[Path | None, Option(help="Write a table for the controller: t, q, dq, ddq.")] = None,
    run_in: Annotated[bool, Option(help="Begin the table of --csv with a run-in from rest, before t = 0.")] = True,
    plot: Annotated[Path | None, Option(help="Draw the trajectory: .svg, .png or .pdf.")] = None,
    as_json: AsJson = False,
) -> None:
    """Minimise the criterion over Fourier series that keep the limits at every instant.

    All joints of an arm together keep their position, velocity and acceleration limits, the effort limits if the masses
    are known, and the workspace of `--floor` and `--box`. Efforts are those of weight and inertia, without friction.
    The trajectory is not checked for collisions. Where the best, the median and the worst start differ, more starts may
    find a better trajectory. A line is printed after each start, as the search may take minutes.
    """
    from davinci_forces.simulation.excitation import trajectory
    from davinci_forces.simulation.excitation.request import Request, answer

    limits, around = (q, dq, ddq), (floor, tuple(box or ()))
    request = Request(
        robot, joint, evaluate, period, harmonics, criterion, limits, starts, seed, samples, noise, around
    )
    answered = answer(request, _progress())
    if csv:
        table = trajectory.table(answered.trajectories, rate, run_in, answered.arm.limits if answered.arm else None)
        csv.write_text(table, encoding="utf-8", newline="\n")
    if plot:
        trajectory.plot(answered.trajectories, plot)
    echo(json.dumps(_document(robot, answered), indent=2) if as_json else _format_text(answered))


def _progress() -> "ReportStart":
    began = time.monotonic()

    def say(start: int, starts: int, value: float) -> None:
        to_go = (time.monotonic() - began) / start * (starts - start)
        echo(f"start {start} of {starts}: objective {value:.4f}, about {to_go:.0f} s to go", err=True)

    return say


def _document(robot: str, answered: "Answer") -> dict[str, Any]:
    trajectories, arm, _ = answered
    if len(trajectories) == 1:
        return {"robot": robot, **trajectories[0].facts()}
    totals = _totals(arm) if arm else {"objective": sum(e.objective for e in trajectories)}
    return {"robot": robot, "joint": "all", **totals, "joints": {e.joint.name: e.facts() for e in trajectories}}


def _totals(arm: "ArmExcitation") -> dict[str, Any]:
    from davinci_forces.simulation.excitation.trajectory import as_facts, spread

    numbers = {"objective": arm.objective, "condition": arm.condition, "base_parameters": arm.base_parameters}
    checked = {"limits_effort": arm.limits.limits_effort, "limits_workspace": arm.limits.obstacles.present}
    return {**numbers, **checked, "starts": spread(arm.optima), **as_facts(arm.standard_errors)}


def _format_text(answered: "Answer") -> str:
    trajectories, arm, held = answered
    lines = []
    if arm:
        base, limits = f"{arm.base_parameters} base parameters", arm.limits
        effort = "within the effort limits" if limits.limits_effort else "efforts not limited (no limit, or no masses)"
        workspace = "within the workspace" if limits.obstacles.present else "no workspace stated"
        lines += [f"all joints: objective {arm.objective:.4f}, condition {arm.condition:.1f}, {base}"]
        lines += [_spread(_totals(arm)["starts"]), f"  {effort}; {workspace}; not checked for collisions"]
        lines += _error_lines(arm.standard_errors)
    lines += [line for e in trajectories for line in _lines(e)]
    if held:
        pose = f"hold {', '.join(held)} where they are in the logs to be evaluated"
        alone = f"the model of {trajectories[0].joint.name} alone holds in that pose"
        lines.append(f"  {pose}: {alone}; `all` moves them, too")
    return "\n".join(lines)


def _lines(e: "ExcitationTrajectory") -> list[str]:
    from davinci_forces.simulation.excitation.request import WHOLE_TURN

    facts = e.facts()
    lines = [f"{e.joint.name}: objective {e.objective:.4f}, condition {e.condition:.1f}, period {e.series.period:g} s"]
    lines += [_spread(facts["starts"])] if "starts" in facts else []
    lines += ["  " + "  ".join(f"{name} = {value:.6g}" for name, value in facts["coefficients"].items())]
    bounds = zip(facts["ranges"].items(), e.problem.limits, e.joint.limits.motion, strict=True)
    for (symbol, (low, high)), limits, of_joint in bounds:
        lines += [f"  {symbol:3} from {low:.5f} to {high:.5f}, limits {limits[0]:g} and {limits[1]:g}"]
        if not all(map(math.isfinite, of_joint)) and limits in (of_joint, WHOLE_TURN):
            lines[-1] += f": CHECK that the joint may move so, as no limit of {symbol} is stated; --{symbol} sets one"
    return lines + [f"  LIMIT EXCEEDED: {text}" for text in e.violations] + _error_lines(e.standard_errors)


def _error_lines(parameters: "Sequence[ExpectedParameter]") -> list[str]:
    lines = [f"    {p.name}: {p.std:.3g} {p.unit}" for p in parameters]
    return ["  expected standard errors, from one period with white noise:", *lines] if lines else []


def _spread(starts: dict[str, float | None]) -> str:
    """How well the starts agree: a search that reached the optimum reaches it from several starts."""
    objectives = {name: starts[name] for name in ("best", "median", "worst")}
    optima = (f"{name} none" if value is None else f"{name} {value:.4f}" for name, value in objectives.items())
    return f"  {starts['number']} starts of the search: {', '.join(optima)}"
