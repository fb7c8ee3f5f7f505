"""The tables of a scenario that say how the whole arm is driven, and how it behaves: [arm] and [family.<name>]."""

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.simulation.actuators import Cascade, Motors, Regulator
from davinci_forces.maths.simulation.friction import Friction
from davinci_forces.robots.robot import Robot
from davinci_forces.simulation.scenario.scenario import Family, SensorNoise, SimulatedArm, SimulatedJoint
from davinci_forces.toml import TomlTable


def arm_of(table: TomlTable, robot: Robot, joints: dict[str, SimulatedJoint]) -> SimulatedArm:
    """Read [arm], [arm.control] and the families.  Every list has one number for each joint."""
    if robot.chain is None or robot.bodies is None:
        table.problem(f"the geometry and masses of {robot.name} are not known, so there is no arm to simulate", "arm")
    if list(joints) != [joint.name for joint in robot.joints]:
        table.problem(
            f"the whole arm needs [joint.<name>] of {', '.join(j.name for j in robot.joints)}, in that order", "joint"
        )
    arm, n = table.table("arm"), len(robot.joints)
    tick = arm.number("tick", above=0.0)
    rotors = _list(arm, "rotor_inertia", n)
    motors = Motors(
        gear_ratio=np.array([joint.gear_ratio for joint in robot.joints]),
        torque_constant=np.array([joint.torque_constant for joint in robot.joints]),
        encoder_step=np.array([joints[j.name].encoder_step if j.name in joints else 0.0 for j in robot.joints]),
        **{key: _list(arm, key, n, True) for key in ("resistance", "inductance", "current_limit", "voltage_limit")},
    )
    control = _control(arm.table("control"), n)
    arm.close()
    families = {name: _family(entry, robot) for name, entry in table.table("family").each()}
    if not families:
        table.problem("it has no [family.<name>], which says what friction and noise the arm has")
    return SimulatedArm(tick, rotors, motors, control, families)


def _control(table: TomlTable, n: int) -> Cascade | Regulator:
    """The law that `law` names: the laboratory's cascade, or the PID with gravity compensation of chapter 5."""
    law: Cascade | Regulator
    if table.text("law", "cascade", ("cascade", "pid")) == "pid":
        proportional, derivative, integral = (
            _list(table, key, n) for key in ("proportional", "derivative", "integral")
        )
        law = Regulator(proportional, derivative, integral, table.number("gravity", 1.0, low=0.0))
    else:
        law = Cascade(*(_list(table, key, n) for key in Cascade._fields))
    table.close()
    return law


def _list(table: TomlTable, key: str, n: int, positive: bool = False) -> Array:
    values = table.numbers(key, count=n)
    if any(value < 0 or (positive and value == 0) for value in values):
        table.problem(
            f"{key} must {'be greater than 0' if positive else 'not be negative'}, but is {list(values)}", key
        )
    return np.array(values if len(values) == n else [1.0] * n)


def _family(table: TomlTable, robot: Robot) -> Family:
    rows, noise = [], {}
    for joint in robot.joints:
        entry = table.table(joint.name)
        rows.append(_friction(entry))
        noise[joint.name] = noise_of(entry)
        entry.close()
    table.close()
    return Family(Friction(*(np.array(column) for column in zip(*rows, strict=True))), noise)


def _friction(table: TomlTable) -> tuple[float, ...]:
    coulomb = table.numbers("coulomb", count=2) or (1.0, 1.0)
    static = table.numbers("static", list(coulomb), count=2) or coulomb
    for key, values in (("coulomb", coulomb), ("static", static)):
        if min(values) < 0:
            table.problem(f"{key} must be two positive numbers, up and down, not {list(values)}", key)
    stiffness = table.number("bristle_stiffness", 0.0, low=0.0)
    if stiffness > 0 and min(coulomb) <= 0:
        table.problem("bristles need Coulomb friction greater than 0", "coulomb")
    velocity = table.number("stribeck_velocity", 0.01, above=0.0)
    damping = table.number("bristle_damping", 0.0, low=0.0)
    return (table.number("viscous", low=0.0), *coulomb, *static, velocity, stiffness, damping)


def noise_of(table: TomlTable) -> SensorNoise:
    """The noise of one joint."""
    values = table.table("noise")
    noise = SensorNoise(
        **{key: values.number(key, 0.0, low=0.0) for key in ("q", "dq", "tau", "drift")},
        correlation=values.number("correlation", 1.0, above=0.0),
    )
    values.close()
    return noise
