"""Small studies, analysed once: one with records of every kind, for the contracts of stages and sections, and one with
the faults of a laboratory.
"""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from davinci_forces.maths.excitation.fourier import Fourier
from davinci_forces.maths.mechanics.kinematics import jacobian
from davinci_forces.maths.simulation import continuous
from davinci_forces.maths.simulation.surroundings import triangle
from davinci_forces.records import KINDS, Record, Signal, store
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.robots import Robot, davinci
from davinci_forces.robots.davinci import BODIES, CHAIN
from davinci_forces.runner.console import Console
from davinci_forces.runner.ledger import Folders, Ledger
from davinci_forces.runner.plan import Plan
from davinci_forces.runner.runner import Runner
from davinci_forces.runner.runs import folders
from davinci_forces.stages import STAGES, design
from davinci_forces.study import Study, reading
from tests import arm
from tests.conftest import once
from tests.contracts import faulty

TRUTH = {
    "theta": {name: dict(zip((t.name for t in arm.joint(name).terms), theta.tolist(), strict=True))
              for name, theta in arm.THETA.items()},
    "log": [
        {"name": "push", "push": [{"joint": "hand_roll", "shape": "pulse", "start": 4.0, "end": 6.0, "peak": 1.0}]},
        {"name": "tip", "push": [
            {"direction": [0.6, 0.0, -0.8], "shape": "triangle", "start": 4.0, "end": 8.0, "peak": 20.0}]},
    ],
}  # fmt: skip
ALL = tuple(joint.name for joint in arm.ARM.joints)


@dataclass(frozen=True)
class Lab:
    """A study with its folders, in which every stage but the report has run."""

    study: Study
    folders: Folders
    plan: Plan

    def records(self, kind: type[Record]) -> list[Record]:
        places = [Path(place) for _, place in self.plan.places().find((kind,))]
        return [store.read(kind, self.folders.processed, place) for place in places]


def robot() -> Robot:
    """The arm of the tests with a geometry and a published trajectory, so that there is something to design."""
    roll, *others = arm.ARM.joints
    published = (("table-6.1-corrected", arm.EXCITATION["hand_roll"]),)
    short = tuple(replace(study, duration=0.05) for study in davinci.ROBOT.control)
    joints, wrist = (
        (replace(roll, published=published, physical=davinci.ROLL_PARTS, printed=davinci.ROLL_PRINTED), *others),
        davinci.ROBOT.wrist,
    )
    return replace(arm.ARM, joints=joints, chain=CHAIN, bodies=BODIES, wrist=wrist, control=short)


def at_the_tip() -> list[Signal]:
    """All joints moving while something is pushed by the tip, as TRUTH says."""
    [push] = TRUTH["log"][1]["push"]
    about = {"period": 2.6, "periods": 5, "rate": 50.0, "log": "tip", "role": "contact"}
    t = arm.signal("hand_roll", **about).t
    q = np.stack([arm.excitation(name, t, 2.6)[0] for name in ALL], axis=-1)
    f = triangle(t, push["start"], push["end"], push["peak"])[:, None] * push["direction"]
    tau = np.einsum("nij,ni->nj", jacobian(CHAIN, q)[0], f)
    return [arm.signal(name, seed=i, external=lambda t, i=i: tau[:, i], **about) for i, name in enumerate(ALL)]


def sensed() -> dict[str, np.ndarray]:
    """The force of that push as a sensor has it, by channel."""
    [push] = TRUTH["log"][1]["push"]
    t = at_the_tip()[0].t
    f = triangle(t, push["start"], push["end"], push["peak"])[:, None] * push["direction"]
    return {f"force_{axis}": f[:, i] for i, axis in enumerate("xyz")}


@pytest.fixture(scope="session")
def lab(tmp_path_factory) -> Lab:
    """The study, which is analysed once a run of the tests; each process has a copy."""
    home = tmp_path_factory.mktemp("lab") / "home"
    shutil.copytree(once(tmp_path_factory, "contracts", analyse), home)
    return lab_of(study_in(home / "raw" / "arm"))


@pytest.fixture(scope="session")
def faulty_lab(tmp_path_factory) -> Lab:
    """The study with the faults of a laboratory, which is analysed once a run of the tests."""
    return lab_of(faulty_study_in(once(tmp_path_factory, "faulty", analyse_faulty) / "raw" / "faulty"))


def lab_of(study: Study) -> Lab:
    """A study with its folders."""
    its_folders = folders(study.folder, None, None)
    return Lab(study, its_folders, Plan(study, Ledger(its_folders)))


def study_in(folder: Path) -> Study:
    """The study of a folder with the robot of these tests, and with its ground truth."""
    return replace(reading.read(folder), robot=robot(), truth=TRUTH)


def faulty_study_in(folder: Path) -> Study:
    """The faulty study of a folder, with a robot that has a geometry and no controller, and with its ground truth."""
    return replace(reading.read(folder), robot=replace(robot(), control=()), truth=faulty.TRUTH)


def analyse_faulty(home: Path) -> None:
    """Write the faulty study, and run the stages that depend on its logs."""
    study = faulty_study_in(faulty.write_study(home / "raw" / "faulty"))
    run(study, [stage for stage in STAGES if stage not in ("design", "haptic-limits")])


def analyse(home: Path) -> None:
    """Write the study, and run every stage but the report."""
    folder = arm.write_study(home / "raw" / "arm")
    arm.write_csv(folder / "again.csv", [arm.signal("hand_roll", period=2.0, periods=5, rate=50.0, seed=2)])
    hung = arm.signal("hand_roll", period=2.0, periods=5, rate=50.0, seed=3, external=np.cos)
    arm.write_csv(folder / "hung.csv", [hung])
    arm.write_csv(folder / "pitch.csv", [arm.signal("hand_pitch", period=2.0, periods=5, rate=50.0)])
    arm.write_csv(folder / "tip.csv", at_the_tip(), sensed())
    weight = 'weight = { mass = 0.2, moves_with = "hand_roll", position = [0.02, 0.0, -0.3] }\ntare = "again"'
    with (folder / "study.toml").open("a") as file:
        file.write(arm.log_table("again", "again.csv", "identification", ["hand_roll"]))
        file.write(arm.write_pushes(folder / "pushes.csv"))
        file.write(arm.log_table("hung", "hung.csv", "weight", ["hand_roll"], weight))
        file.write(arm.log_table("pitch", "pitch.csv", "identification", ["hand_pitch"]))
        file.write(arm.log_table("tip", "tip.csv", "contact", ALL, "contact = [[4.0, 8.0]]"))
        file.write("".join(f'{name} = "{name}"\n' for name in sensed()))
    with pytest.MonkeyPatch.context() as shorter:
        shorten(shorter)
        run(study_in(folder), STAGES)


def run(study: Study, stages: Sequence[str]) -> None:
    """Run stages, none of which may fail."""
    said: list[str] = []
    good = Runner(study, folders(study.folder, None, None), Console(lambda line: None, said.append)).run(stages)
    assert good, "\n".join(said)


def shorten(patch: pytest.MonkeyPatch) -> None:
    """Leave out what takes long of a design, and none of the kinds of record that it makes."""
    patch.setattr(continuous, "RELATIVE", 1e-4)
    patch.setattr(continuous, "ABSOLUTE", 1e-6)
    patch.setattr(design, "design", lambda problem, *_: (series(problem.period), np.zeros(1)))


def series(period: float) -> Fourier:
    """Any trajectory."""
    return Fourier(0.0, (0.1, 0.05), (0.05, 0.1), period)


@pytest.fixture(scope="session")
def catalogue(lab: Lab) -> Catalogue:
    """Every record of the study, read already."""
    return catalogue_of(lab)


@pytest.fixture(scope="session")
def faulty_catalogue(faulty_lab: Lab) -> Catalogue:
    """Every record of the faulty study, read already."""
    return catalogue_of(faulty_lab)


def catalogue_of(lab: Lab) -> Catalogue:
    """Every record of a study, read already."""
    records = {kind: lab.records(kind) for kind in KINDS.values()}
    return Catalogue(records.__getitem__)
