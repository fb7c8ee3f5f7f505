"""Joints that follow their trajectories exactly: the independent joint models, run backwards.  Section 6.1"""

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import Fourier, motion
from davinci_forces.maths.models.independent import regressor
from davinci_forces.simulation.motion import SimulatedMotion, SimulatedRun
from davinci_forces.simulation.scenario.scenario import Scenario, SimulatedLog


def simulate(scenario: Scenario, log: SimulatedLog) -> SimulatedRun:
    """The motion of every joint that is recorded."""
    t = np.arange(round(log.duration * scenario.rate)) / scenario.rate
    return SimulatedRun(t, {name: _joint(scenario, log, name, t) for name in log.joints})


def _joint(scenario: Scenario, log: SimulatedLog, name: str, t: Array) -> SimulatedMotion:
    simulated, move = scenario.joints[name], log.moves.get(name)
    if isinstance(move, Fourier):
        q, dq, ddq = motion(move, t)
    else:
        q, dq, ddq = log.position(name, t), np.zeros_like(t), np.zeros_like(t)
    tau_ext = sum((push.at(t) for push in log.external.get(name, ())), np.zeros_like(t))
    tau = regressor(simulated.joint.terms, q, dq, ddq) @ np.array(simulated.theta) + tau_ext
    return SimulatedMotion(q, dq, tau, tau_ext)
