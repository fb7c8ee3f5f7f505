"""Chains by tables and by placements, and that of the research kit against its published geometry."""

import numpy as np
import pytest

from davinci_forces.maths.mechanics import kinematics
from davinci_forces.maths.mechanics.chain import FIXED, TableRow, denavit_hartenberg, modified_denavit_hartenberg
from davinci_forces.robots.davinci import CHAIN as DAVINCI
from davinci_forces.robots.dvrk_psm import PSM_CHAIN as PSM

POSES = 100


def poses(n: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.5, 1.5, (POSES, n))


def turn(axis: str, angle: np.ndarray) -> np.ndarray:
    T = np.tile(np.eye(4), (len(angle), 1, 1))
    i, j = {"x": (1, 2), "z": (0, 1)}[axis]
    T[:, i, i] = T[:, j, j] = np.cos(angle)
    T[:, j, i], T[:, i, j] = np.sin(angle), -np.sin(angle)
    return T


def shift(axis: str, length: np.ndarray) -> np.ndarray:
    T = np.tile(np.eye(4), (len(length), 1, 1))
    T[:, "xyz".index(axis), 3] = length
    return T


def product(rows, q: np.ndarray, modified: bool) -> dict[str, np.ndarray]:
    """Every frame by the formula of its convention, row by row."""
    frames, full = {"0": np.tile(np.eye(4), (len(q), 1, 1))}, np.column_stack([q, np.zeros(len(q))])
    for row in rows:
        moved = row.sign * full[:, row.coordinate if row.coordinate != FIXED else -1]
        along, about = row.d + moved * row.slides, row.theta + moved * (not row.slides)
        z = turn("z", about) @ shift("z", along)
        x = turn("x", np.full(len(q), row.alpha)) @ shift("x", np.full(len(q), row.a))
        frames[row.name] = frames[row.before] @ (x @ z if modified else z @ x)
    return frames


# Signs, branches, links that share a coordinate, and rows that nothing moves at the base, between, and at the end.
ROWS = (
    TableRow("a", "0", 0.3, 0.1, 0.2, -0.4),
    TableRow("b", "a", -0.7, 0.0, 0.1, 0.5, 0),
    TableRow("c", "b", 1.1, 0.2, -0.1, 0.0, 1, sign=-1),
    TableRow("d", "b", 0.0, 0.3, 0.0, 0.2, 1),
    TableRow("e", "c", 0.9, 0.1, 0.4, 1.2),
    TableRow("f", "e", -1.3, 0.0, 0.2, 0.1, 2, sign=-1, slides=True),
    TableRow("g", "f", 0.4, 0.2, 0.0, -0.3),
)


@pytest.mark.parametrize(("rows", "describe", "modified"), [
    (ROWS, denavit_hartenberg, False), (ROWS, modified_denavit_hartenberg, True),
    (DAVINCI.table, denavit_hartenberg, False), (PSM.table, modified_denavit_hartenberg, True),
])  # fmt: skip
def test_a_table_s_frames_are_where_its_convention_puts_them(rows, describe, modified):
    chain = describe(rows, rows[-1].name)
    q = poses(chain.n)
    T = kinematics.frames(chain, q)
    for name, expected in product(rows, q, modified).items():
        np.testing.assert_allclose(T[:, chain.names.index(name)], expected, rtol=0, atol=1e-14)
    assert chain.table == tuple(rows)


def test_what_nothing_moves_is_a_frame_and_not_a_link():
    chain = denavit_hartenberg(ROWS, "g")
    assert chain.links == ("b", "c", "d", "f")
    assert list(chain.moved_by) == [FIXED, FIXED, 0, 1, 1, FIXED, 2, FIXED]
    assert [chain.names[i] for i in chain.before] == ["0", "0", "a", "b", "b", "c", "e", "f"]


def test_a_frame_of_a_link_s_name_is_the_link_s_own_where_the_convention_puts_it_at_the_joint():
    positive = [row._replace(sign=1) for row in ROWS]
    np.testing.assert_array_equal(modified_denavit_hartenberg(positive, "g").of_links, np.tile(np.eye(4), (4, 1, 1)))


def test_at_zero_the_research_kit_s_carriage_moves_down():
    J, _ = kinematics.jacobian(PSM, np.zeros(3), "carriage")
    np.testing.assert_allclose(J[:, 2], [0, 0, -1], atol=1e-15)


def test_the_research_kit_s_insertion_axis_passes_through_the_remote_centre():
    T = kinematics.frames(PSM, poses(3))[:, PSM.names.index("carriage")]
    to_centre = np.array([0, 0.516, 0]) - T[:, :3, 3]
    np.testing.assert_allclose(np.cross(to_centre, T[:, :3, 2]), 0, atol=1e-12)


def test_the_research_kit_s_remote_centre_is_where_it_is_published_and_stays_there():
    np.testing.assert_allclose(kinematics.remote_centre(PSM), [0, 0.516, 0], atol=1e-15)
    T = kinematics.frames(PSM, poses(2))[:, PSM.names.index("end_link")]
    local = np.linalg.inv(T) @ np.array([0, 0.516, 0, 1])
    np.testing.assert_allclose(local, np.broadcast_to(local[0], local.shape), atol=1e-12)


def test_the_research_kit_s_first_joints_turn_the_other_way_than_the_da_vinci_s():
    for chain, frame, sign in ((PSM, "end_link", -1), (DAVINCI, "5", 1)):
        J_w = kinematics.jacobian(chain, np.zeros(3), frame)[1]
        np.testing.assert_allclose(J_w[:, 0], [0, sign, 0], atol=1e-15)
        np.testing.assert_allclose(J_w[:, 1], [sign, 0, 0], atol=1e-15)


def test_the_research_kit_s_bars_stay_parallel_to_the_axis_of_the_yaw():
    q = poses(2)
    for bar in ("lower_bar", "upper_bar"):
        J_w = kinematics.jacobian(PSM, q, bar)[1]
        np.testing.assert_allclose(J_w[:, :, 1], 0, atol=1e-14)  # the pitch does not turn them
        np.testing.assert_allclose(J_w[:, :, 0], np.broadcast_to([0, -1, 0], (POSES, 3)), atol=1e-14)


def test_the_research_kit_s_counterweight_keeps_to_the_back_link():
    T = kinematics.frames(PSM, poses(3))
    local = np.linalg.inv(T[:, PSM.names.index("back_link")]) @ T[:, PSM.names.index("counterweight")]
    np.testing.assert_allclose(local[:, :3, :3], np.broadcast_to(local[0, :3, :3], (POSES, 3, 3)), atol=1e-14)
    np.testing.assert_allclose(np.ptp(local[:, [0, 2], 3], axis=0), 0, atol=1e-14)


@pytest.mark.parametrize("N", [0, 3, 10, 25])
def test_what_is_said_of_many_poses_so_many_at_a_time_is_what_is_said_of_all(N, monkeypatch):
    monkeypatch.setattr(kinematics, "POSES_AT_ONCE", 10)
    q, asked = np.random.default_rng(N).normal(size=(N, 3)), []
    found = kinematics.evaluate_in_blocks(lambda some: asked.append(len(some)) or kinematics.tip(PSM, some), q)
    assert found.tolist() == kinematics.tip(PSM, q).tolist()
    assert max(asked) <= 10
