"""Each effect of friction that the simulator can put in has a term, which the search for a joint's model takes."""

from dataclasses import replace

import numpy as np
import pytest

from davinci_forces.identification.candidates import reach_of
from davinci_forces.identification.observations import Processing, observe
from davinci_forces.identification.search import JointSearch, SearchResult
from davinci_forces.records import Motion
from davinci_forces.simulation.motion import simulate_log
from davinci_forces.simulation.scenario.reading import load
from davinci_forces.stages.recordings import resample
from tests.conftest import TWO_FRICTIONS
from tests.test_parameter_errors import recordings

JOINT, LOG, LOWPASS = "hand_roll", "matched-roll-validation", 17.0
# What is put in, strongly, and the terms of which one is taken.  Near q = 0, g cos(q) is an offset, too.
EFFECTS = {
    "by direction": (
        {"coulomb_up": 0.4, "static_up": 0.4, "coulomb_down": 0.1, "static_down": 0.1},
        {"offset", "gravity, cosine"},
    ),
    "Stribeck": ({"static_up": 0.9, "static_down": 0.9, "stribeck_velocity": 0.1}, {"Stribeck friction"}),
    "presliding": ({"bristle_stiffness": 18.0, "bristle_damping": 0.3}, {"presliding friction 1"}),
}


def searched(effect: dict[str, float]) -> SearchResult:
    """The search for the model of the roll, whose friction has one effect."""
    scenario = load(TWO_FRICTIONS)
    family = scenario.arm.families["matched"]
    changed = {name: np.array([x, *getattr(family.friction, name)[1:]]) for name, x in effect.items()}
    families = {"matched": replace(family, friction=family.friction._replace(**changed))}
    scenario = replace(scenario, arm=replace(scenario.arm, families=families))
    log = replace(next(log for log in scenario.logs if log.name == LOG), duration=60.0)
    [recording] = recordings(scenario, log, simulate_log(scenario, log))
    made = resample.run(recording, scenario.robot.joint(JOINT), lowpass=LOWPASS)
    observed = observe([record for record in made if isinstance(record, Motion)], (), LOWPASS, 0)
    search = JointSearch(scenario.robot, JOINT, "independent", [observed], reach_of([observed], JOINT))
    return search.run(Processing(LOWPASS, 0.0))


@pytest.mark.parametrize("effect", EFFECTS)
@pytest.mark.slow
def test_each_effect_of_friction_has_a_term_that_the_search_takes_first(effect):
    put_in, terms = EFFECTS[effect]
    result = searched(put_in)
    first = next(step for step in result.steps if step.terms)
    assert {term.name for term in first.terms} & terms
    assert first in result.steps[: result.steps.index(result.chosen) + 1]
    assert result.chosen.score < 0.8 * result.steps[0].score


@pytest.mark.medium
def test_friction_that_the_joint_has_terms_for_gets_none():
    result = searched({})
    assert not result.chosen.terms
    assert result.chosen.score == pytest.approx(result.steps[0].score, rel=0.1)
