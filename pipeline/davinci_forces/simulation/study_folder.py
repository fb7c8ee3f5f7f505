"""A simulated study on disk: every log, study.toml and truth.toml, put in place when all of it is there."""

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from davinci_forces.errors import BadRequest
from davinci_forces.simulation import closed_loop, prescribed, study_toml, truth_toml, writers
from davinci_forces.simulation.motion import SimulatedRun
from davinci_forces.simulation.scenario.scenario import Scenario, SensorNoise, SimulatedLog
from davinci_forces.simulation.sensors import SimulatedChannel, generator, record, record_force

TRUTH = "truth.toml"


def write(scenario: Scenario, folder: Path, force: bool, say: Callable[[str], None]) -> None:
    """Simulate every log and put the study in place when it is whole; `say` is told of each log.

    Raises
    ------
    BadRequest
        If the folder holds something, unless `force` is given and what it holds is a simulated study.
    """
    check(folder, force)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{folder.name}-") as temporary:
        new, old = Path(temporary) / "new", Path(temporary) / "old"
        new.mkdir()
        entries, truths = zip(*(_log(scenario, log, new, say) for log in scenario.logs), strict=True)
        _text(new / "study.toml", study_toml.study(scenario, entries))
        _text(new / TRUTH, truth_toml.truth(scenario, truths))
        if folder.exists():
            folder.rename(old)
        shutil.move(new, folder)
    size = sum(file.stat().st_size for file in folder.iterdir())
    say(f"{folder}: {len(scenario.logs)} simulated logs, {size / 1e6:.2f} MB")


def check(folder: Path, force: bool) -> None:
    """Refuse to replace what should not be lost."""
    if folder.exists() and not folder.is_dir():
        raise BadRequest(f"{folder} is a file; name a folder that does not exist yet")
    if not folder.is_dir() or not any(folder.iterdir()):
        return
    if not force:
        raise BadRequest(f"{folder} is not empty; name another folder, or replace it with --force")
    if not (folder / TRUTH).is_file():
        raise BadRequest(f"{folder} has no {TRUTH}, so it is not a simulated study: it is left alone, --force or not")


def _log(scenario: Scenario, log: SimulatedLog, folder: Path, say: Callable[[str], None]) -> tuple[str, str]:
    run = closed_loop.run(scenario, log) if scenario.arm else prescribed.simulate(scenario, log)
    channels, path = recorded(scenario, log, run), folder / log.file
    writers.write(path, channels, scenario.rate, scenario.started)
    size = path.stat().st_size / 1e6
    say(f"{log.name}: {len(run.t)} samples of {', '.join(log.joints)} -> {log.file}, {size:.2f} MB")
    return study_toml.entry(scenario, log, path, channels), truth_toml.entry(log, run)


def recorded(scenario: Scenario, log: SimulatedLog, run: SimulatedRun) -> list[SimulatedChannel]:
    """The channels of one log, with the noise of its seed."""
    channels = [SimulatedChannel("time", "Time", "s", run.t)] if log.clock == "channel" else []
    for name, motion in run.motions.items():
        random = generator(scenario.seed, log.name, name)
        noise = noise_of(scenario, log.family, name)
        channels += record(scenario.joints[name], motion, noise, scenario.rate, log.current_unit, random)
    if log.sensor and run.force is not None:
        channels += record_force(log.sensor, run.t, run.force, generator(scenario.seed, log.name, "force"))
    return channels


def noise_of(scenario: Scenario, family: str, joint: str) -> SensorNoise:
    """The noise of a joint: of its family, where the whole arm is simulated."""
    return scenario.arm.families[family].noise[joint] if scenario.arm else scenario.joints[joint].noise


def _text(file: Path, text: str) -> None:
    file.write_text(text, encoding="utf-8", newline="\n")
