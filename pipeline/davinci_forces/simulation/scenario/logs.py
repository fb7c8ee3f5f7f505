"""Reading of the [[log]] tables of a scenario."""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path as File

import numpy as np

from davinci_forces.maths.excitation.fourier import Fourier
from davinci_forces.maths.simulation.surroundings import SHAPES, Path
from davinci_forces.robots.from_toml import NAME
from davinci_forces.simulation.scenario import ForceSensor, SimulatedJoint, SimulatedLog, SimulatedPush, Tissue
from davinci_forces.study.entries import ROLES
from davinci_forces.toml import TomlTable

FORMATS = (".tdms", ".lvm")


def logs_of(table: TomlTable, joints: dict[str, SimulatedJoint], families: Sequence[str]) -> tuple[SimulatedLog, ...]:
    """Read every [[log]]; a log of several families appears once for each, with the family in its name."""
    entries = table.tables("log", "it has no [[log]], so nothing would be recorded")
    logs = [(i, log) for i, entry in enumerate(entries) for log in _log(entry, joints, families)]
    for field in ("name", "file"):
        table.unique("log", field, ((i, getattr(log, field)) for i, log in logs), f"two logs have the {field}")
    return tuple(log for _, log in logs)


def _log(table: TomlTable, joints: dict[str, SimulatedJoint], families: Sequence[str]) -> list[SimulatedLog]:
    name, file = table.text("name"), table.text("file")
    if not NAME.fullmatch(name):
        table.problem(f"name must match [a-z0-9_-]+, not {name!r}", "name")
    if File(file).name != file or File(file).suffix not in FORMATS:
        table.problem(f"file must be a plain file name that ends in {' or '.join(FORMATS)}, not {file!r}", "file")
    duration = table.number("duration", above=0.0)
    role = table.text("role", choices=ROLES)
    moves = {key: _move(entry) for key, entry in table.table("moves").subtables()}
    held_table, external = table.table("held"), table.table("external")
    held = {key: held_table.number(key) for key in held_table.values}
    pushes = {key: tuple(_push(e, duration, False) for e in external.tables(key)) for key in external.values}
    _check_joints(table, joints, set(moves), set(held), set(pushes))
    clock = table.text("clock", "channel", ("channel", "header"))
    unit = table.text("current_unit", "A", ("A", "mA"))
    log = SimulatedLog(name, file, role, duration, moves, held, pushes, unit, clock)
    logs = _of_arm(table, log, joints, families) if families else [log]
    for key in (key for key, move in moves.items() if isinstance(move, Path) and not families):
        problem = f"moves.{key} is a path; joints that follow their model exactly need a Fourier series"
        table.problem(problem, "moves", key)
    return logs


def _check_joints(
    table: TomlTable, joints: dict[str, SimulatedJoint], moving: set[str], still: set[str], pushed: set[str]
) -> None:
    for entry, keys in (("moves", moving), ("held", still), ("external", pushed)):
        for key in keys - set(joints):
            table.problem(f"there is no [joint.{key}]; there are {', '.join(joints)}", entry, key)
    for key in moving & still:
        table.problem(f"{key} both moves and is held", "held", key)
    for key in pushed - moving - still:
        table.problem(f"{key} has a contact but is not recorded; name it in moves or in held", "external", key)
    if not moving:
        table.problem("no joint moves; add a table moves")


def _of_arm(
    table: TomlTable, log: SimulatedLog, joints: dict[str, SimulatedJoint], families: Sequence[str]
) -> list[SimulatedLog]:
    """Read the entries for the whole arm, and return one log for each family."""
    lead, skip = table.number("lead", 0.0, low=0.0), table.number("skip", 0.0, low=0.0)
    if skip >= log.duration:
        table.problem(f"skip = {skip:g} s leaves nothing of {log.duration:g} s", "skip")
    for name, joint in joints.items():
        start, (low, high) = float(log.position(name, np.array([-lead]))[0]), joint.stops
        if start < low or start > high:
            tables = {**dict.fromkeys(log.held, "held"), **dict.fromkeys(log.moves, "moves")}
            keys = (tables[name], name) if name in tables else ()
            table.problem(f"{name} starts at {start:g}, beyond its stops {low:g} and {high:g}", *keys)
    mass = table.number("mass", 0.0, low=0.0)
    tip = tuple(_push(entry, log.duration, True) for entry in table.tables("tip"))
    tissue, sensor = None, None
    if "tissue" in table:
        entry = table.table("tissue")
        damping = entry.number("damping", 0.0, low=0.0)
        tissue = Tissue(entry.number("surface"), entry.number("stiffness", above=0.0), damping)
    if "sensor" in table:
        entry = table.table("sensor")
        sensor = ForceSensor(entry.number("noise", 0.0, low=0.0), entry.number("lag", 0.0, low=0.0))
    recorded_families = table.texts("families", list(families), families)
    roles_table = table.table("role_in")
    roles = {family: roles_table.text(family, log.role, ROLES) for family in families}
    shared = replace(log, lead=lead, skip=skip, mass=mass, tip=tip, tissue=tissue, sensor=sensor)
    if len(families) == 1:
        return [replace(shared, family=families[0], role=roles[families[0]])]
    return [
        replace(shared, name=f"{name}-{log.name}", file=f"{name}_{log.file}", family=name, role=roles[name])
        for name in recorded_families
    ]


def _move(table: TomlTable) -> Fourier | Path:
    if "path" in table:
        points = table.pairs("path", "a list of two or more pairs of numbers", least=2)
        ease = table.flag("ease", False)
        if any(b[0] <= a[0] for a, b in pairwise(points)):
            table.problem("the times of path must increase", "path")
        return Path(points or ((0.0, 0.0), (1.0, 0.0)), ease)
    a, b = table.numbers("a"), table.numbers("b")
    if len(a) != len(b) or not a:
        table.problem(f"a and b must have one number for each harmonic, not {len(a)} and {len(b)}")
        a = b = (0.0,)
    return Fourier(table.number("a0", 0.0), a, b, table.number("period", above=0.0))


def _push(table: TomlTable, duration: float, at_tip: bool) -> SimulatedPush:
    shape = table.text("shape", choices=SHAPES)
    start, end = table.number("start", low=0.0), table.number("end")
    direction = None
    if at_tip:
        force = table.numbers("force", count=3) or (0.0, 0.0, 1.0)
        peak = math.hypot(*force) or 1.0
        x, y, z = (part / peak for part in force)
        direction = (x, y, z)
    else:
        peak = table.number("peak")
    if end <= start:
        table.problem(f"end must be after start = {start:g}, not {end:g}", "end")
    if end > duration and not math.isnan(duration):
        table.problem(f"end = {end:g} s is after the end of the recording at {duration:g} s", "end")
    return SimulatedPush(shape, start, end, peak, direction)
