"""How fast the arm is simulated: 60 s in closed loop, beside the clock on the wall."""

import time
from dataclasses import replace

import numpy as np
import pytest

from davinci_forces.simulation.motion import simulate_log
from davinci_forces.simulation.scenario.reading import load
from tests.conftest import TWO_FRICTIONS

AT_LEAST = 50.0  # times faster than real time, with the wrist fixed


@pytest.mark.parametrize("name", ["matched-roll-excitation", "realistic-roll-excitation"])
def test_a_minute_of_closed_loop_is_simulated_fifty_times_faster_than_it_lasts(name, capsys):
    scenario, log = _problem(name)
    simulate_log(scenario, replace(log, duration=0.1))  # compiles
    best = min(_seconds(*_problem(name)) for _ in range(5))
    with capsys.disabled():
        print(
            f"\n{name}: 60 s at {scenario.rate:g} Hz control in {best:.3f} s, {60 / best:.0f} times real time", end=""
        )
    assert 60 / best >= AT_LEAST


def _problem(name):
    """The scenario, read anew, and its log, made a minute long."""
    scenario = load(TWO_FRICTIONS)
    return scenario, replace(next(log for log in scenario.logs if log.name == name), duration=60.0, lead=0.0)


def _seconds(scenario, log) -> float:
    start = time.perf_counter()
    run = simulate_log(scenario, log)
    taken = time.perf_counter() - start
    assert len(run.t) == round(60.0 * scenario.rate)
    assert all(np.isfinite(motion.tau).all() and np.ptp(motion.q) > 0 for motion in run.motions.values())
    return taken
