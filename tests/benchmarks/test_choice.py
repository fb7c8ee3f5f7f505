"""What choosing a model of the arm costs, in plain fits of one model."""

import time

import numpy as np
from scipy.signal import butter, sosfiltfilt

from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.records import Choice, Motion
from davinci_forces.robots.dvrk_psm import ROBOT
from davinci_forces.robots.models import coupled_arm
from davinci_forces.stages.model import choose

LOGS, SAMPLES, RATE = 6, 6000, 200.0
PLAIN_FITS = 170.0  # times at most, what a choice takes: 137 were measured, and half as much again fails


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
            columns |= dict.fromkeys(("sigma_q", "sigma_dq", "sigma_tau"), 0.0)
            about = ("identification", RATE, "logged", 17.0, 0.0, 0)
            records.append(Motion(f"run{number}", joint.name, *about, **columns))
    return records


def seconds_of_plain_fit(records: list[Motion]) -> float:
    """The least of some times to low-pass the equations of one model of all joints with scipy, and to solve them."""
    model, times = coupled_arm(ROBOT, [0, 1, 2], [(), (), ()]), []
    logs = [records[i : i + 3] for i in range(0, len(records), 3)]
    motions = [
        ArmMotion(
            *(np.column_stack([getattr(r, x) for r in log]) for x in ("q", "dq", "ddq")), 1 / RATE, log[0].segment
        )
        for log in logs
    ]
    Phi = [model.regressor(motion).Phi for motion in motions]
    tau = [np.column_stack([record.tau for record in log]) for log in logs]
    for _ in range(9):
        start = time.process_time()
        sos = butter(4, 17.0, fs=RATE, output="sos")
        smooth = [[sosfiltfilt(sos, x, axis=0) for x in signals] for signals in (Phi, tau)]
        theta, *_ = np.linalg.lstsq(
            np.concatenate(smooth[0]).reshape(-1, len(model.parameters)), np.concatenate(smooth[1]).ravel()
        )
        times.append(time.process_time() - start)
        assert np.isfinite(theta).all()
    return min(times)


def test_a_choice_from_six_logs_takes_little_more_than_a_hundred_plain_fits(capsys):
    """A choice computes 182 such equations, for other low-passes, lags and terms, and cross-validates each."""
    list(choose.run(smoothed()[:3], [], ROBOT, fit="chosen", lowpass=17.0))  # what is compiled is compiled
    records = smoothed()
    plain = seconds_of_plain_fit(records)
    start = time.process_time()
    made = list(choose.run(records, [], ROBOT, fit="chosen", lowpass=17.0))
    took = time.process_time() - start
    plain = min(plain, seconds_of_plain_fit(records))
    (choice, *_) = (record for record in made if isinstance(record, Choice))
    with capsys.disabled():
        print(f"\nchoice among {len(choice)} candidates of {LOGS} logs of {SAMPLES} samples: {took:.1f} s,", end=" ")
        print(f"{took / plain:.0f} plain fits (at most {PLAIN_FITS:.0f})", end="")
    assert choice.logs == tuple(f"run{number}" for number in range(LOGS))
    assert len(choice) > 1
    assert np.isfinite(choice.score).all()
    assert took <= PLAIN_FITS * plain
