"""The chain of a robot's own TOML file: Denavit and Hartenberg's parameters, what its links weigh, its problems."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces import robots
from davinci_forces.errors import BadRobot
from davinci_forces.maths.mechanics import kinematics, rigid_body
from davinci_forces.robots.dvrk_psm import PSM_CHAIN

SHIPPED = Path(__file__).parents[2] / "raw" / "ur10e"
TWO = """
name = "two"
[[joint]]
name = "shoulder"
kind = "revolute"
terms = ["inertia", "gravity, sine"]
limits = { q = [-1.0, 1.0], effort = 20.0 }
[[joint]]
name = "elbow"
kind = "revolute"
terms = ["inertia"]
[[link]]
name = "upper"
alpha = 1.5707963267948966
moved_by = "shoulder"
mass = 2.0
centre = [0.2, 0.0, 0.0]
inertia = [0.0, 0.0, 0.0, 0.0, 0.0, 0.03]
[[link]]
name = "fore"
a = 0.5
moved_by = "elbow"
mass = 1.0
centre = [0.3, 0.0, 0.0]
inertia = [0.0, 0.0, 0.0, 0.0, 0.0, 0.01]
[[link]]
name = "hand"
a = 0.4
"""


def load(folder: Path, text: str):
    (folder / "arm.toml").write_text(text)
    return robots.load("arm.toml", folder)


def test_a_planar_arm_has_the_mass_matrix_of_the_textbook(tmp_path):
    """Of two links in a vertical plane: Siciliano et al., Robotics, 2009, section 7.3.2."""
    arm = load(tmp_path, TWO)
    assert arm.joints[0].limits.effort == 20.0
    for q in np.random.default_rng(0).uniform(-2, 2, (20, 2)):
        c, g = np.cos(q[1]), 9.81
        m22 = 0.01 + 0.3**2
        m12 = m22 + 0.5 * 0.3 * c
        m11 = 0.03 + 2 * 0.2**2 + 0.5**2 + 2 * 0.5 * 0.3 * c + m22
        M = rigid_body.mass_matrix(arm.chain, arm.bodies, q)
        assert_allclose(M, [[m11, m12], [m12, m22]], rtol=0, atol=1e-14)
        outer = 0.3 * np.cos(q.sum())
        G = g * np.array([(2 * 0.2 + 0.5) * np.cos(q[0]) + outer, outer])
        assert_allclose(rigid_body.gravity(arm.chain, arm.bodies, q), G, rtol=1e-3)
        tip = 0.5 * np.cos(q[0]) + 0.4 * np.cos(q.sum())
        assert_allclose(kinematics.tip(arm.chain, q)[0], tip, rtol=0, atol=1e-14)


def written(convention: str, chain) -> str:
    """A chain of the shipped robots as a file would say it."""
    names = [f"c{k}" for k in range(chain.n)]
    text = f'convention = "{convention}"\ntip = "{chain.tip}"\nwrist = {names[3:]}\n'
    for k, name in enumerate(names[:3]):
        kind = "prismatic" if chain.slides[chain.coordinate == k][0] else "revolute"
        text += f'[[joint]]\nname = "{name}"\nkind = "{kind}"\nterms = ["inertia"]\n'
    for row in chain.table:
        text += f'[[link]]\nname = "{row.name}"\non = "{row.before}"\nalpha = {row.alpha!r}\na = {row.a!r}\n'
        text += f"d = {row.d!r}\ntheta = {row.theta!r}\nsign = {row.sign}\n"
        text += f'moved_by = "{names[row.coordinate]}"\n' if row.coordinate >= 0 else ""
    return text


@pytest.mark.parametrize("name", robots.ROBOTS)
def test_the_tables_of_the_shipped_robots_written_as_toml_give_their_chains(name, tmp_path):
    chain = robots.load(name, Path()).chain
    convention = "modified" if chain is PSM_CHAIN else "classic"
    arm = load(tmp_path, written(convention, chain))
    q = np.random.default_rng(1).uniform(-1, 1, (20, chain.n))
    assert_allclose(kinematics.frames(arm.chain, q), kinematics.frames(chain, q), rtol=0, atol=0)
    assert arm.coordinates == tuple(f"c{k}" for k in range(chain.n))
    assert arm.bodies is None


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('moved_by = "elbow"', 'moved_by = "elbo"', "arm.toml:22: link 2: moved_by must be one of shoulder, elbow"),
        ('moved_by = "elbow"', "", "no [[link]] has moved_by 'elbow'; a chain needs a link for every joint: add it"),
        ('moved_by = "elbow"', "", "link 2: a link without moved_by has no mass; add it to the link"),
        ("mass = 1.0", "mass = -1.0", "link 2: mass must be finite and at least 0, not -1.0"),
        ("mass = 1.0", "", "link 2: mass is missing; it is a number of kg"),
        ("0.0, 0.01]", "0.0, -0.01]", "link 2: inertia [0.0, 0.0, 0.0, 0.0, 0.0, -0.01] has a negative"),
        ("a = 0.5", 'on = "hand"', "link 2: on must be one of base, 0, upper, not 'hand'"),
        ("a = 0.5", "sign = 2", "link 2: sign must be 1 or -1, not 2"),
        ("a = 0.5", "b = 0.5", "link 2: unknown key 'b'"),
        ('name = "hand"', 'name = "upper"', "two links are named 'upper'"),
        ('name = "hand"', 'name = "base"', "link 3: name 'base' is reserved for the base; choose another"),
        ('name = "two"', 'tip = "toe"', "tip must be one of upper, fore, hand, not 'toe'"),
        ('name = "two"', 'convention = "DH"', "convention must be one of modified, classic, not 'DH'"),
        ('name = "two"', 'wrist = ["elbow"]', "wrist must name each coordinate beyond the joints once"),
    ],
)
def test_what_is_wrong_with_a_chain_is_said_with_its_line(tmp_path, old, new, says):
    assert old in TWO
    with pytest.raises(BadRobot) as caught:
        load(tmp_path, TWO.replace(old, new, 1))
    assert says in str(caught.value)


# The published lengths and those of its URDF differ by at most 1.5 mm in 0.6 m.
def test_the_shipped_ur10e_moves_as_its_urdf_does(data):
    files = (("ur10e.toml", SHIPPED), ("ur10e.urdf", data / "ur10e"))
    arms = [robots.read_with_problems(*file)[0] for file in files]
    q, dq, ddq = np.random.default_rng(0).uniform(-1, 1, (3, 300, 6)) * np.array([3.0, 2.0, 5.0])[:, None, None]
    ours, theirs = (rigid_body.regressor(arm.chain, q, dq, ddq).reshape(1800, -1) for arm in arms)
    U, s, _ = np.linalg.svd(ours, full_matrices=False)
    base = U[:, s > 1e-9 * s[0]]
    assert base.shape[1] == 36  # base parameters of six revolute joints, the first of them vertical
    assert np.linalg.norm(theirs - base @ (base.T @ theirs)) < 0.0015 / 0.6 * np.linalg.norm(theirs)
