"""How long it takes to choose a model of the arm."""

import time

import numpy as np

from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.records import Choice, Motion
from davinci_forces.robots.dvrk_psm import ROBOT
from davinci_forces.robots.models import coupled_arm
from davinci_forces.stages.model import choose

LOGS, SAMPLES, RATE = 6, 6000, 200.0
AT_MOST = 15.0  # [s] of one core


def smoothed() -> list[Motion]:
    """Six logs of an arm whose three joints move, each on a path of its own that does not repeat."""
    random = np.random.default_rng(0)
    t, model = np.arange(SAMPLES) / RATE, coupled_arm(ROBOT, [0, 1, 2], [(), (), ()])
    theta = random.normal(size=len(model.parameters)) * 0.01
    theta[[p.positive for p in model.parameters]] = 0.5
    records = []
    for number in range(LOGS):
        a, phase = random.normal(size=(2, 6, 3)) * np.array([[[0.1, 0.1, 0.02]], [[3.0] * 3]])
        w = 2 * np.pi * 0.1 * np.arange(1, 7)[:, None] * (1 + 0.05 * number)
        x = w[None] * t[:, None, None] + phase
        q, dq, ddq = (a * np.sin(x)).sum(1), (a * w * np.cos(x)).sum(1), (-a * w**2 * np.sin(x)).sum(1)
        tau = model.regressor(ArmMotion(q, dq, ddq, 1 / RATE, np.zeros(SAMPLES, int))).Phi @ theta
        tau += 0.1 * tau.std(axis=0) * random.normal(size=tau.shape)
        for i, joint in enumerate(ROBOT.joints):
            zero = np.zeros(SAMPLES, int)
            columns = {"t": t, "q": q[:, i], "dq": dq[:, i], "ddq": ddq[:, i], "tau": tau[:, i]}
            columns |= {
                "q_measured": q[:, i],
                "dq_measured": dq[:, i],
                "segment": zero,
                "standing": zero,
                "filled": zero,
            }
            about = ("identification", RATE, "logged", 17.0, 0.0, 0, 0.0, 0.0, 0.0)
            records.append(Motion(f"run{number}", joint.name, *about, **columns))
    return records


def test_a_choice_from_six_logs_takes_at_most_fifteen_seconds_of_one_core(capsys):
    list(choose.run(smoothed()[:3], [], ROBOT, fit="chosen", lowpass=17.0))  # what is compiled is compiled
    records = smoothed()
    start = time.process_time()
    made = list(choose.run(records, [], ROBOT, fit="chosen", lowpass=17.0))
    took = time.process_time() - start
    (choice, *_) = (record for record in made if isinstance(record, Choice))
    with capsys.disabled():
        print(f"\nchoice among {len(choice)} candidates of {LOGS} logs of {SAMPLES} samples: {took:.1f} s", end="")
    assert choice.logs == tuple(f"run{number}" for number in range(LOGS))
    assert len(choice) > 1
    assert np.isfinite(choice.score).all()
    assert took <= AT_MOST
