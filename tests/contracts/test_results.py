"""Every number of results.json has a standard error, or says why it has none."""

import json
import math
from dataclasses import asdict
from fnmatch import fnmatch

import pytest

from davinci_forces.records import KINDS
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.records.record import Published
from davinci_forces.report.results import REASONS, TOO_FEW, Result, Results, collect

WORDS = {"exact", "stated", "count", "simulated truth", "p-value", "setting", "time", "standard deviation"}
WITH_STD = {  # what a referee asks the uncertainty of, by the words of the issue
    "errors": "*.rmse sensor.*.largest *.nrmse *.*_error *.relative_error_1111 *.r2 fit.*.mse fit.*.r2 *.fit_percent "
    "choice.*.score choice.*.training choice.*.over_periods tissue.*.error search.*.mse guess.*.mse",
    "levels": "*.detection_level *.free_level *.free_rms *.alarm_level *.band_rms noise.* *.tau_ext_rms *.left_rms",
    "coverages": "*.coverage *.coverage_q?",
    "masses": "weight.*.mass weight.*.mass_mirrored weight.*.scale weight.*.free.*",
    "stiffnesses": "*.k_t *.k_t_loading *.k_t_unloading *.stiffness *.stiffness_q? *.tangent *.k_t_limit "
    "*.k_t_response *.k_t_simulated *.k_t_settles *.k_t_best",
    "peaks": "contact.*.peak contact.*.mean contact.*.impulse contact.*.onset contact.*.release tip.*.peak tip.*.f_?",
    "parameters": "fit.*.coulomb_friction fit.*.viscous_friction *.damping *.exponent *.day_offset *.joint_offset "
    "period.arm *.model_part",
    "tests of noise": "*.acf1* *.skewness *.kurtosis *.nis_*",
}
# Simulations of a stated hand have no noise, and what the robot's tables state no error.
NO_MEASUREMENT = "haptics.*", "guess.*.coulomb_friction", "guess.*.viscous_friction", "control.*"


@pytest.fixture(scope="module")
def results(catalogue: Catalogue) -> Results:
    return collect(catalogue)


@pytest.fixture(scope="module")
def published(catalogue: Catalogue) -> dict[str, Published]:
    return {number.key: number for kind in KINDS.values() for r in catalogue.records(kind) for number in r.published()}


def test_every_number_has_a_standard_error_or_says_why_not(results: Results, published: dict[str, Published]):
    for key, result in results.items():
        if result.std is not None:
            assert math.isfinite(result.std), key
            assert result.std >= 0.0, key
            assert result.std_reason is None, key
        else:  # only what could have had one lacks it for want of data
            assert result.std_reason in WORDS or (published[key].std and result.std_reason == TOO_FEW), key
    assert set(REASONS) == WORDS


@pytest.mark.parametrize("family", WITH_STD)
def test_what_is_measured_has_a_standard_error(family: str, published: dict[str, Published]):
    for pattern in WITH_STD[family].split():
        keys = [key for key in published if fnmatch(key, pattern) and not any(fnmatch(key, p) for p in NO_MEASUREMENT)]
        assert keys or pattern in ("period.arm", "tip.*.peak"), pattern
        assert [key for key in keys if not published[key].std] == [], pattern


def test_few_numbers_of_a_whole_study_have_too_few_data(results: Results):
    few = [key for key, result in results.items() if result.std_reason == TOO_FEW]
    assert len(few) < 0.02 * len(results), few


@pytest.mark.parametrize("count", [0, 1, 3])
def test_the_file_of_numbers_is_laid_out_as_json_with_an_indent(count):
    numbers = [Result(f'a "{i}" é', 0.1 * i, None if i else 0.5, "N m", "raw/truth.toml#[]", "0") for i in range(count)]
    expected = json.dumps([asdict(number) for number in numbers], indent=1, ensure_ascii=False) + "\n"
    assert Results({number.key: number for number in numbers}).json() == expected.encode()
