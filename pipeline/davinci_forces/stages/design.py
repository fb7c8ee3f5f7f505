"""Compute what needs no logs: geometry, workspace, simulated controllers and excitation trajectories."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from davinci_forces.maths.excitation import fourier
from davinci_forces.maths.excitation.fourier import Fourier
from davinci_forces.maths.excitation.joint import ExcitationProblem, design
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import frames, jacobian, tip
from davinci_forces.maths.simulation.actuators import Regulator
from davinci_forces.records import Column, Control, Excitation, Links, Lyapunov, Pose, Workspace
from davinci_forces.robots.robot import ControlStudy, Joint, Robot

STARTS = 8  # random starts of the excitation's optimiser; `davinci-forces excite` uses more
GRID_POINTS = 11  # poses along each joint's range
MAX_GRID_JOINTS = 3  # joints that carry the tip; the wrist is left out
SETTLING_BAND = 0.02  # half-width, as a share of the step


def run(robot: Robot) -> Iterator[Links | Pose | Workspace | Control | Lyapunov | Excitation]:
    """Compute geometry, simulated control and excitation of a robot; without a geometry, only the excitation."""
    if robot.chain is not None:
        yield from geometry(robot, robot.chain)
        if robot.bodies is not None:
            yield from control(robot, robot.chain, robot.bodies)
    for joint in robot.joints:
        yield from excitations(joint)


def geometry(robot: Robot, chain: Chain) -> Iterator[Links | Pose | Workspace]:
    """The chain, the positions of its frames, and the workspace of its tip.  Tables 3.1, 4.2, Fig 3.5"""
    n = min(MAX_GRID_JOINTS, len(robot.joints))
    limits = np.array([joint.limits.q for joint in robot.joints[:n]])
    limited = bool(np.isfinite(limits).all())
    condition, names = np.array([]), np.array(chain.names, object)
    if limited:
        grid = np.array(list(product(*(np.linspace(low, high, GRID_POINTS) for low, high in limits.tolist()))))
        # Where the Jacobian is singular, the largest number stands for infinity, which no record holds.
        condition = np.minimum(np.linalg.cond(jacobian(chain, grid)[0]), np.finfo(float).max)
    worst = float(condition.max()) if limited else float("nan")
    yield links(robot, chain, worst if worst < np.finfo(float).max else float("nan"))
    poses = {"zero": np.zeros(n)} | ({"low": limits[:, 0], "high": limits[:, 1]} if limited else {})
    for name, q in poses.items():
        x, y, z = frames(chain, q)[:, :3, 3].T
        yield Pose(robot.name, name, names, names[chain.before], x, y, z)
    if limited:
        x, y, z = tip(chain, grid).T
        yield Workspace(robot.name, x, y, z, condition)


def links(robot: Robot, chain: Chain, worst_condition: float) -> Links:
    """The frames with their Denavit-Hartenberg parameters, and the masses of their links; NaN where unknown."""
    names = np.array(chain.names, object)
    link_masses = np.full(len(chain.links), np.nan) if robot.bodies is None else robot.bodies.masses
    masses = dict(zip(chain.links, link_masses.tolist(), strict=True))
    parameters = np.array([row[2:6] for row in chain.table] or [(np.nan,) * 4] * (len(chain.names) - 1)).T
    return Links(
        robot=robot.name,
        worst_condition=worst_condition,
        link=names[1:],
        parent=names[chain.before][1:],
        **dict(zip(("alpha", "a", "d", "offset"), parameters, strict=True)),
        moved_by=chain.moved_by[1:] + 1,
        mass=np.array([masses.get(name, 0.0) for name in chain.names[1:]]),
    )


def control(robot: Robot, chain: Chain, bodies: Bodies) -> Iterator[Control | Lyapunov]:
    """Simulate the robot's control studies with viscous friction.  Section 5.2, Fig 5.2-5.6"""
    from davinci_forces.maths.simulation.closed_loop import arm
    from davinci_forces.maths.simulation.continuous import regulate

    for study in robot.control:
        start, target, K_p, K_d, K_i, viscous = map(
            np.array, (study.start, study.target, study.proportional, study.derivative, study.integral, study.viscous)
        )
        law, rotors = Regulator(K_p, K_d, K_i, 1.0), np.zeros(len(start))
        plant, belief = (arm(chain, bodies.with_density_factor(share), rotors) for share in (1.0, study.known_masses))
        run = regulate(plant, belief, law, viscous, start, target, study.duration)
        for i, name in enumerate(robot.coordinates[: len(start)]):
            yield control_record(study, name, run.t, run.q[:, i], run.dq[:, i], start[i], target[i])
        rise = max(float(np.diff(run.V).max()), 0.0)
        yield Lyapunov(study.name, rise, float(run.V[0]), run.t, run.V)


def control_record(
    study: ControlStudy, joint: str, t: Column, q: Column, dq: Column, start: float, reference: float
) -> Control:
    """Overshoot, settling time and errors of one joint of a control study."""
    from scipy.interpolate import CubicHermiteSpline  # here, because every run imports this module

    between = CubicHermiteSpline(t, q, dq)  # the solver's steps grow to seconds as the errors die out
    step = reference - start
    overshoot = settling_time = float("nan")
    if step:
        overshoot = max(float(((q - reference) / step).max()), 0.0)
        if abs(q[-1] - reference) <= SETTLING_BAND * abs(step):
            edges = (reference + side * SETTLING_BAND * step for side in (-1, 1))
            settling_time = max(float(when) for edge in edges for when in between.solve(edge, extrapolate=False))
    later = [float(reference - between(when)) if when <= t[-1] else float("nan") for when in (10.0, 20.0)]
    return Control(
        controller=study.name,
        joint=joint,
        start=float(start),
        reference=float(reference),
        settling_time=settling_time,
        overshoot=overshoot,
        error_10=later[0],
        error_20=later[1],
        error_end=float(reference - q[-1]),
        t=t,
        q=q,
        dq=dq,
    )


def excitations(joint: Joint) -> Iterator[Excitation]:
    """The published excitations of a joint, and the optimal one within its limits.  (6.27), Table 6.1"""
    for source, (period, *x) in joint.published:
        yield excitation_record(joint, source, Fourier.from_coefficients(np.array(x), period))
    if joint.published and all(np.isfinite(pair).all() for pair in joint.limits.motion):
        period = joint.published[0][1][0]
        problem = ExcitationProblem(joint.terms, joint.limits.motion, period, 2, "determinant")
        yield excitation_record(joint, "found", design(problem, STARTS, 0)[0])


def excitation_record(joint: Joint, source: str, series: Fourier) -> Excitation:
    """A trajectory with its objective, its condition number and its excess over the limits."""
    F = fourier.observation(joint.terms, series)
    t = np.linspace(0.0, series.period, 401)
    motion = dict(zip(("q", "dq", "ddq"), fourier.motion(series, t), strict=True))
    ranges = zip(("excess_q", "excess_dq", "excess_ddq"), fourier.ranges(series), joint.limits.motion, strict=True)
    excesses = {name: float(max(low - least, most - high, 0.0)) for name, (least, most), (low, high) in ranges}
    return Excitation.like(
        series,
        joint=joint.name,
        source=source,
        objective=float(fourier.determinant(F)),
        condition=float(10 ** fourier.condition(F)),
        coefficients=tuple(series.x.tolist()),
        **excesses,
        t=t,
        **motion,
    )
