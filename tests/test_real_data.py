"""Real recordings of a da Vinci arm: what the pipeline must find on them, and must not claim."""

import json
import shutil

import pytest

from tests.conftest import ROOT
from tests.test_runs import call

JOINTS = ("hand_roll", "hand_pitch", "instrument_slide")


@pytest.fixture(scope="module")
def dvrk(data, tmp_path_factory):
    """The committed study of the public identification data, on the recordings themselves."""
    study = tmp_path_factory.mktemp("real") / "raw" / "dvrk-psm"
    shutil.copytree(ROOT / "raw" / "dvrk-psm", study)
    for file in (data / "dvrk_wpi").glob("*.csv"):
        (study / file.name).symlink_to(file)
    call("all", study)
    return study


@pytest.fixture(scope="module")
def results(dvrk):
    file = dvrk.parent.parent / "reports" / "dvrk-psm" / "results.json"
    return {r["key"]: r["value"] for r in json.loads(file.read_text())}


def test_the_period_is_found_although_another_was_commanded(results):
    assert results["period.one"] == pytest.approx(6.4806, abs=0.0005)


@pytest.mark.parametrize(("joint", "least"), list(zip(JOINTS, (0.94, 0.94, 0.92), strict=True)))
def test_the_fit_explains_the_averaged_effort(results, joint, least):
    assert results[f"fit.{joint}.independent.lse.r2"] >= least


@pytest.mark.parametrize(("joint", "least"), list(zip(JOINTS, (0.93, 0.93, 0.91), strict=True)))
def test_a_run_of_another_day_is_predicted(results, joint, least):
    assert results[f"predict.one-noweight.{joint}.independent.lse.r2"] >= least


@pytest.mark.parametrize("joint", JOINTS)
def test_innovations_of_a_real_arm_are_not_called_white(results, joint):
    for log in ("one", "one-noweight"):
        assert results[f"ekf.{log}.{joint}.white"] == 0


def test_a_hung_mass_is_seen_on_the_joints_that_carry_it_and_not_on_the_slide(results):
    """The mass turns with the hand, so it loads roll and pitch as they tilt; the slide moves below it, unloaded."""

    def louder(joint):
        return results[f"ekf.one-205g.{joint}.tau_ext_rms"] / results[f"ekf.one-noweight.{joint}.tau_ext_rms"]

    assert louder("hand_pitch") > 2.0
    assert louder("hand_roll") > 1.5
    assert louder("instrument_slide") < 1.2


def test_page_one_says_that_the_band_is_too_narrow_and_that_the_path_is_the_one_that_was_fitted(dvrk):
    page = (dvrk.parent.parent / "reports" / "dvrk-psm" / "report.html").read_text()
    assert "the 95 % band is too narrow" in page
    assert page.count("Caution, same path") == 3
    assert "SIMULATED" not in page


def test_verify_passes(dvrk):
    assert "are unchanged" in call("verify", dvrk)
