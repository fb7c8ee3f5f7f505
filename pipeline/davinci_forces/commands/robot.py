"""Print a robot's joints, and at one pose its frames, tip, Jacobian, M, C dq and G; or the robot as URDF."""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, Option

from davinci_forces.commands import AsJson
from davinci_forces.errors import BadRequest, MissingRecord
from davinci_forces.files import json_number
from davinci_forces.runner.console import echo

if TYPE_CHECKING:
    from davinci_forces.robots.robot import Joint, Robot

PRINTED_AS_ZERO = 1e-14  # [any unit] numbers up to this size are rounding errors
MAX_DEFAULT_COORDINATES = 6  # of the zero pose of an arm with a wrist: the arm with one jaw


def run(
    robot: Annotated[str, Argument(help="davinci, dvrk_psm, or the path of a robot's .toml or .urdf file.")],
    at: Annotated[
        str | None, Option(help="Pose q1,q2,... in rad or m; for davinci 3, 6 or 7 values. Default: zeros.")
    ] = None,
    dq: Annotated[
        str | None, Option(help="Velocities for C dq, at most as many values as the pose; missing ones are 0.")
    ] = None,
    as_json: AsJson = False,
    urdf: Annotated[bool, Option("--urdf", help="Print the robot as URDF, for ROS and simulators.")] = False,
    thesis: Annotated[
        bool,
        Option("--thesis", help="Print what reproduces each table, figure and equation of the thesis (davinci only)."),
    ] = False,
) -> None:
    """Print the pose, the Jacobian of the tip (7.21)-(7.24) and the terms of (4.38); without a chain, only joints."""
    from davinci_forces.robots import load
    from davinci_forces.toml import numbers_of_option

    arm = load(robot, Path())
    if thesis:
        echo(_index(arm))
        return
    if urdf:
        from davinci_forces.robots.urdf import writing

        echo(writing.text(arm), nl=False)
        return
    n = arm.chain.n if arm.chain else 0
    zeros = [0.0] * (min(MAX_DEFAULT_COORDINATES, n) if arm.wrist else n)
    q = zeros if at is None else numbers_of_option("--at", at)
    document = _document(arm, q, numbers_of_option("--dq", dq) if dq is not None else [])
    echo(json.dumps(document, indent=2, allow_nan=False) if as_json else _format_text(arm, q, document))


def _index(robot: "Robot") -> str:
    """The thesis chapter by chapter, with the results of `davinci-thesis` in `reports/` if it has run."""
    from davinci_forces.runner.results.dataframes import results
    from davinci_forces.simulation import thesis

    if robot.name != "davinci":
        raise BadRequest(f"--thesis is about the robot davinci, not {robot.name}")
    try:
        table = results(Path("raw/davinci-thesis"))
    except MissingRecord:
        return thesis.text({})
    return thesis.text({key: (value, std) for key, value, std in table[["value", "std"]].itertuples()})


def _document(robot: "Robot", q: list[float], dq: list[float]) -> dict[str, Any]:
    """The printed quantities as JSON values; raises BadRequest for a q or dq that the robot's chain does not have."""
    import numpy as np

    from davinci_forces.maths.mechanics import kinematics, tip_force

    chain = robot.chain
    if chain is None and (q or dq):
        raise BadRequest(f"robot {robot.name} has no chain: its geometry is not known; leave --at and --dq out")
    if chain is None:
        return {"warnings": [], "joints": _joints(robot)}
    counts = sorted({len(robot.joints), chain.n - 1, chain.n} if robot.wrist else {chain.n})
    if len(q) not in counts:
        numbers = " or ".join(filter(None, (", ".join(map(str, counts[:-1])), str(counts[-1]))))
        raise BadRequest(f"--at has {len(q)} values; the pose of {robot.name} has {numbers}")
    if len(dq) > len(q):
        raise BadRequest(f"--dq has {len(dq)} values and the pose {len(q)}; give at most {len(q)}")
    pose, rates = np.array(q), np.array(dq + [0.0] * (len(q) - len(dq)))
    T = kinematics.frames(chain, pose)
    J_v, J_w = kinematics.jacobian(chain, pose)
    has_force = chain.n >= tip_force.ARM
    singular = has_force and bool(tip_force.is_singular(chain, pose))
    frames = {name: {"origin": t[:3, 3].tolist(), "rotation": t[:3, :3].tolist()}
              for name, t in zip(chain.names, T, strict=True)}  # fmt: skip
    return {
        "frames": frames, "tip": kinematics.tip(chain, pose).tolist(),
        "remote_centre": kinematics.remote_centre(chain).tolist(),
        "jacobian_v": J_v.tolist(), "jacobian_w": J_w.tolist(), **_dynamics(robot, pose, rates),
        "condition": float(np.linalg.cond(J_v[..., : tip_force.ARM])) if has_force and not singular else None,
        "warnings": [*_outside(robot, q), *([_singular(chain, q)] if singular else [])], "joints": _joints(robot),
    }  # fmt: skip


def _joints(robot: "Robot") -> dict[str, Any]:
    """Kind, unit of effort, limits (null where there is none) and terms of each joint."""
    joints = {}
    for joint in robot.joints:
        limits = {symbol: [*map(json_number, getattr(joint.limits, symbol))] for symbol in ("q", "dq", "ddq")}
        joints[joint.name] = {
            "kind": joint.kind.value, "effort": joint.unit("{effort}"),
            "limits": limits | {"effort": json_number(joint.limits.effort)},
            "terms": [term.name for term in joint.terms],
        }  # fmt: skip
    return joints


def _dynamics(robot: "Robot", q: Any, dq: Any) -> dict[str, Any]:
    from davinci_forces.maths.mechanics import rigid_body

    if robot.chain is None or robot.bodies is None:
        return {"mass": None, "coriolis": None, "gravity": None}
    return {
        "mass": rigid_body.mass_matrix(robot.chain, robot.bodies, q).tolist(),
        "coriolis": rigid_body.coriolis(robot.chain, robot.bodies, q, dq).tolist(),
        "gravity": rigid_body.gravity(robot.chain, robot.bodies, q).tolist(),
    }


def _outside(robot: "Robot", q: list[float]) -> Iterator[str]:
    """Warn of joints outside their limits; the quantities are computed all the same."""
    for joint, value in zip(robot.joints, q, strict=False):
        (low, high), unit = joint.limits.q, joint.unit("{position}")
        if not low <= value <= high:
            yield f"{joint.name} at {value:g} {unit} is outside its limits, {low:g} to {high:g} {unit}"


def _singular(chain: Any, q: list[float]) -> str:
    """Explain why the pose has no condition number, and where such poses lie."""
    from davinci_forces.maths.mechanics.tip_force import ARM, SINGULAR, singular_slides

    kinds = [set(chain.slides[chain.coordinate == k].tolist()) for k in range(ARM)]
    of_a_slide = kinds == [{False}, {False}, {True}]
    slides = ", ".join(sorted({f"{slide:.4f}" for slide in singular_slides(chain, q[1])})) if of_a_slide else ""
    where = f"; at this pitch, the slide positions {slides} m are singular" if slides else ""
    why = f"the condition number of J_v of the first {ARM} joints is above {SINGULAR:g}"
    return f"singular: {why}, so in one direction the force at the tip cannot be computed from their efforts{where}"


def _format_text(robot: "Robot", q: list[float], document: dict[str, Any]) -> str:
    """The document as text, in base axes and SI units, rounding errors as 0."""
    from davinci_forces.maths.mechanics.tip_force import ARM

    lines = [robot.title, "", *_joint_lines(robot, q)]
    if "frames" not in document:
        return "\n".join([*lines, "", "its geometry is not known; add [[link]] to its file, or use a URDF"])
    lines += ["", f"at q = {_numbers(q)}"]
    lines += [f"warning: {text}" for text in document["warnings"]]
    width = max(map(len, ("frame", *document["frames"])))
    lines += ["", f"{'frame':>{width}}   origin [m]"]
    lines += [f"{name:>{width}}   {_numbers(frame['origin'])}" for name, frame in document["frames"].items()]
    lines += ["", f"tip [m]   {_numbers(document['tip'])}"]
    lines += [f"remote centre of the first two joints at q = 0 [m]   {_numbers(document['remote_centre'])}"]
    titles = {"jacobian_v": "J_v of the tip", "jacobian_w": "J_omega", "mass": "M"}
    for key, title in titles.items():
        if document[key] is not None:
            lines += ["", title, *(f"  {_numbers(row)}" for row in document[key])]
    if document["mass"] is not None:
        lines += ["", f"C dq   {_numbers(document['coriolis'])}", f"G      {_numbers(document['gravity'])}"]
    if len(document["jacobian_v"][0]) < ARM:  # no force at the tip, so no condition
        return "\n".join(lines)
    condition = document["condition"]
    return "\n".join([*lines, "", f"condition of J_v   {'singular' if condition is None else f'{condition:.4g}'}"])


def _joint_lines(robot: "Robot", q: list[float]) -> Iterator[str]:
    """One line per joint: its range, speed, the terms of its effort, and where a positive motion moves the tip.

    At the pose of zeros that is with all joints in mid-range: a slide that is drawn in may reverse it.
    """
    J_v, where_from = _directions(robot, q)
    width = max(len(joint.name) for joint in robot.joints)
    for i, joint in enumerate(robot.joints):
        terms = " + ".join(term.name for term in joint.terms)
        column = [row[i] for row in J_v if i < len(row)]
        size = math.hypot(*column)
        direction = [x / size if abs(x) > 0.005 * size else 0.0 for x in column if size > PRINTED_AS_ZERO]
        towards = ", ".join(f"{x:.2g}" for x in direction)
        up = robot.chain.up if robot.chain else (0.0, 0.0, 0.0)
        rises = sum(map(float.__mul__, column, up)) / (size or 1.0)
        side = ", down" if rises < -0.9 else ", up" if rises > 0.9 else ""
        where = f"; positive: the tip moves along ({towards}){side}{where_from}" if towards else ""
        yield f"{joint.name:>{width}}   {_moves(joint)}; effort in {joint.unit('{effort}')}: {terms}{where}"


def _directions(robot: "Robot", q: list[float]) -> tuple[list[list[float]], str]:
    """The Jacobian of the tip at a pose, or with all joints in mid-range if the pose is all zeros; and which it is."""
    from davinci_forces.maths.mechanics import kinematics

    if robot.chain is None:
        return [], ""
    ranges = [joint.limits.q for joint in robot.joints]
    middle = [0.5 * (low + high) if math.isfinite(high - low) else 0.0 for low, high in ranges]
    pose = q if any(q) else [*middle, *q[len(middle) :]]
    J_v, _ = kinematics.jacobian(robot.chain, pose)
    return J_v.tolist(), "" if any(q) else " in mid-range"


def _moves(joint: "Joint") -> str:
    """Kind and limits of a joint."""
    (low, high), (_, max_speed), max_effort = joint.limits.q, joint.limits.dq, joint.limits.effort
    position = joint.unit("{position}")
    words = [joint.kind.value, f"{low:g} to {high:g} {position}" if math.isfinite(high - low) else "unlimited"]
    words += [f"at most {max_speed:g} {position}/s"] if math.isfinite(max_speed) else []
    words += [f"at most {max_effort:g} {joint.unit('{effort}')}"] if math.isfinite(max_effort) else []
    constant = joint.unit(f"{joint.torque_constant:g} {{torque_constant}}")
    motor = f"gear ratio {joint.gear_ratio:g}, torque constant {constant}"
    words += [motor] if (joint.gear_ratio, joint.torque_constant) != (1.0, 1.0) else []
    return ", ".join(words)


def _numbers(values: list[float]) -> str:
    return " ".join(f"{value if abs(value) > PRINTED_AS_ZERO else 0.0:12.6g}" for value in values)
