"""Rehearse the robot before anything is recorded: its chain, its controllers and its excitation, in simulation."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from pipeline.maths.excitation import fourier
from pipeline.maths.excitation.fourier import Fourier
from pipeline.maths.excitation.joint import ExcitationProblem, design
from pipeline.maths.mechanics import workspace
from pipeline.maths.mechanics.kinematics import frames, jacobian, tip
from pipeline.maths.simulation.control import Regulator
from pipeline.records import Column, Control, Excitation, Links, Lyapunov, Pose, Workspace
from pipeline.robots.robot import Joint, Robot

STARTS = 8  # of the excitation's optimiser; `davinci-forces excite` takes its time
GRID = 11  # places along each joint's range
ARM = 3  # joints that carry the tip
# Tables 5.1-5.4: gains of the six joints, the pose that is left or aimed at, and how long is watched [s].
K_P = (500.0, 500.0, 500.0, 10.0, 10.0, 1.0)
K_D = (50.0, 50.0, 40.0, 2.0, 0.2, 0.02)
K_I = (50.0, 50.0, 40.0, 2.0, 1.0, 0.1)
POSE = (-np.pi / 8, np.pi / 8, 0.2, -np.pi / 4, -np.pi / 4, -np.pi / 4)
STUDIES = (  # name, from the pose to zero, integral action, share of the masses that the compensator knows, duration
    ("pd-to-zero", True, False, 1.0, 3.0),
    ("pd-to-pose", False, False, 1.0, 3.0),
    ("pd-light", False, False, 0.9, 60.0),
    ("pid-light", False, True, 0.9, 60.0),
)
WRIST = ("instrument_roll", "instrument_pitch", "instrument_yaw")


def run(robot: Robot) -> Iterator[Links | Pose | Workspace | Control | Lyapunov | Excitation]:
    """What is known of a robot before its logs; of one without a geometry, the excitation of its joints only."""
    if robot.chain is not None and robot.bodies is not None:
        yield from geometry(robot)
        yield from control(robot)
    for joint in robot.joints:
        yield from excitations(joint)


def geometry(robot: Robot) -> Iterator[Links | Pose | Workspace]:
    """The chain, where its frames are, and where its tip can go.  Tables 3.1, 4.2, Fig 3.5"""
    chain, bodies = robot.chain, robot.bodies
    assert chain is not None
    assert bodies is not None
    limits = np.array([joint.limits.q for joint in robot.joints])
    grid = np.array(list(product(*(np.linspace(low, high, GRID) for low, high in limits.tolist()))))
    condition = workspace.condition(jacobian(chain, grid)[0][..., :ARM])
    x, y, z = tip(chain, grid).T
    names = np.array(chain.names, object)
    parents = names[[0, *chain.parent]]
    yield Links(
        robot=robot.name,
        worst_condition=float(condition.max()),
        link=names[1:],
        parent=parents[1:],
        alpha=chain.alpha,
        a=chain.a,
        d=chain.d,
        offset=chain.theta,
        moved_by=chain.coordinate + 1,
        mass=bodies.masses,
    )
    for name, q in (("zero", np.zeros(ARM)), ("low", limits[:, 0]), ("high", limits[:, 1])):
        origins = frames(chain, q)[:, :3, 3]
        yield Pose(robot.name, name, names, parents, *origins.T)
    yield Workspace(robot.name, x, y, z, condition)


def control(robot: Robot) -> Iterator[Control | Lyapunov]:
    """The studies of section 5.2, with friction that is viscous only.  Fig 5.2-5.6"""
    from pipeline.maths.simulation.continuous import regulate
    from pipeline.maths.simulation.plant import arm

    assert robot.chain is not None
    assert robot.bodies is not None
    rest, pose = np.zeros(len(POSE)), np.array(POSE)
    viscous = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])  # the initial guesses of Tables 6.4-6.6
    names = [*(joint.name for joint in robot.joints), *WRIST]
    for study, to_zero, integral, known, duration in STUDIES:
        law = Regulator(np.array(K_P), np.array(K_D), np.array(K_I) if integral else rest, 1.0)
        plant, belief = (arm(robot.chain, robot.bodies.scaled(share), rest) for share in (1.0, known))
        here, there = (pose, rest) if to_zero else (rest, pose)
        done = regulate(plant, belief, law, viscous, here, there, duration)
        for i, name in enumerate(names):
            yield watched(study, name, done.t, done.q[:, i], done.dq[:, i], here[i], there[i])
        yield Lyapunov(study, max(float(np.diff(done.V).max()), 0.0), done.t, done.V)


def watched(study: str, joint: str, t: Column, q: Column, dq: Column, start: float, reference: float) -> Control:
    """One joint of a study, with its errors as time goes on."""
    ten, twenty = (float(reference - np.interp(when, t, q)) for when in (10.0, 20.0))
    return Control(study, joint, float(start), float(reference), ten, twenty, float(reference - q[-1]), t, q, dq)


def excitations(joint: Joint) -> Iterator[Excitation]:
    """What has been published for a joint, and what the optimiser finds within its limits.  (6.27), Table 6.1"""
    for source, (period, *x) in joint.published:
        yield described(joint, source, Fourier.of(np.array(x), period))
    if joint.published and all(np.isfinite(pair).all() for pair in limits_of(joint)):
        period = joint.published[0][1][0]
        yield described(
            joint,
            "found",
            design(ExcitationProblem(joint.terms, limits_of(joint), period, 2, "determinant"), STARTS, 0),
        )


def limits_of(joint: Joint) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
    """Bounds of position, velocity and acceleration."""
    return joint.limits.q, joint.limits.dq, joint.limits.ddq


def described(joint: Joint, source: str, series: Fourier) -> Excitation:
    """A trajectory with its objective, its condition and by how much it leaves the limits."""
    F = fourier.observation(joint.terms, series)
    t = np.linspace(0.0, series.period, 401)
    q, dq, ddq = fourier.motion(series, t)
    ranges = zip(fourier.ranges(series), limits_of(joint), strict=True)
    excess = [float(max(low - found[0], found[1] - high, 0.0)) for found, (low, high) in ranges]
    return Excitation(
        joint=joint.name,
        source=source,
        period=series.period,
        objective=float(fourier.determinant(F)[0]),
        condition=float(10 ** fourier.condition(F)[0]),
        coefficients=tuple(series.x.tolist()),
        excess_q=excess[0],
        excess_dq=excess[1],
        excess_ddq=excess[2],
        t=t,
        q=q,
        dq=dq,
        ddq=ddq,
    )
