"""The models of joints that move alone, against the formulas that the thesis prints and their corrections."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from davinci_forces.maths.mechanics.bodies import Bodies, Drives
from davinci_forces.maths.mechanics.chain import denavit_hartenberg
from davinci_forces.maths.models.physical import reduced_parameters
from davinci_forces.robots.davinci import BODIES, CHAIN, DRIVES, GUESSED_LC5, ROBOT, in_table_frames

# What the formulas are written in, and where it is in the bodies: link 3 is row 1 of the arrays.
CENTRES = {3: (0, -1), 4: (0, -1), 5: (2, -1), 6: (2, -1), 7: (1, -1), 8: (0, -1), 9: (0, -1)}
Physical = Mapping[str, float]


def physical(of: Bodies) -> dict[str, float]:
    """m3, lc3, Ix3 and so on, as the thesis names them."""
    found = {}
    for link in range(2, 10):
        found[f"m{link}"] = of.masses[link - 2]
        found |= {f"I{axis}{link}": of.inertias[link - 2, i, i] for i, axis in enumerate("xyz")}
        if link in CENTRES:
            axis, sign = CENTRES[link]
            found[f"lc{link}"] = sign * of.centres[link - 2, axis]
    return found


def roll(p: Physical) -> tuple[float, float]:
    """(6.7) without its motor: inertia and the coefficient of g sin(q1).  It leaves out links 6 to 9."""
    m3, m4, m5, lc3, lc5 = (p[x] for x in ("m3", "m4", "m5", "lc3", "lc5"))
    inertia = p["Iy2"] + p["Ix5"] + p["Iy3"] + 0.036 * (m3 + m4 + m5) + 0.38 * m5 * lc5 - 0.38 * m3 * lc3
    inertia += m3 * lc3**2 + p["Ix4"] + m5 * lc5**2
    return inertia, -m5 * lc5 - 0.19 * (m5 + m4 + m3) + m3 * lc3


def pitch(p: Physical, wrist: float, head: float, iz7: float, sine: float, cosine: float) -> tuple[float, float, float]:
    """(6.10) without its motor: inertia, g sin(q2), g cos(q2); the arguments are what it prints wrongly."""
    m = {link: p[f"m{link}"] for link in range(3, 10)}
    lc = {link: p[f"lc{link}"] for link in CENTRES}
    inertia = p["Iz3"] + p["Iy5"] + p["Iy6"] + p["Iy8"] + p["Iy9"] + iz7 * p["Iz7"] + 0.04 * (m[3] + m[4] + m[5])
    inertia += -0.38 * m[3] * lc[3] + wrist * (m[6] * lc[6] + m[7] * lc[7]) + head * m[8] * lc[8]
    inertia += -0.22 * m[9] * lc[9] + 0.38 * m[5] * lc[5] + sum(m[i] * lc[i] ** 2 for i in (3, 5, 6, 7, 8, 9))
    along = -0.19 * (m[4] + sine * (m[3] + m[5])) + 0.09 * (m[6] + m[7]) + 0.10 * (m[8] + m[9]) + m[3] * lc[3]
    along -= sum(m[i] * lc[i] for i in (5, 6, 7, 8, 9))
    across = cosine * (m[4] + m[3]) + 0.03 * (m[5] + m[6] + m[7] + m[8] + m[9] + m[3] * lc[3])
    return inertia, along, across


def corrected_pitch(p: Physical) -> tuple[float, float, float]:
    return pitch(p, wrist=-0.18, head=-0.20, iz7=1, sine=1, cosine=-0.01)


def coefficients(formula: Callable[[Physical], tuple[float, ...]], at: Physical, name: str) -> np.ndarray:
    """By how much one more unit of a mass changes each parameter, the centres being where they are."""
    return np.array(formula({**at, name: at[name] + 1.0})) - np.array(formula(at))


def of_the_chain(joint: int, at: Bodies, masses: np.ndarray) -> np.ndarray:
    changed = Bodies(masses, at.centres, at.inertias, at.counts_from)
    return np.array(list(reduced_parameters(CHAIN, changed, joint).values()))


@pytest.mark.parametrize("link", [3, 4, 5, 6, 7, 8, 9])
def test_every_mass_enters_the_pitch_as_in_the_corrected_equation(link):
    more = BODIES.masses + (np.arange(9) == link - 2)
    found = of_the_chain(1, BODIES, more) - of_the_chain(1, BODIES, BODIES.masses)
    # Each printed coefficient is rounded to 0.01, and up to three of them meet in one parameter.
    np.testing.assert_allclose(
        found, coefficients(corrected_pitch, physical(in_table_frames()), f"m{link}"), atol=0.015
    )


@pytest.mark.parametrize("link", [3, 4, 5])
def test_every_mass_enters_the_roll_as_in_the_printed_equation(link):
    more = BODIES.masses + (np.arange(9) == link - 2)
    found = of_the_chain(0, BODIES, more) - of_the_chain(0, BODIES, BODIES.masses)
    printed = coefficients(roll, physical(in_table_frames()), f"m{link}")
    np.testing.assert_allclose(found[:2], printed, atol=0.015 if link != 4 else 0.005)
    assert abs(found[2]) < 1e-12  # the roll has no cosine


def test_the_signs_printed_for_the_pitch_are_not_those_of_the_chain():
    printed = np.array(pitch(physical(in_table_frames()), wrist=0.18, head=0.18, iz7=0, sine=-1, cosine=-0.01))
    found = np.array(list(reduced_parameters(CHAIN, BODIES, 1).values()))
    assert abs(printed - found)[1] > 1.5
    assert abs(np.array(corrected_pitch(physical(in_table_frames()))) - found)[1] < 0.001


def test_the_initial_guesses_come_from_the_printed_equations_with_another_lc5():
    guessed = physical(in_table_frames(GUESSED_LC5))
    assert round(roll(guessed)[1], 3) == 0.194  # Table 6.4
    printed = pitch(guessed, wrist=0.18, head=0.18, iz7=0, sine=-1, cosine=0.01)
    np.testing.assert_allclose(printed, [0.2961, 1.9475, 0.115], atol=5e-5)  # Table 6.5


def test_the_slide_lifts_what_hangs_on_it():
    found = reduced_parameters(CHAIN, BODIES, 2)
    assert found == pytest.approx({"lifted mass": 0.208, "inertia": 0.0}, abs=1e-14)
    assert reduced_parameters(CHAIN, BODIES, 2, n=7)["lifted mass"] == pytest.approx(0.218)


def test_drives_add_their_inertia_and_friction_to_the_joint_s_terms():
    drives = Drives(DRIVES.gear_ratio[:3], np.full(3, 1e-6), DRIVES.viscous[:3], DRIVES.coulomb[:3])
    slide = reduced_parameters(CHAIN, BODIES, 2, drives=drives)
    assert slide["inertia"] == pytest.approx(1340**2 * 1e-6)
    assert (slide["viscous friction"], slide["Coulomb friction"]) == (1.0, 3.0)


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_the_names_are_those_of_terms_that_the_joint_s_model_has(joint):
    found = reduced_parameters(CHAIN, BODIES, joint, drives=DRIVES)
    nonzero = {name for name, value in found.items() if abs(value) > 1e-12}
    assert nonzero <= {term.name for term in ROBOT.joints[joint].terms}


def test_a_joint_whose_inertia_depends_on_its_position_is_refused():
    bent = denavit_hartenberg([row._replace(alpha=row.alpha + 0.3) for row in CHAIN.table], CHAIN.tip)
    with pytest.raises(ValueError, match="joint 1 moving alone is not of the form"):
        reduced_parameters(bent, BODIES, 1)
