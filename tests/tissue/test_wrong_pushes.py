"""Pushes that cannot be right: each is said clearly, with its numbers and the remedy."""

import numpy as np
import pytest

from davinci_forces.study import WHOLE_LOG
from tests.tissue.pushing import TWICE, coloured, motion, palpated, pressed, sensed, slid, touch


def of(depth_scale=1.0, force_scale=1.0, surface=0.008, contact=()):
    """Remarks on pushes whose channels are scaled, as by a wrong unit or sign."""
    t, depth = motion(TWICE, 100.0)
    force = pressed(t, depth, surface=surface) + coloured(np.random.default_rng(0), len(t), 0.02, 0)
    tissue, _, _, said = palpated([touch(t, depth=depth_scale * depth, force=force_scale * force)], contact=contact)
    return tissue, said


def test_pushes_that_are_right_are_passed_over_in_silence():
    assert not of()[1]
    assert not of(contact=WHOLE_LOG, surface=0.0)[1]


def test_no_contact_is_said():
    tissue, [said] = of(surface=1.0)
    assert tissue is None
    assert said.startswith("run: no contact is found in 2 pushes: the force changes by 0.1")
    assert 'contact = "all"' in said


def test_contact_from_the_first_sample_is_said_and_has_no_beginning():
    tissue, [said] = of(surface=-0.01)
    assert said.startswith("run: all 2 pushes: contact from the first sample, so where it begins is not known")
    assert np.isnan(tissue.onset_depth).all()
    assert tissue.stiffness == pytest.approx(457.24, rel=0.01)


def test_a_depth_in_mm_that_is_taken_for_m_is_said():
    tissue, [said] = of(depth_scale=1e3)
    assert tissue.stiffness == pytest.approx(0.457, rel=0.02)
    assert "pushes are 11.9 m deep and meet 0.457 N/m: no tissue does so" in said
    assert 'write unit = "mm"' in said


def test_a_depth_in_m_that_is_taken_for_mm_is_said():
    _, [said] = of(depth_scale=1e-3)
    assert "pushes are 0.012 mm deep and meet 4.57e+05 N/m: no tissue does so" in said


@pytest.mark.parametrize(("depth", "force"), [(-1.0, 1.0), (1.0, -1.0)])
def test_a_stiffness_below_zero_is_said(depth, force):
    tissue, [said] = of(depth_scale=depth, force_scale=force)
    assert tissue.stiffness == pytest.approx(-457.24, rel=0.02)
    assert said.startswith("run: all 2 pushes: the force falls as the depth grows, by up to 45")
    assert "write sign = -1" in said


def test_both_signs_turned_is_the_same_tissue():
    tissue, said = of(depth_scale=-1.0, force_scale=-1.0)
    assert not said
    assert tissue.stiffness == pytest.approx(457.24, rel=0.02)


def test_pushes_of_which_no_line_explains_enough_are_said():
    tissue, _, _, [said] = palpated([sensed(std=3.0)], contact=WHOLE_LOG)
    assert tissue.pushes == 0
    assert np.isnan(tissue.stiffness)
    assert "no push counts: a straight line explains at most" in said


def test_a_log_without_a_force_is_said():
    t, depth = motion(TWICE, 100.0)
    assert "no force or no depth is known" in palpated([touch(t, depth=depth)])[3][0]
    assert "no force or no depth is known" in palpated()[3][0]


def test_a_log_of_fewer_than_eight_samples_is_said_to_tell_no_push():
    t, depth = np.arange(8) / 4, np.sin(np.arange(8))
    seven, eight = (palpated([touch(t[:N], depth=depth[:N], force=depth[:N])])[3] for N in (7, 8))
    assert "no push can be found" in seven[0]
    assert not any("no push can be found" in text for text in eight)


def test_a_log_of_another_role_is_left_alone():
    from davinci_forces.stages.tissue import palpate
    from tests import arm
    from tests.test_averaging import entry

    assert not list(palpate.run([sensed()], [slid()], entry(role="contact"), arm.ARM, lowpass=17.0))
