"""The study.toml of a simulated study."""

import json
from collections.abc import Sequence
from pathlib import Path

from davinci_forces.maths.excitation.fourier import Fourier
from davinci_forces.simulation import closed_loop, writers
from davinci_forces.simulation.scenario.scenario import Scenario, SimulatedLog
from davinci_forces.simulation.sensors import SimulatedChannel


def study(scenario: Scenario, entries: Sequence[str]) -> str:
    """The whole file."""
    head = f"title = {toml(scenario.title)}\nrobot = {toml(scenario.robot.name)}\nsimulated = true\n"
    return "# Written by `davinci-forces simulate`: simulated data.\n" + "\n".join([head, *entries])


def entry(scenario: Scenario, log: SimulatedLog, path: Path, channels: Sequence[SimulatedChannel]) -> str:
    """The [[log]] of one recording."""
    lines = ["[[log]]", f"name = {toml(log.name)}", f"file = {toml(log.file)}", f"role = {toml(log.role)}"]
    periods = {move.period for move in log.moves.values() if isinstance(move, Fourier)}
    if len(periods) == 1 and log.role in ("identification", "validation"):
        lines.append(f"period = {toml(periods.pop())}")
    if log.skip:
        lines.append(f"skip = {toml(log.skip)}")
    if log.windows:
        lines.append(f"contact = {toml([list(window) for window in log.windows])}")
    if log.role == "weight":
        place = [round(float(x), 4) for x in closed_loop.hung_at(scenario)]
        joint = toml(scenario.robot.joints[-1].name)
        lines.append(f"weight = {{ mass = {toml(log.mass)}, moves_with = {joint}, position = {toml(place)} }}")
    lines.append("[log.channels]")
    for channel in channels:
        name = toml(writers.named(path, channel))
        if channel.quantity == "time":
            lines.append(f"time = {name}")
        else:
            lines.append(f"{toml(channel.quantity)} = {{ channel = {name}, unit = {toml(channel.unit)} }}")
    return "\n".join(lines) + "\n"


def toml(value: object) -> str:
    """A text, a number, true or false, or a list of them; TOML writes them as JSON does."""
    return json.dumps(value, ensure_ascii=False)
