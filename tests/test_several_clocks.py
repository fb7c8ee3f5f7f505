"""Channels that were not sampled together, used together: put on one clock, or refused."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

import davinci_forces
from davinci_forces.errors import BadLog
from davinci_forces.logs.joined import MIN_RATIO_FILTERED, Alignment, TimedBlock, align
from davinci_forces.maths.signals.clock import GAP, MIN_INTERVALS_EVEN, are_gaps
from tests import arm
from tests.logs.test_clocks import said, tdms
from tests.test_runs import call

Samples = NDArray[np.float64]


def in_blocks(name: str, t: Samples, x: Samples, rows: int) -> Iterator[TimedBlock]:
    return ((t[i : i + rows], {name: x[i : i + rows]}) for i in range(0, len(t), rows))


def put_on(t: Samples, their_t: Samples, x: Samples, rows: int = 1000) -> tuple[Samples, Samples, Alignment]:
    """The samples `x` of another clock on the clock `t`: its times that are kept, and the samples there."""
    done = Alignment()
    timed = align(in_blocks("q", t, t, rows), {"x": in_blocks("x", their_t, x, rows)}, done, BadLog)
    blocks = list(timed)
    for times, block in blocks:
        assert_array_equal(times, block["q"])
    return np.concatenate([t for t, _ in blocks]), np.concatenate([block["x"] for _, block in blocks]), done


uneven = st.lists(st.floats(0.6, 1.6), min_size=5, max_size=60)


@given(uneven, uneven, st.integers(1, 70), st.integers(0, 55))
@example([1.0, 1.0, 1.0, 1.5, 1.5, 1.1875], [1.0, 0.625, 0.609375, 0.609375, 1.0], 1, 0)
@example([1.0, 1.0, 1.0, 1.5, 1.5], [1.0, 1.0, 0.625, 0.625, 0.625], 1, 5)
@settings(max_examples=200)
def test_a_parabola_comes_through_exactly_whatever_the_clocks_the_blocks_and_the_gaps(
    own: list[float], theirs: list[float], rows: int, gap: int
) -> None:
    t, their_t = np.cumsum(own), np.cumsum(theirs) + 0.5
    their_t[gap:] += 5.0
    assume(
        np.median(np.diff(t)) < MIN_RATIO_FILTERED * np.median(np.diff(their_t))
    )  # one that is faster is averaged first
    x = 1 + 2 * their_t - 0.3 * their_t**2
    try:
        whole, all_of_it, _ = put_on(t, their_t, x)
    except BadLog as problem:
        assert "do not overlap" in str(problem)  # noqa: PT017 - only some clocks have none
        return
    again, same, _ = put_on(t, their_t, x, rows) if rows > 60 else (whole, all_of_it, None)
    assert_array_equal(same, all_of_it)
    assert_array_equal(again, whole)
    # Beside an end or a gap only one neighbour is known, and the cubic has the chord's slope there.
    i = np.searchsorted(their_t, whole, side="right") - 1
    reach = GAP * np.median(np.diff(their_t))
    steps = np.diff(their_t)
    inner = (i > 0) & (i < len(their_t) - 2)
    inner[inner] = (steps[i[inner] - 1] <= reach) & (steps[np.minimum(i[inner] + 1, len(steps) - 1)] <= reach)
    assert_allclose(all_of_it[inner], (1 + 2 * whole - 0.3 * whole**2)[inner], rtol=1e-9, atol=1e-9)
    bridged = (i >= 0) & (i < len(steps)) & (whole > their_t[i])
    assert (steps[i[bridged]] <= reach).all()


@pytest.mark.parametrize("rows", [2, 3, 17, 400])
def test_what_is_interpolated_does_not_depend_on_the_blocks(rows: int) -> None:
    rng = np.random.default_rng(3)
    t, their_t = np.cumsum(rng.uniform(0.9, 1.1, 300)), np.cumsum(rng.uniform(0.9, 1.1, 300)) + 0.3
    x = rng.normal(size=300)
    wanted = put_on(t, their_t, x)
    for one, other in zip(put_on(t, their_t, x, rows)[:2], wanted[:2], strict=True):
        assert_array_equal(one, other)


def test_samples_of_the_same_times_stay_what_they_are() -> None:
    t = 0.01 * np.arange(500)
    x = np.random.default_rng(4).normal(size=500)
    times, same, done = put_on(t, t, x)
    assert_array_equal(times, t)
    assert_array_equal(same, x)
    assert not done.clocks_differ


def test_white_noise_keeps_what_a_cubic_leaves_of_it() -> None:
    """Half-way, the weights are -1/16, 9/16, 9/16 and -1/16: 164/256 of the variance."""
    many = 100_000
    x = np.random.default_rng(5).normal(size=many)
    _, halfway, _ = put_on(np.arange(many) + 0.5, np.arange(many, dtype=float), x)
    assert_allclose(halfway.var(), 164 / 256, rtol=4 * np.sqrt(2 / many))


def test_a_channel_that_is_sampled_much_faster_is_low_passed_first() -> None:
    fast = np.arange(100_000) * 1e-4
    noise = np.random.default_rng(6).normal(size=len(fast))
    t, x, done = put_on(np.arange(1, 999) * 0.01, fast, np.sin(2 * np.pi * fast) + noise)
    assert done.others["x"].ratio == pytest.approx(100)
    inner = slice(10, -10)  # at the ends, reflection doubles the noise
    assert (x - np.sin(2 * np.pi * t))[inner].std() < 1.1 * 0.1  # the low-pass leaves a hundredth of the variance


@pytest.mark.parametrize(("rate", "rows"), [(1000.0, 997), (200.0, 50)])
def test_a_faster_channel_loses_nothing_of_the_band_of_forces_and_folds_nothing_into_it(rate: float, rows: int) -> None:
    """A mean over the clock's sampling time costs 4.7 % at 17 Hz; 90 Hz would appear at 10 Hz."""
    fast, slow = np.arange(round(20 * rate)) / rate, 0.01 * np.arange(2000) + 0.003
    for frequency, wanted in ((17.0, 1.0), (90.0, 0.0)):
        t, x, _ = put_on(slow, fast, np.cos(2 * np.pi * frequency * fast), rows)
        inner = (t > 1) & (t < 19)
        assert_allclose(x[inner], wanted * np.cos(2 * np.pi * frequency * t[inner]), atol=4e-3)


@pytest.mark.parametrize("gap", [0.0241, 0.5])
def test_a_faster_channel_is_low_passed_between_its_gaps_wherever_its_blocks_end(gap: float) -> None:
    fast = np.arange(4000) / 1000
    fast[2000:] += gap
    x = np.random.default_rng(7).normal(size=4000)
    wanted = put_on(0.01 * np.arange(390), fast, x)
    assert wanted[2].left_out == pytest.approx(gap / 0.01, abs=1)
    for one, other in zip(put_on(0.01 * np.arange(390), fast, x, 61)[:2], wanted[:2], strict=True):
        assert_allclose(one, other, atol=1e-12)


def test_stamps_that_agree_within_jitter_are_one_clock_whatever_their_gaps() -> None:
    """A real UR5 writes one file a signal, with stamps 1 to 4 us apart, and sometimes every third sample only."""
    rng = np.random.default_rng(8)
    t = np.cumsum(np.where(rng.random(2000) < 0.4, 0.024, 0.008))
    x = rng.normal(size=2000)
    times, same, done = put_on(t, t + rng.uniform(1e-6, 4e-6, 2000), x)
    assert_array_equal(times, t)
    assert_array_equal(same, x)
    assert not done.clocks_differ


@pytest.mark.parametrize(
    ("theirs", "says"),
    [
        (100 + 0.01 * np.arange(100), "from 0 to 0.99 s, that of x from 100 to 100.99 s: they do not overlap"),
        (0.2 * np.arange(10), "x is sampled every 0.2 s, more than 10 times as slow as the positions"),
        (np.r_[0.01 * np.arange(50), 0.01 * np.arange(50)], "the time of x does not increase at row 50"),
        (np.r_[0.01 * np.arange(50), np.nan], "the time of x is not finite at row 50"),
    ],
)
def test_clocks_that_do_not_go_together_are_refused(theirs: Samples, says: str) -> None:
    with pytest.raises(BadLog, match=says):
        put_on(0.01 * np.arange(100), theirs, theirs)


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """A study without its log."""
    folder = tmp_path / "raw" / "arm"
    folder.mkdir(parents=True)
    arm.write_robot(folder)
    return folder


def describe(folder: Path, file: str, channels: str, role: str = "validation") -> None:
    entry = f'title = "T"\nrobot = "arm.toml"\n[[log]]\nname = "run"\n{file}\nrole = "{role}"\n'
    (folder / "study.toml").write_text(f"{entry}[log.channels]\n{channels}\n")


def motion(t: Samples) -> tuple[Samples, Samples]:
    return 0.3 * np.sin(2 * np.pi * t), 2.0 * np.cos(2 * np.pi * t)


OF_TDMS = '"hand_roll.q" = "a/q"\n"hand_roll.tau" = "b/tau"'


@pytest.mark.parametrize("role", ["validation", "identification"])
def test_an_effort_with_a_clock_of_its_own_comes_to_the_times_of_the_position(lab: Path, role: str) -> None:
    t = 0.01 * np.arange(500)
    q, tau = motion(t)[0], motion(t + 0.0033)[1]
    (lab / "run.tdms").write_bytes(tdms({"a/q": (q, said(0, 0.01)), "b/tau": (tau, said(0.0033, 0.01))}))
    describe(lab, 'file = "run.tdms"', OF_TDMS, role)
    call("ingest", lab)
    made = davinci_forces.read(lab, "Recording", log="run")
    assert len(made) == 499  # the effort begins after the first position
    assert_allclose(made["q"], q[1:], rtol=1e-12)
    inner = slice(2, -2)
    wanted = motion(0.01 + made["t"].to_numpy())[1]
    h4 = (2 * np.pi * 0.01) ** 4  # the error of a cubic goes with the fourth power of the sampling time
    assert_allclose(made["tau"][inner], wanted[inner], atol=2.0 * h4)
    [note] = [text for text in davinci_forces.read(lab, "Diagnostic")["text"] if "different clocks" in text]
    assert "'b/tau' (100 Hz) was interpolated by cubics between neighbours, but not across gaps" in note


def test_a_pause_of_one_clock_is_a_gap_of_all(lab: Path) -> None:
    t = 0.01 * np.arange(300)
    q, tau = motion(t)
    (lab / "run.tdms").write_bytes(
        tdms(
            {"a/q": (q, said(0, 0.01)), "b/tau": (tau[:100], said(0.005, 0.01))},
            {"b/tau": (tau[200:], said(2.005, 0.01))},
        )
    )
    describe(lab, 'file = "run.tdms"', OF_TDMS)
    call("ingest", lab)
    call("resample", lab)
    signal = davinci_forces.read(lab, "Signal", log="run")
    assert signal["segment"].max() == 1
    assert_allclose(np.diff(signal["t"]).max(), 1.02, atol=1e-9)


def test_a_pause_between_two_parts_is_a_gap(lab: Path) -> None:
    q, tau = motion(0.01 * np.arange(300))
    for i, start in enumerate((0, 60)):
        both = {"a/q": (q, said(start, 0.01)), "b/tau": (tau, said(start, 0.01))}
        (lab / f"{i}.tdms").write_bytes(tdms(both))
    describe(lab, 'files = ["0.tdms", "1.tdms"]', OF_TDMS)
    call("ingest", lab)
    call("resample", lab)
    signal = davinci_forces.read(lab, "Signal", log="run")
    assert (signal["gaps"].iloc[0], signal["method"].iloc[0]) == (1, "as recorded")
    assert_allclose(np.diff(signal["t"]).max(), 60 - 2.99, rtol=1e-12)
    describe(lab, 'files = ["1.tdms", "0.tdms"]', OF_TDMS)
    assert 'files = ["0.tdms", "1.tdms"]' in " ".join(call("ingest", lab, code=1).split())


def test_each_group_of_a_tdms_file_has_the_times_that_the_study_names(lab: Path) -> None:
    t = 0.01 * np.arange(300)
    one = {"a/Time": (1e3 * t, {}), "a/q": (motion(t)[0], {})}
    other = {"b/Time": (1e3 * t + 4, {}), "b/tau": (motion(t + 0.004)[1], {})}
    (lab / "run.tdms").write_bytes(tdms(one, other))
    for name in ("Time", "a/Time"):
        describe(lab, 'file = "run.tdms"', f'time = {{ channel = "{name}", unit = "ms" }}\n{OF_TDMS}')
        call("ingest", lab)
        made = davinci_forces.read(lab, "Recording", log="run")
        assert_allclose(made["tau"][2:-2], motion(0.01 + made["t"].to_numpy())[1][2:-2], atol=1e-4)


@pytest.mark.parametrize(
    ("theirs", "says"),
    [
        ((np.arange(5.0), {}), "channel 'b/tau' has no clock"),
        ((np.arange(9.0), said(60, 0.01)), "they do not overlap"),
    ],
)
def test_channels_whose_clocks_do_not_go_together_are_an_error(
    lab: Path, theirs: tuple[Samples, dict[str, float]], says: str
) -> None:
    (lab / "run.tdms").write_bytes(tdms({"a/q": (np.arange(9.0), said(0, 0.01)), "b/tau": theirs}))
    describe(lab, 'file = "run.tdms"', OF_TDMS)
    assert says in " ".join(call("ingest", lab, code=1).split())


def test_one_signal_a_file_becomes_a_recording(lab: Path) -> None:
    t = 0.008 * np.arange(400)
    q, tau = motion(t)
    for name, columns in (("q", (t, q)), ("tau", (t + 0.003, motion(t + 0.003)[1])), ("dq", (t, tau))):
        (lab / f"{name}.csv").write_text("".join(f"{a!r}, {b!r}\n" for a, b in np.column_stack(columns).tolist()))
    channels = "\n".join(f'"hand_roll.{name}" = "{name}/column_1"' for name in ("q", "dq", "tau"))
    describe(lab, 'join = ["q.csv", "dq.csv", "tau.csv"]', f"time = 0\n{channels}")
    call("ingest", lab)
    made = davinci_forces.read(lab, "Recording", log="run")
    assert_array_equal(made["q"], q[1:])
    assert_array_equal(made["dq"], tau[1:])
    assert_allclose(made["tau"][2:-2], tau[3:-2], atol=1e-4)
    described = davinci_forces.read(lab, "LogSummary")
    assert set(described["feeds"]) >= {"time", "hand_roll.q", "hand_roll.tau"}


def test_joined_files_without_clocks_are_counted_by_the_rate(lab: Path) -> None:
    q, tau = motion(0.01 * np.arange(100))
    for name, column in (("q", q), ("tau", tau)):
        (lab / f"{name}.csv").write_text(f"{name}\n" + "".join(f"{value!r}\n" for value in column.tolist()))
    channels = '"hand_roll.q" = "q"\n"hand_roll.tau" = "tau"'
    describe(lab, 'join = ["q.csv", "tau.csv"]', channels)
    assert "channel 'q/q' has no clock" in " ".join(call("ingest", lab, code=1).split())
    describe(lab, 'join = ["q.csv", "tau.csv"]\nrate = 100.0', channels)
    call("ingest", lab)
    made = davinci_forces.read(lab, "Recording", log="run")
    assert_array_equal(made["tau"], tau)
    assert_allclose(made["t"], 0.01 * np.arange(100), atol=1e-12)


def test_a_scale_applies_after_offset_and_sign_and_its_unit_names_the_result(lab: Path) -> None:
    t = 0.01 * np.arange(100)
    q, tau = motion(t)
    (lab / "run.tdms").write_bytes(tdms({"a/q": (q, said(0, 0.01)), "b/tau": (-tau / 0.4 - 1.5, said(0, 0.01))}))
    scaled = '{ channel = "b/tau", offset = 1.5, sign = -1, scale = 400.0, unit = "mN m" }'
    describe(lab, 'file = "run.tdms"', f'"hand_roll.q" = "a/q"\n"hand_roll.tau" = {scaled}')
    call("ingest", lab)
    assert_allclose(davinci_forces.read(lab, "Recording", log="run")["tau"], tau, atol=1e-12)


def test_a_scale_of_nothing_is_a_problem_of_the_study(lab: Path) -> None:
    describe(lab, 'file = "run.tdms"', '"hand_roll.q" = "a/q"\n"hand_roll.tau" = { channel = "b/tau", scale = 0 }')
    assert "scale must not be 0" in " ".join(call("ingest", lab, code=1).split())


def test_the_signals_of_a_real_arm_one_a_file_become_recordings(data: Path, tmp_path: Path) -> None:
    folder = tmp_path / "raw" / "ur5"
    folder.mkdir(parents=True)
    arm.write_robot(folder)
    stem = "No10_Standstill_ForceSensor_All__"
    files = sorted((data / "ur5").glob(f"{stem}*.csv"))
    assert len(files) == 6
    for file in files:
        (folder / file.name.removeprefix(stem)).symlink_to(file)
    listed = ", ".join(f'"{file.name.removeprefix(stem)}"' for file in files)
    channels = [
        f'"{joint}.{symbol}" = "{file}/column_{i}"'
        for i, joint in ((1, "hand_roll"), (2, "hand_pitch"))
        for symbol, file in (("q", "q_actual"), ("dq", "qd_actual"), ("i", "i_actual"))
    ]
    forces = [f'force_{axis} = "force_sensor/column_{i}"' for i, axis in enumerate("xyz", start=1)]
    describe(folder, f"join = [{listed}]", "\n".join(["time = 0", *channels, *forces]))
    call("ingest", folder)
    made = davinci_forces.read(folder, "Recording", joint="hand_roll")
    raw = np.loadtxt(folder / "q_actual.csv", delimiter=",", max_rows=3400)
    assert_array_equal(made["q"][:3399], raw[1:3400, 1])
    touch = davinci_forces.read(folder, "Touch")
    theirs = np.loadtxt(folder / "force_sensor.csv", delimiter=",", max_rows=5000)
    t = touch["t"][:2000] + raw[1, 0]
    bend = np.abs(np.diff(theirs[:, 3], 2)).max()  # a cubic is no further from the chord than the samples bend
    assert_allclose(touch["force_z"][:2000], np.interp(t, theirs[:, 0], theirs[:, 3]), atol=bend / 4)


def test_a_few_long_intervals_that_are_alike_are_gaps_however_late_they_come():
    """Even stretches of a slower clock are none, and have many intervals."""
    for slow, gaps in ((MIN_INTERVALS_EVEN - 2, True), (MIN_INTERVALS_EVEN + 2, False)):
        steps = np.concatenate([np.full(300, 0.01), np.full(slow, 0.09), np.full(300, 0.01)])
        found = are_gaps(np.cumsum(np.append(0.0, steps)), 0.01)
        assert (found == (gaps & (steps > 0.05))).all()
