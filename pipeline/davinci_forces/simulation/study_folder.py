"""Write simulated studies: logs, study.toml and truth.toml, which are moved into place when all are complete."""

import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from davinci_forces.errors import BadRequest
from davinci_forces.maths.excitation.fourier import Fourier
from davinci_forces.maths.signals.windows import spans
from davinci_forces.simulation import sensors
from davinci_forces.simulation.motion import SimulatedMotion, SimulatedRun, simulate_log, theta
from davinci_forces.simulation.scenario import Scenario, SimulatedLog
from davinci_forces.simulation.sensors import SimulatedChannel, generator, record, record_force
from davinci_forces.toml import in_toml

STUDY, TRUTH = "study.toml", "truth.toml"


def write(scenario: Scenario, folder: Path, force: bool, say: Callable[[str], None]) -> None:
    """Simulate every log, and move the study into place when it is complete; `say` reports each log.

    Without `force`, logs and truth.toml are put beside the scenario's study.toml, and no other file changes.
    Raises BadRequest if `check` refuses the folder, or it holds another study.toml or a file with the name of a log.
    """
    check(folder, force)
    text = study_text(scenario)
    beside = not force and (folder / STUDY).is_file()
    if beside:
        _check_study(scenario, folder, text)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}-") as temporary:
        new, old = Path(temporary) / "new", Path(temporary) / "old"
        new.mkdir()
        truths = [_log(scenario, log, new, say) for log in scenario.logs]
        (new / TRUTH).write_text(truth_text(scenario, truths), encoding="utf-8", newline="\n")
        if beside:
            for name in (*(log.file for log in scenario.logs), TRUTH):
                (new / name).replace(folder / name)
        else:
            (new / STUDY).write_text(text, encoding="utf-8", newline="\n")
            if folder.exists():
                folder.rename(old)
            shutil.move(new, folder)
    size = sum((folder / log.file).stat().st_size for log in scenario.logs)
    say(f"{folder}: {len(scenario.logs)} simulated logs, {size / 1e6:.2f} MB")


def check(folder: Path, force: bool) -> None:
    """Refuse to replace a folder, except a simulated study with `force`, or to fill one that has no study.toml."""
    if folder.exists() and not folder.is_dir():
        raise BadRequest(f"{folder} is a file; name a folder that does not exist yet")
    if not folder.is_dir() or not any(folder.iterdir()):
        return
    simulated = (folder / TRUTH).is_file()
    if not force and (simulated or not (folder / STUDY).is_file()):
        raise BadRequest(f"{folder} is not empty; name another folder, or replace it with --force")
    if force and not simulated:
        raise BadRequest(f"{folder} has no {TRUTH}, so it is not a simulated study; --force does not replace it")


def _check_study(scenario: Scenario, folder: Path, text: str) -> None:
    """Refuse to put logs beside a study.toml that is not the scenario's, or in place of other files."""
    if (folder / STUDY).read_text(encoding="utf-8", errors="replace") != text:
        raise BadRequest(f"{folder / STUDY} is not what {scenario.name} writes; restore it, or name another folder")
    present = {file.name for file in folder.iterdir()}  # links to nothing, too
    for log in scenario.logs:
        if log.file in present:
            raise BadRequest(f"{folder / log.file} exists already; remove it, or name another folder")


def _log(scenario: Scenario, log: SimulatedLog, folder: Path, say: Callable[[str], None]) -> str:
    run = simulate_log(scenario, log)
    path = folder / log.file
    sensors.write(path, record_channels(scenario, log, run), scenario.rate, scenario.started)
    size = path.stat().st_size / 1e6
    say(f"{log.name}: {len(run.t)} samples of {', '.join(log.joints)} -> {log.file}, {size:.2f} MB")
    return truth_entry(log, run)


def record_channels(scenario: Scenario, log: SimulatedLog, run: SimulatedRun) -> list[SimulatedChannel]:
    """Record the channels of one log, with the noise of the scenario's seed."""
    channels = [SimulatedChannel("time", "Time", "s", run.t)] if log.clock == "channel" else []
    late = generator(scenario.seed, log.name, "clock").normal(0.0, scenario.clock_jitter, len(run.t))
    for name, true in run.motions.items():
        motion = true.interpolate(run.t, run.t + late) if scenario.clock_jitter else true
        random = generator(scenario.seed, log.name, name)
        noise = scenario.arm.families[log.family].noise[name] if scenario.arm else scenario.joints[name].noise
        channels += record(scenario.joints[name], motion, noise, scenario.rate, log.current_unit, random)
    if log.sensor and run.force is not None:
        channels += record_force(log.sensor, run.t, run.force, generator(scenario.seed, log.name, "force"))
    return channels


def study_text(scenario: Scenario) -> str:
    """The text of study.toml, which does not depend on the samples."""
    head = f"title = {in_toml(scenario.title)}\nrobot = {in_toml(scenario.robot.name)}\nsimulated = true\n"
    head += f"\n[settings]\nharmonics = {scenario.harmonics}\n" if scenario.harmonics else ""
    entries = (study_entry(scenario, log) for log in scenario.logs)
    return "# Written by `davinci-forces simulate`: simulated data.\n" + "\n".join([head, *entries])


def study_entry(scenario: Scenario, log: SimulatedLog) -> str:
    """The [[log]] of one recording in study.toml."""
    t = np.zeros(2)
    at_rest = SimulatedRun(t, {name: SimulatedMotion(t, t, t, t) for name in log.joints}, np.zeros((2, 3)))
    periods = {move.period for move in log.moves.values() if isinstance(move, Fourier)}
    period = periods.pop() if len(periods) == 1 and log.role in ("identification", "validation") else None
    weight = {"mass": log.mass} if log.role == "weight" else None
    optional = {"period": period, "skip": log.skip, "contact": log.windows, "weight": weight}
    keys = {"name": log.name, "file": log.file, "role": log.role} | {k: x for k, x in optional.items() if x}
    channels: dict[str, object] = {}
    for channel in record_channels(scenario, log, at_rest):
        name = sensors.channel_name(Path(log.file), channel)
        if channel.quantity == "time":
            channels["time"] = name
        else:
            channels[in_toml(channel.quantity)] = {"channel": name, "unit": channel.unit}
    return "\n".join(["[[log]]", *_pairs(keys), "[log.channels]", *_pairs(channels)]) + "\n"


def truth_text(scenario: Scenario, entries: Sequence[str]) -> str:
    """The text of truth.toml: what was put into each joint, for each family if there are any; then the logs."""
    head = {"simulated": True, "scenario": scenario.name, "seed": scenario.seed}
    head |= {"clock_jitter": scenario.clock_jitter} if scenario.clock_jitter > 0.0 else {}
    lines = ["# What is true of the simulated recordings of this study.", *_pairs(head)]
    if scenario.arm is None:
        lines += _theta("theta", scenario, {name: np.array(j.theta) for name, j in scenario.joints.items()})
        for name, simulated in scenario.joints.items():
            lines += _table(f"noise.{name}", vars(simulated.noise))
    else:
        for name, family in scenario.arm.families.items():
            lines += _theta(f"theta.{name}", scenario, theta(scenario, name))
            for i, (joint, noise) in enumerate(family.noise.items()):
                lines += _table(f"noise.{name}.{joint}", vars(noise))
                friction = {key: float(values[i]) for key, values in family.friction._asdict().items()}
                lines += _table(f"friction.{name}.{joint}", friction)
        motors = {"rotor_inertia": scenario.arm.rotors} | scenario.arm.motors._asdict()
        lines += _table("motors", {key: values.tolist() for key, values in motors.items()})
    return "\n".join([*lines, "", *entries])


def truth_entry(log: SimulatedLog, run: SimulatedRun) -> str:
    """The [[log]] of one recording in truth.toml: its pushes, its mass, and its times of contact."""
    optional = {"family": log.family, "mass": log.mass, "sensor": log.sensor and vars(log.sensor)}
    keys = {"name": log.name, "role": log.role} | {key: value for key, value in optional.items() if value}
    if log.tissue:
        keys |= {"stiffness": log.tissue.stiffness, "surface": log.tissue.surface, "touched": contact_times(run)}
    lines = ["[[log]]", *_pairs(keys)]
    joint_pushes = [(joint, push) for joint, pushes in log.external.items() for push in pushes]
    for joint, push in [*joint_pushes, *(("", push) for push in log.tip)]:
        target = {"joint": joint} if joint else {"direction": push.direction}
        shape = {key: getattr(push, key) for key in ("shape", "start", "end", "peak")}
        lines += ["", "[[log.push]]", *_pairs({**target, **shape})]
    return "\n".join(lines) + "\n"


def contact_times(run: SimulatedRun) -> list[list[float]]:
    """The contacts of the tip: [onset, end] [s] of each, accurate to one sample."""
    return [] if run.force is None else [[*span] for span in spans(run.t, np.linalg.norm(run.force, axis=1) > 0)]


def _theta(place: str, scenario: Scenario, parameters: dict[str, NDArray[np.float64]]) -> list[str]:
    lines = []
    for name, values in parameters.items():
        terms = (in_toml(term.name) for term in scenario.robot.joint(name).terms)
        lines += _table(f"{place}.{name}", dict(zip(terms, values.tolist(), strict=True)))
    return lines


def _table(place: str, values: Mapping[str, object]) -> list[str]:
    return ["", f"[{place}]", *_pairs(values)]


def _pairs(values: Mapping[str, object]) -> list[str]:
    """Keys, bare or quoted, with their values; a table is written in its line."""
    tables = {key: f"{{ {', '.join(_pairs(value))} }}" for key, value in values.items() if isinstance(value, Mapping)}
    return [f"{key} = {tables[key] if key in tables else in_toml(value)}" for key, value in values.items()]
