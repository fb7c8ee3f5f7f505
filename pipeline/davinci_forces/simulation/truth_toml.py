"""The truth.toml of a simulated study: the ground truth that the report, and nothing else, compares estimates with."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from davinci_forces.simulation import closed_loop
from davinci_forces.simulation.motion import SimulatedRun
from davinci_forces.simulation.scenario.scenario import Scenario, SensorNoise, SimulatedLog, SimulatedPush
from davinci_forces.simulation.study_toml import toml


def truth(scenario: Scenario, entries: Sequence[str]) -> str:
    """The whole file: the parameters and the noise of each joint, by family where there are any, then the logs."""
    lines = ["# What is true of the simulated recordings of this study.", "simulated = true"]
    lines += [f"scenario = {toml(scenario.name)}", f"seed = {scenario.seed}"]
    if scenario.arm is None:
        lines += _theta("theta", scenario, {name: np.array(j.theta) for name, j in scenario.joints.items()})
        for name, simulated in scenario.joints.items():
            lines += _noise(f"noise.{name}", simulated.noise)
    else:
        for name, family in scenario.arm.families.items():
            lines += _theta(f"theta.{name}", scenario, closed_loop.theta(scenario, name))
            for joint, noise in family.noise.items():
                lines += _noise(f"noise.{name}.{joint}", noise)
    return "\n".join([*lines, "", *entries])


def entry(log: SimulatedLog, run: SimulatedRun) -> str:
    """The [[log]] of one recording: what was pushed when, what hung there, and when anything was touched at all."""
    lines = ["[[log]]", f"name = {toml(log.name)}", f"role = {toml(log.role)}"]
    if log.family:
        lines.append(f"family = {toml(log.family)}")
    if log.mass:
        lines.append(f"mass = {toml(log.mass)}")
    if log.sensor:
        lines.append(f"sensor = {{ noise = {toml(log.sensor.noise)}, lag = {toml(log.sensor.lag)} }}")
    if log.tissue:
        lines += [f"stiffness = {toml(log.tissue.stiffness)}", f"surface = {toml(log.tissue.surface)}"]
        lines.append(f"touched = {toml(touched(run))}")
    for joint, pushes in log.external.items():
        for push in pushes:
            lines += ["", "[[log.push]]", f"joint = {toml(joint)}", *_push(push)]
    for push in log.tip:
        lines += ["", "[[log.push]]", f"direction = {toml(push.direction)}", *_push(push)]
    return "\n".join(lines) + "\n"


def touched(run: SimulatedRun) -> list[list[float]]:
    """When the tip touched something: [onset, end] of each time [s], to a sample."""
    if run.force is None:
        return []
    contact = np.concatenate([[False], np.linalg.norm(run.force, axis=1) > 0, [False]])
    edges = np.flatnonzero(contact[1:] != contact[:-1])
    return [[float(run.t[start]), float(run.t[end - 1])] for start, end in edges.reshape(-1, 2).tolist()]


def _theta(place: str, scenario: Scenario, parameters: dict[str, NDArray[np.float64]]) -> list[str]:
    lines = []
    for name, values in parameters.items():
        terms = scenario.robot.joint(name).terms
        lines += ["", f"[{place}.{name}]"]
        lines += [f"{toml(t.name)} = {toml(p)}" for t, p in zip(terms, values.tolist(), strict=True)]
    return lines


def _noise(place: str, noise: SensorNoise) -> list[str]:
    return ["", f"[{place}]", *(f"{key} = {toml(value)}" for key, value in vars(noise).items())]


def _push(push: SimulatedPush) -> list[str]:
    return [f"{key} = {toml(getattr(push, key))}" for key in ("shape", "start", "end", "peak")]
