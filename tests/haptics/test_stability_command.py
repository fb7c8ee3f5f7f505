"""`davinci-forces stability`: its keys, its words, and what it does not take."""

import json

import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from davinci_forces.cli import app
from davinci_forces.haptics.maths.bimodal import THESIS_HAND
from davinci_forces.haptics.maths.delay import delay_limit, sampled_limit


def said(*options: str, code: int = 0) -> str:
    shown = CliRunner().invoke(app, ["stability", *options])
    assert shown.exit_code == code, shown.output
    return shown.output


def limits(*options: str) -> dict:
    return json.loads(said("--json", *options))


def test_the_thesis_s_hand_has_three_limits():
    found = limits()
    assert (found["m"], found["b_h"], found["k_h"]) == (1.0, 1.0, 100.0)
    assert_allclose(found["k_t_cqlf"], 1.0 + 2.0 * 10.0)
    assert_allclose(found["k_t_lmi"], found["k_t_cqlf"], rtol=1e-4)
    assert found["k_t_switching"] > found["k_t_cqlf"]
    assert "k_t_delay" not in found


def test_options_are_the_hand_s():
    found = limits("--k-h", "400", "--b-h", "3", "--m", "4")
    assert_allclose(found["k_t_cqlf"], 9.0 / 4.0 + 6.0 * 10.0)


def test_a_delay_or_a_rate_adds_the_limit_of_a_late_force():
    assert_allclose(limits("--delay", "0.05")["k_t_delay"], delay_limit(THESIS_HAND, 0.05))
    assert_allclose(limits("--rate", "100")["k_t_delay"], sampled_limit(THESIS_HAND, 0.0, 100.0))
    assert_allclose(limits("--delay", "0.05", "--rate", "100")["k_t_delay"], sampled_limit(THESIS_HAND, 0.05, 100.0))
    assert limits("--delay", "0")["k_t_delay"] is None  # no limit


def test_people_are_told_what_each_limit_means_and_where_the_thesis_s_tissue_is():
    text = said("--delay", "0.05")
    assert "Lyapunov" in text
    assert "worst" in text
    assert "For tissue of 457.24 N/m, as in the thesis, a damping of 19.5 N s/m is needed." in text
    assert "No setting is changed" in text
    assert "as in the thesis, the hand's own damping suffices." in said("--b-h", "100", "--delay", "0.01")
    for words in (said(), said("--delay", "0")):
        assert "add --delay or --rate" in words
        assert "any" not in words.replace("every switching", "")


@pytest.mark.parametrize("options", [("--delay", "0.05"), ("--delay", "0.1", "--rate", "100"), ("--rate", "50")])
def test_the_delay_with_the_largest_limit_is_stated_beside_what_it_gains(options):
    found = limits(*options)
    again = limits(
        "--delay", str(found["best_delay"]), *options[options.index("--rate") if "--rate" in options else 9 :]
    )
    assert_allclose(again["k_t_delay"], found["k_t_best"], rtol=1e-6)
    assert found["k_t_best"] >= found["k_t_delay"]
    assert found["best_delay"] >= (found["delay"] or 0.0)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--m", "-1"), "--m -1: must be a positive number [kg]"),
        (("--b-h", "0"), "--b-h 0: must be a positive number [N s/m]; a hand without damping never comes to rest"),
        (("--k-h", "nan"), "--k-h nan: must be a positive number [N/m]"),
        (("--delay", "-0.1"), "--delay -0.1: must be 0 or a positive number [s]"),
        (("--rate", "0"), "--rate 0: must be a positive number [Hz]"),
        (("--rate", "inf", "--m", "0"), "--m 0: must be a positive number [kg]; --rate inf"),
        (("--rate", "1000", "--delay", "20"), "20000 samples"),
    ],
)
def test_a_hand_that_cannot_be_is_refused_in_one_message(options, words):
    assert words in said(*options, code=1)
