"""Assign channels to joints and quantities by names: of the joints of a robot, or by numbers and labels in them."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from davinci_forces.logs.log import Channel
from davinci_forces.maths.units import canonical, measures, unit_in
from davinci_forces.robots.robot import Joint, Kind, Robot
from davinci_forces.study import names
from davinci_forces.study.holding import BY_FILE, BY_NUMBER, Holding, Meaning

AT_MOTOR = {"q": "theta_m", "dq": "dtheta_m"}
SYMBOL_OF_UNIT = {  # of what a unit measures
    "angle": "q", "length": "q", "angle rate": "dq", "length rate": "dq", "current": "i", "torque": "tau",
    "force": "tau",
}  # fmt: skip
MOTOR_TORQUE = "CHECK: a torque of the motor needs scale = <gear ratio>, as a study takes the effort at the joint"
JOINT_NUMBER = re.compile(r"(?<![a-z])(?:joint|axis|motor|j)[\s_-]*(\d{1,2})(?!\d)", re.IGNORECASE)


def by_joint_names(channels: Sequence[Channel], robot: Robot) -> Holding:
    """Assign channels whose names name a joint of the robot: `Roll motor angle`."""
    named = list(_naming_joints(channels, robot))
    bare = [(channel, joint) for channel, joint in named if _says_only(robot.joints[joint], channel)]
    meanings: dict[str, Meaning] = {}
    for channel, joint in (pair for pair in named if pair not in bare):
        words = _words(channel)
        # Beside a joint, a force is its effort; the force at the tip is none.
        symbol = names.symbol_of(words) or (names.symbol_of(["tau", *words]) if names.FORCE_WORDS & {*words} else "")
        before_unit = names.words_of(names.without_unit(_full_name(channel)))
        symbol = _side(symbol, before_unit, channel.unit, robot.joints[joint])
        if symbol and (symbol, joint) not in [(m.symbol, m.joint) for m in meanings.values()]:
            reason = MOTOR_TORQUE if symbol == "tau" and "motor" in words else "by the joint in its name"
            meanings[channel.name] = Meaning(symbol, joint, reason)
    return Holding(with_one_effort(_by_unit(bare, robot, meanings)), len(robot.joints), robot=robot)


def _naming_joints(channels: Sequence[Channel], robot: Robot) -> Iterator[tuple[Channel, int]]:
    """Yield the channels whose names name one joint of a robot, with the joint; rough signals come last."""
    signals = [channel for channel in channels if not names.is_time(channel)]
    named = [{*_words(channel)} for channel in signals]
    of_the_kit = all(any(label & words for words in named) for label in (names.INSERTION_WORDS, {"yaw"}))
    of_the_kit |= any({"outer", "yaw"} <= words for words in named)
    for channel in sorted(signals, key=lambda channel: bool(names.ROUGH_WORDS & {*_words(channel)})):
        words = _words(channel)
        if of_the_kit:
            joints = [k for k, joint in enumerate(robot.joints) if joint.name == names.psm_joint(words)]
        else:
            joints = [k for k, joint in enumerate(robot.joints) if _names(joint, words, _full_name(channel))]
        if len(joints) == 1:
            yield channel, joints[0]


def _by_unit(bare: Sequence[tuple[Channel, int]], robot: Robot, meanings: Mapping[str, Meaning]) -> dict[str, Meaning]:
    """Add what the units of channels tell whose names say a joint alone: `roll (deg)`, but not `roll (V)`."""
    measured = [(joint, measures(canonical(names.stated_unit(channel))) or "") for channel, joint in bare]
    added = dict(meanings)
    for (channel, joint), (_, kind) in zip(bare, measured, strict=True):
        symbol = SYMBOL_OF_UNIT.get(kind, "q")
        known = {AT_MOTOR.get(m.symbol, m.symbol) for m in added.values() if m.joint == joint}
        # Without a unit it is a position to be checked: `roll actual`, beside `roll current actual`.
        if AT_MOTOR.get(symbol, symbol) not in known and (kind or not names.stated_unit(channel)):
            what = {"q": "position", "dq": "velocity", "i": "current"}.get(symbol, "effort")
            is_sure = kind in SYMBOL_OF_UNIT and measured.count((joint, kind)) == 1
            reason = f"{what} of the joint, by its unit" if is_sure else f"CHECK: {what}, as its name says no quantity"
            added[channel.name] = Meaning(_side(symbol, (), channel.unit, robot.joints[joint]), joint, reason)
    return added


def _full_name(channel: Channel) -> str:
    return channel.alias or channel.name


def _words(channel: Channel) -> list[str]:
    return names.words_of(_full_name(channel))


def by_numbers(channels: Sequence[Channel]) -> Holding:
    """Assign joints by the number or label of a channel among those of one name: `q1`, `effort[outer_yaw]`."""
    groups: dict[str, names.Numbered] = {}
    for group in names.joint_groups(channels):
        first_group = groups.setdefault(group.symbol, group)
        if "motor" in group.words:  # of joints that are measured there alone
            groups[group.symbol] = replace(first_group, names=group.names | first_group.names)
    if "q" not in groups or not groups.keys() & {"tau", "i"}:
        return Holding()
    labels = [*groups["q"].names]
    numbers = [int(label) for label in labels if label.isdecimal()]
    first = min(numbers) if numbers and min(numbers) <= 1 else 0
    units = {channel.name: names.stated_unit(channel) for channel in channels}
    meanings: dict[str, Meaning] = {}
    for symbol, group in groups.items():
        usual = {"q": "deg", "dq": "deg/s"}.get(symbol, "") if names.IN_DEGREES & {*group.words} else ""
        for label, name in group.names.items():
            if label.isdecimal() and len(numbers) == len(labels):
                joint, reason = int(label) - first, BY_NUMBER
            elif label in labels:
                joint, reason = labels.index(label), f"joint {label!r}" if label else "by its name"
            else:
                continue
            meanings[name] = Meaning(_side_by_name(symbol, name), joint, reason, "" if units[name] else usual)
    meanings = with_one_effort(meanings)
    joints = 1 + max(meaning.joint for meaning in meanings.values())
    return Holding(meanings, joints, () if numbers else tuple(labels))


def by_words(channels: Sequence[Channel]) -> Holding:
    """Assign joints by what names say beside the quantity, alike for positions and efforts: `base_pos`, `torqueA`."""
    named: dict[str, dict[str, str]] = {}
    for channel in channels:
        words = names.words_of(names.without_unit(channel.name))
        if not names.is_time(channel) and (symbol := names.symbol_of(words)):
            label = "_".join(word for word in words if word not in ("motor", *names.SIGNAL_WORDS[symbol]))
            named.setdefault(symbol, {}).setdefault(label, channel.name)
    labels = [*named.get("q", ())]
    alike = any(set(named.get(effort, ())) == set(labels) for effort in ("tau", "i"))
    in_labels = {word for label in labels for word in label.split("_")}
    if len(labels) < 2 or not alike or in_labels & names.PROCESSED_WORDS:
        return Holding()
    meanings = {
        name: Meaning(_side_by_name(symbol, name), labels.index(label), f"joint {label!r}")
        for symbol, by_label in named.items() for label, name in by_label.items() if label in labels
    }  # fmt: skip
    return Holding(with_one_effort(meanings), len(labels), tuple(labels))


def by_file_name(holding: Holding, name: str, robots: Sequence[Robot], first: int) -> Holding:
    """Assign the one joint of a log by the name of its file and folders, in which numbers count from `first`."""
    words, number = names.words_of(name), JOINT_NUMBER.search(name)
    for robot in robots:
        joints = [k for k, joint in enumerate(robot.joints) if _names(joint, words, name)]
        if len(joints) == 1:
            named, joint = holding.with_joints(joints).with_reasons(lambda _: BY_FILE), robot.joints[joints[0]]
            sides = {n: _side(m.symbol, (), holding.units.get(n, ""), joint) for n, m in named.meanings.items()}
            meanings = {n: replace(m, symbol=sides[n]) for n, m in named.meanings.items()}
            return replace(named, joints=len(robot.joints), meanings=meanings, robot=robot, labels=())
    if number and int(number[1]) >= first:
        return replace(holding.with_joints([int(number[1]) - first]).with_reasons(lambda _: BY_FILE), labels=())
    return holding


def with_one_effort(meanings: dict[str, Meaning]) -> dict[str, Meaning]:
    """Leave out the currents of joints with efforts: a study takes one, and an effort needs no drive constant."""
    with_effort = {meaning.joint for meaning in meanings.values() if meaning.symbol == "tau"}
    return {name: m for name, m in meanings.items() if m.symbol != "i" or m.joint not in with_effort}


def _side_by_name(symbol: str, name: str) -> str:
    """The symbol on the motor's side where the channel's name says so."""
    return AT_MOTOR.get(symbol, symbol) if "motor" in names.words_of(name) else symbol


def _side(symbol: str, words: Sequence[str], unit: str, joint: Joint) -> str:
    """The symbol on the joint's or the motor's side, by the channel's name or by a unit that only one side has."""
    by_name = "motor" in words or ("m" in words and {"theta", "dtheta", "omega"} & {*words})
    return AT_MOTOR.get(symbol, symbol) if by_name or (is_angle(unit) and joint.kind is Kind.PRISMATIC) else symbol


def is_angle(unit: str) -> bool:
    """Whether a unit is of an angle or its rate."""
    return str(measures(canonical(unit))).startswith("angle")


def _names(joint: Joint, words: Sequence[str], name: str) -> bool:
    parts = names.words_of(joint.name)
    last = parts[-1] if not parts[-1].isdecimal() else ""
    inserts = any(names.PSM_JOINTS[word] == joint.name for word in names.INSERTION_WORDS & {*words})
    return joint.name in name.lower() or set(parts) <= set(words) or last in words or inserts


def _says_only(joint: Joint, channel: Channel) -> bool:
    """Whether the name of a channel says nothing but the joint, and perhaps a unit."""
    name = _full_name(channel)
    words = {*names.words_of(names.without_unit(name))} - {*names.words_of(unit_in(name)), "in"}
    return words <= {*names.words_of(joint.name), *names.PROCESSED_WORDS, *names.INSERTION_WORDS}
