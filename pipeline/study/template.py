"""A first study.toml for logs, from the names and units of their channels."""

import json
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from pipeline import robots
from pipeline.errors import BadRequest
from pipeline.logs import open_log
from pipeline.logs.log import Channel, Log
from pipeline.maths.units import SI, canonical, measures
from pipeline.robots.robot import Joint, Robot
from pipeline.study.channels import OF_THE_LOG
from pipeline.study.tissue_channels import is_tissue, tissue_channels, unit_of

TIME = ("time", "t", "t_s", "elapsed", "x_value", "seconds")
# Words of a channel's name that tell what it holds, the telling ones first.
WORDS = {
    "i": ("current", "amp", "i"),
    "dq": ("velocity", "speed", "rate", "dq", "vel"),
    "tau": ("torque", "effort", "force", "tau"),
    "q": ("position", "angle", "pos", "q", "theta"),
}


def describe(files: Sequence[Path], folder: Path, robot_name: str) -> str:
    """The text of a study.toml that names every channel of every log and guesses what each holds.

    Raises
    ------
    BadRequest
        If a log lies outside the study's folder.
    BadLog, BadRobot
        If a log or the robot cannot be read.
    """
    robot = robots.load(robot_name, folder)
    for file in files:
        if not file.resolve().is_relative_to(folder.resolve()):
            raise BadRequest(f"{file} lies outside {folder}; a study holds its own logs: put it there first")
    head = [
        f"title = {_text(folder.resolve().name)}",
        f"robot = {_text(robot_name)}  # {robot.title}: joints {', '.join(j.name for j in robot.joints)}",
        "simulated = false",
        *([f"# tool = {{ length = {robot.tool.length} }}  # [m] of the shaft of the tool"] if robot.tool else []),
        "",
        "[settings]  # every key has a default; the report prints what was used",
        "# lowpass = 17.0  # [Hz] zero-phase, where velocities and accelerations are differences",
    ]
    return "\n".join([*head, *(line for file in files for line in _log(file, folder, robot))]) + "\n"


def _log(file: Path, folder: Path, robot: Robot) -> Iterator[str]:
    log = open_log(file)
    touching = _touching(log, robot)
    tissue = is_tissue([*touching.values()])
    yield ""
    yield "[[log]]"
    yield f"name = {_text(re.sub(r'[^a-z0-9_-]+', '-', file.name.partition('.')[0].lower()).strip('-') or 'log')}"
    yield f"file = {_text(file.resolve().relative_to(folder.resolve()).as_posix())}"
    role = "tissue" if tissue else "identification"
    yield f'role = "{role}"  # identification, validation, contact, weight, tissue or friction'
    if not tissue:
        yield "# period = 10.0  # [s] found from the data; a stated one is checked against them"
    if not log.clock and not log.time and not any(_is_time(c) for c in log.channels):
        needs = "pushes need none, but for the damping of the tissue" if tissue else "CORRECT THIS"
        yield f"{'# ' if tissue else ''}rate = 100.0  # [Hz] the log carries no clock: {needs}"
    yield "# skip = 1.0  # [s] start-up transient to leave out"
    yield "# until = 60.0  # [s] where the log ends: what comes after, a stop for instance, is left out"
    if tissue:
        yield '# contact = "all"  # where every sample is of contact; else contact is found'
    else:
        yield "# contact = [[12.0, 14.5]]  # [s] known contact windows"
    yield "[log.channels]"
    yield from _channels(log, robot, touching if tissue else {})


def _touching(log: Log, robot: Robot) -> dict[str, str]:
    """Channels that tell of pushes into tissue, by name, where no channel is of a joint."""
    return (
        {}
        if any(_guess(channel, robot) not in ("", "time") for channel in log.channels)
        else tissue_channels([channel for channel in log.channels if not _is_time(channel)])
    )


def _channels(log: Log, robot: Robot, touching: dict[str, str]) -> Iterator[str]:
    taken: set[str] = set()
    for channel in log.channels:
        if channel.derived:
            continue
        if quantity := touching.get(channel.name):
            yield _touched(channel, quantity)
            continue
        guess = _guess(channel, robot)
        known = f"  # in {channel.unit}" if channel.unit else "  # the log gives no unit: SI is taken"
        if guess and guess not in taken and channel.kind == "number":
            taken.add(guess)
            yield f"{_text(guess) if '.' in guess else guess} = {_text(channel.name)}{known}"
        else:
            yield f'# "<joint>.<quantity>" = {_text(channel.name)}{known}'
    yield "# quantities of a joint: q or theta_m, dq or dtheta_m, tau or i"
    yield "# of the log: time, and for tissue push, depth or tip_x, tip_y, tip_z, force or force_x, force_y, force_z"


def _touched(channel: Channel, quantity: str) -> str:
    if quantity == "push":
        return f"push = {_text(channel.name)}  # number of the push"
    unit = unit_of(channel, quantity)
    where = "" if channel.unit else "  # by its name" if unit else "  # the log gives no unit: CHECK THIS"
    return (
        f"{quantity} = {{ channel = {_text(channel.name)}, unit = {_text(unit or SI[OF_THE_LOG[quantity]])} }}{where}"
    )


def _guess(channel: Channel, robot: Robot) -> str:
    if _is_time(channel):
        return "time"
    words = re.findall(r"[a-z]+|\d+", channel.name.lower())
    joints = [joint for joint in robot.joints if _named(joint, words, channel.name)]
    symbol = next((s for s, telling in WORDS.items() if set(telling) & set(words)), "")
    if len(joints) != 1 or not symbol:
        return ""
    return f"{joints[0].name}.{_side(symbol, words, channel, joints[0])}"


def _side(symbol: str, words: Sequence[str], channel: Channel, joint: Joint) -> str:
    """The joint's or the motor's side, by the channel's name or by a unit that only one of them has."""
    unit = measures(canonical(channel.unit))
    motor = "motor" in words or (unit == "angle" and joint.unit("{position}") == "m")
    return {"q": "theta_m", "dq": "dtheta_m"}.get(symbol, symbol) if motor else symbol


def _named(joint: Joint, words: Sequence[str], name: str) -> bool:
    parts = joint.name.split("_")
    return joint.name in name.lower() or set(parts) <= set(words) or parts[-1] in words


def _is_time(channel: Channel) -> bool:
    return channel.name.lower().rpartition("/")[2].split(" ")[0] in TIME


def _text(value: str) -> str:
    return json.dumps(value, ensure_ascii=False)
