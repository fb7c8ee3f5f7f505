"""What a recorder does wrong: no time is changed against the truth, or it is said, and what is missing is not used."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray
from typer.testing import CliRunner

import davinci_forces
from davinci_forces.cli import app
from davinci_forces.maths.signals.windows import UNSCORED_SAMPLE, free_space
from tests import arm
from tests.logs.test_clocks import said, tdms
from tests.test_runs import call

Samples = NDArray[np.float64]
OF_TEXT = 'time = "t"\n"hand_roll.q" = "q"\n"hand_roll.tau" = "tau"'
FAULTS = ("slow-down", "pause", "forward", "back", "duplicate", "drift", "another rate", "missing", "jitter")


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    folder = tmp_path / "raw" / "arm"
    folder.mkdir(parents=True)
    arm.write_robot(folder)
    return folder


def describe(
    folder: Path, file: str = 'file = "run.csv"', channels: str = OF_TEXT, role: str = "identification"
) -> None:
    entry = f'title = "T"\nrobot = "arm.toml"\n[[log]]\nname = "run"\n{file}\nrole = "{role}"\n'
    (folder / "study.toml").write_text(f"{entry}[log.channels]\n{channels}\n")


def motion(t: Samples) -> tuple[Samples, Samples]:
    """Position and effort of two incommensurable swings, so that no pause goes unseen, at true times [s]."""
    rng = np.random.default_rng(len(t))
    q = 0.5 * np.sin(2 * np.pi * 0.31 * t) + 0.2 * np.sin(2 * np.pi * 0.83 * t + 1.0)
    return q + 1e-5 * rng.normal(size=len(t)), np.cos(2 * np.pi * 0.31 * t) + 0.01 * rng.normal(size=len(t))


def write(folder: Path, stamps: Samples, true: Samples) -> None:
    q, tau = motion(true)
    pd.DataFrame({"t": stamps, "q": q, "tau": tau}).to_csv(folder / "run.csv", index=False)


def read(folder: Path, *kinds: str) -> tuple[pd.DataFrame, ...]:
    return tuple(davinci_forces.read(folder, kind, log="run") for kind in kinds)


def remarks(folder: Path) -> str:
    return " ".join(davinci_forces.read(folder, "Diagnostic")["text"])


def test_a_recorder_that_slows_down_keeps_its_times_and_what_lies_between_its_samples_is_not_used(lab: Path) -> None:
    t = np.concatenate([np.arange(1000) * 0.01, 10 + np.arange(60) / 30, 12 + np.arange(1001) * 0.01])
    describe(lab)
    write(lab, t, t)
    call("resample", lab)
    summary, signal = read(lab, "LogSummary", "Signal")
    assert summary["duration"].iloc[0] == pytest.approx(22.0, abs=1e-9)
    assert (signal["t"].iloc[-1], len(signal), signal["gaps"].iloc[0]) == (pytest.approx(22.0), 2201, 0)
    assert_allclose(signal["q"], motion(signal["t"].to_numpy())[0], atol=2e-4)
    slow = (signal["t"] > 10.005) & (signal["t"] < 11.995)
    assert signal["filled"][slow].mean() == pytest.approx(2 / 3, abs=0.2)
    assert not signal["filled"][~slow].any()
    said_of = remarks(lab)
    assert "from 10.000 to 12.000 s the log is sampled at 30 Hz, not at 100 Hz; its times are kept" in said_of
    assert "clock jumps" not in said_of


def test_a_second_write_at_another_rate_keeps_its_times(lab: Path) -> None:
    t = np.concatenate([0.01 * np.arange(400), 4 + 0.05 * np.arange(400)])
    q, tau = motion(t)
    both = [({"a/q": (q[p], c), "a/tau": (tau[p], c)}) for p, c in
            ((slice(400), said(0, 0.01)), (slice(400, None), {"wf_increment": 0.05}))]  # fmt: skip
    (lab / "run.tdms").write_bytes(tdms(*both))
    describe(lab, 'file = "run.tdms"', '"hand_roll.q" = "a/q"\n"hand_roll.tau" = "a/tau"')
    call("resample", lab)
    summary, signal = read(lab, "LogSummary", "Signal")
    assert summary["duration"].iloc[0] == pytest.approx(23.95, abs=1e-9)
    assert signal["t"].iloc[-1] == pytest.approx(23.95)
    assert "from 4.000 to 23.950 s the log is sampled at 20 Hz, not at 100 Hz" in remarks(lab)


@pytest.mark.parametrize("pause", [2.0, 4.0])
def test_a_pause_after_which_the_motion_repeats_is_not_taken_for_a_jump_of_the_clock(lab: Path, pause: float) -> None:
    t = 0.01 * np.arange(2000)
    stamps = t + np.where(t < 8.13, 0.0, pause)
    q = 0.5 * np.sin(np.pi * t) + 0.1 * np.sin(3 * np.pi * t)
    pd.DataFrame({"t": stamps, "q": q, "tau": q}).to_csv(lab / "run.csv", index=False)
    describe(lab)
    call("ingest", lab)
    assert read(lab, "LogSummary")[0]["duration"].iloc[0] == pytest.approx(19.99 + pause)


def fault(name: str, rng: np.random.Generator) -> tuple[Samples, Samples]:
    """Stamps and true times of a log of 20 s at 100 Hz with a fault at a random time."""
    t, at, size = 0.01 * np.arange(2000), rng.uniform(3, 17), float(rng.uniform(0.05, 4))
    after = t >= at
    match name:
        case "slow-down":
            t = np.concatenate([t[~after], at + np.arange(round(30 * size)) / 30, at + size + t[: after.sum()]])
        case "another rate":
            t = np.concatenate([t[~after], at + np.arange(300) * rng.choice([0.005, 0.02, 0.05])])
        case "pause":
            t = t + np.where(after, size, 0.0)
        case "missing":
            t = t[rng.random(len(t)) > 0.1]
        case "forward" | "back":
            return t + np.where(after, size if name == "forward" else -size, 0.0), t
        case "drift":
            return t * (1 + rng.normal() * 1e-3), t
        case "jitter":
            return t + np.minimum(rng.exponential(1e-3, len(t)), 5e-3), t
        case "duplicate":
            stamps = t.copy()
            stamps[np.argmax(after)] = stamps[np.argmax(after) - 1]
            return stamps, t
    return t, t


@pytest.mark.parametrize("number", range(54))
def test_no_time_is_changed_by_a_fault_of_a_recorder_or_it_is_said(lab: Path, number: int) -> None:
    name = FAULTS[number % len(FAULTS)]
    stamps, true = fault(name, np.random.default_rng(number))
    describe(lab)
    write(lab, stamps, true)
    result = CliRunner().invoke(app, ["ingest", str(lab)])
    if result.exit_code:  # a time that goes back, where the motion does not tell that only the clock did
        assert name in ("back", "duplicate")
        assert "time does not increase at row" in " ".join(result.output.split())
        return
    assert name != "duplicate"
    moved = "The later times are moved by the jump" in result.output.replace("\n", " ")
    assert moved <= (name in ("forward", "back"))
    wanted = true if moved else stamps
    assert_allclose(read(lab, "Recording")[0]["t"], wanted - wanted[0], atol=1e-9)


def test_missing_samples_are_filled_for_filters_and_neither_fitted_nor_judged(lab: Path) -> None:
    """Up to 20 ms; longer is a gap.  The samples themselves stay as recorded."""
    t = 0.01 * np.arange(2000)
    q, tau = motion(t)
    table = pd.DataFrame({"t": t, "q": q, "tau": tau})
    table.loc[[300, 500, 501], "tau"] = np.nan
    table.loc[700:702, "q"] = np.nan  # three samples, 30 ms
    table = table.drop(index=[900, 1100, 1101])
    table.to_csv(lab / "run.csv", index=False)
    describe(lab)
    call("predict", lab)
    signal, motion_of, summary, model = read(lab, "Signal", "Motion", "LogSummary", "JointModel")
    times = np.rint(signal["t"] * 100).astype(int)
    assert sorted(times[signal["filled"] == 1]) == [300, 500, 501, 900, 1100, 1101]
    assert_array_equal(motion_of["filled"], signal["filled"])
    assert_array_equal(model["unscored"] == UNSCORED_SAMPLE, signal["filled"])
    free = free_space(model["t"].to_numpy(), [], 100.0, model["unscored"].to_numpy())
    assert_array_equal(free[times > 850], signal["filled"][times > 850] == 0)
    assert set(range(2000)) - set(times) == {700, 701, 702}
    assert signal["segment"].max() == 1
    measured = signal["filled"] == 0
    assert_allclose(signal["tau"][measured], tau[times[measured]], atol=1e-9)
    assert_allclose(signal["tau"][~measured], np.cos(2 * np.pi * 0.31 * signal["t"][~measured]), atol=0.05)
    assert summary["dropped"].iloc[0] == 3
    assert "3 rows with up to 20 ms or one sample missing are filled by cubics, and neither fitted" in remarks(lab)


def test_what_is_filled_in_moves_no_fit(lab: Path) -> None:
    """Where a sample is missing, the effort may be anything without effect on any parameter or score."""
    signal = arm.signal("hand_roll", period=2.0, rate=100.0, periods=8)
    theta = []
    for spoilt in (0.0, 30.0):
        tau = signal.tau.copy()
        tau[150::97] += spoilt * (-1) ** np.arange(len(tau[150::97]))
        table = pd.DataFrame({"t": signal.t, "q": signal.q, "dq": signal.dq, "tau": tau})
        table.loc[150::97, "q"] = np.nan
        table.to_csv(lab / "run.csv", index=False)
        describe(lab, channels=OF_TEXT + '\n"hand_roll.dq" = "dq"')
        call("fit", lab)
        fits = davinci_forces.read(lab, "Fit")
        theta.append(fits[fits["estimator"] == "lse"]["theta"].to_numpy())
    assert_allclose(theta[0], theta[1], rtol=1e-9)


@pytest.mark.parametrize(("share", "refused"), [(0.15, False), (0.25, True)])
def test_a_channel_of_which_more_than_a_fifth_is_missing_is_refused_in_words(
    lab: Path, share: float, refused: bool
) -> None:
    t = 0.01 * np.arange(2000)
    q, tau = motion(t)
    tau[np.random.default_rng(1).random(2000) < share] = np.nan
    pd.DataFrame({"t": t, "q": q, "tau": tau}).to_csv(lab / "run.csv", index=False)
    describe(lab)
    output = " ".join(call("ingest", lab, code=int(refused)).split())
    assert ("rows lack a number, more than 20%, in no regular rhythm" in output) is refused


@pytest.mark.parametrize("shift", [0.0, 0.003])
def test_topics_of_several_rates_in_one_table_are_slower_channels_of_which_nothing_is_missing(
    lab: Path, shift: float
) -> None:
    """Position at 100 Hz, effort at 25 Hz, and a third topic that is not used, each in rows of their own or shared."""
    t, slow, other = 0.01 * np.arange(2000), 0.04 * np.arange(500) + shift, 0.1 * np.arange(200) + 0.0017
    tables = [
        pd.DataFrame({"t": t, "q": motion(t)[0]}), pd.DataFrame({"t": slow, "tau": np.cos(slow)}),
        pd.DataFrame({"t": other, "x": other}),
    ]  # fmt: skip
    whole = tables[0].merge(tables[1], on="t", how="outer").merge(tables[2], on="t", how="outer").sort_values("t")
    whole.to_csv(lab / "run.csv", index=False)
    describe(lab)
    call("resample", lab)
    recording, signal = read(lab, "Recording", "Signal")
    assert_allclose(np.diff(recording["t"]), 0.01, atol=1e-9)
    assert_allclose(
        recording["tau"][2:-2], np.cos(recording["t"][2:-2] + (t > shift - 1e-9).argmax() * 0.01), atol=1e-4
    )
    assert len(recording) > 1990
    assert not signal["filled"].any()
    assert "missing" not in remarks(lab)


@pytest.mark.parametrize("unit", [1e-3, 1e-6, 1e-9])
def test_times_in_ms_us_and_ns_since_1970_are_no_seconds(lab: Path, unit: float) -> None:
    t = 0.01 * np.arange(500)
    stamps = np.rint((1.76e9 + t + np.where(t < 3, 0, 2.5)) / unit).astype(np.int64)
    pd.DataFrame({"t": stamps, "q": motion(t)[0], "tau": motion(t)[1]}).to_parquet(lab / "run.parquet")
    describe(lab, 'file = "run.parquet"')
    call("ingest", lab)
    assert_allclose(read(lab, "Recording")[0]["t"], t, atol=1e-6)
    assert f"the times in 't' are read in units of {unit:g} s since 1970, not in seconds" in remarks(lab)
    assert "by 2.5 s after 2.990 s" in remarks(lab)
    describe(lab, 'file = "run.parquet"', OF_TEXT.replace('"t"', '{ channel = "t", unit = "s" }'))
    assert "which is no date; correct the unit of time" in " ".join(call("ingest", lab, code=1).split())


def test_parts_of_two_rates_without_starts_have_a_rate_each(lab: Path) -> None:
    for name, step in (("0", 0.01), ("1", 0.05)):
        q = motion(step * np.arange(300))[0]
        (lab / f"{name}.tdms").write_bytes(tdms({f"a/{c}": (q, {"wf_increment": step}) for c in ("q", "tau")}))
    describe(lab, 'files = ["0.tdms", "1.tdms"]', '"hand_roll.q" = "a/q"\n"hand_roll.tau" = "a/tau"')
    call("ingest", lab)
    [made] = read(lab, "Recording")
    assert_allclose(made["t"], np.r_[0.01 * np.arange(300), 3 + 0.05 * np.arange(300)], atol=1e-12)
    assert "each is assumed to begin directly after the one before" in remarks(lab)


def test_the_interval_of_a_channel_that_is_not_used_is_not_that_of_those_that_are(lab: Path) -> None:
    q, tau = motion(0.01 * np.arange(500))
    with_it = {"a/temperature": (q, said(0, 1.0)), "a/q": (q, {}), "a/tau": (tau, {})}
    (lab / "run.tdms").write_bytes(tdms(with_it))
    channels = '"hand_roll.q" = "a/q"\n"hand_roll.tau" = "a/tau"'
    describe(lab, 'file = "run.tdms"', channels)
    output = " ".join(call("ingest", lab, code=1).split())
    assert "states no sampling time of channel 'a/q', only of 'a/temperature', which is not used" in output
    describe(lab, 'file = "run.tdms"\nrate = 100.0', channels)
    call("ingest", lab)
    assert read(lab, "LogSummary")[0]["duration"].iloc[0] == pytest.approx(4.99)
    (lab / "run.tdms").write_bytes(tdms({"a/q": (q, {}), "a/tau": (tau, said(0, 0.02))}))
    describe(lab, 'file = "run.tdms"', channels)
    call("ingest", lab)
    assert read(lab, "LogSummary")[0]["duration"].iloc[0] == pytest.approx(9.98)
