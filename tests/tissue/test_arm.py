"""Tissue that a simulated arm pushes into, felt by its motor currents alone: of both families, over seeds."""

import re
from pathlib import Path

import numpy as np
import pytest

import davinci_forces
from davinci_forces.runner.console import Console
from davinci_forces.runner.runner import Runner
from davinci_forces.runner.runs import folders
from davinci_forces.simulation import study_folder
from davinci_forces.simulation.scenario.reading import load
from davinci_forces.study import reading
from tests.conftest import TWO_FRICTIONS
from tests.tissue.pushing import SURFACE, K

SEEDS = 5
LOGS = r'name = "(slide-excitation|tissue-approach|tissue-haptic)"'


@pytest.fixture(scope="module")
def _moved_once():
    """Each log's motion is simulated once, since a seed is that of the noise alone."""
    simulate_log, runs = study_folder.simulate_log, {}

    def remembered(scenario, log):
        if log.name not in runs:
            runs[log.name] = simulate_log(scenario, log)
        return runs[log.name]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_folder, "simulate_log", remembered)
        yield


@pytest.fixture(scope="module")
def found(tmp_path_factory, _moved_once):
    """The tissue of every seed: the logs of the slide, recorded anew and analysed."""
    text = Path(TWO_FRICTIONS).read_text()
    head, *logs = re.split(r"(?m)^\[\[log\]\]\n", text)
    kept = head + "".join(f"[[log]]\n{log}" for log in logs if re.match(LOGS, log))
    home, tissue = tmp_path_factory.mktemp("arm"), []
    for seed in range(SEEDS):
        (home / "slide.toml").write_text(re.sub(r"(?m)^seed = .*$", f"seed = {seed}", kept))
        raw = home / "raw" / f"seed-{seed}"
        study_folder.write(load(str(home / "slide.toml")), raw, False, lambda _: None)
        said: list[str] = []
        runner = Runner(reading.read(raw), folders(raw, None, None), Console(lambda _: None, said.append))
        assert runner.run(["palpate"]), "\n".join(said)
        tissue.append(davinci_forces.read(raw, "Stiffness"))
    return tissue


@pytest.mark.slow
@pytest.mark.parametrize("log", ["tissue-approach", "tissue-haptic"])
@pytest.mark.parametrize("family", ["matched", "realistic"])
def test_the_interval_holds_what_the_tissue_is_and_the_mean_is_near_it(found, family, log):
    own = [tissue[tissue["log"] == f"{family}-{log}"].iloc[0] for tissue in found]
    k, std = (np.array([row[name] for row in own]) for name in ("stiffness", "stiffness_std"))
    assert np.all(np.abs(k - K) <= 1.96 * std)
    # Five seeds have a mean that scatters by as much as one has, over the root of five.
    assert abs(k.mean() - K) < 0.02 * K + 2 * k.std() / np.sqrt(SEEDS)
    assert np.median(std) < 0.12 * K


@pytest.mark.slow
def test_first_contact_of_a_slow_approach_is_found_where_friction_is_what_the_model_says(found):
    off = [t[t["log"] == "matched-tissue-approach"]["onset_depth"].to_numpy() - SURFACE for t in found]
    assert np.max(np.abs(off)) < 1e-3
