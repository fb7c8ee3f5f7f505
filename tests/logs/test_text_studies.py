"""Studies of logs whose columns state units in their names, or dates: results are in SI, or a message says why not."""

from dataclasses import replace

import numpy as np
import pytest

import davinci_forces
from tests import arm
from tests.logs.array_writers import matlab
from tests.logs.reading import read
from tests.test_bad_logs import edit, lab, run  # noqa: F401 - a fixture
from tests.test_runs import call

ROWS = 500


def scaled(lab, columns, time=1.0, q=1.0):  # noqa: F811
    """The log that may be bad, with other names, and its time and position in other units."""
    signal = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
    arm.write_csv(lab / "bad.csv", [replace(signal, q=q * signal.q, t=time * signal.t)])
    edit(lab, lambda lines: [columns, *lines[1:]])


def name(lab, **channels):  # noqa: F811
    text = (lab / "study.toml").read_text()
    head, tail = text[: text.rindex("[log.channels]")], text[text.rindex("[log.channels]") :]
    for key, channel in channels.items():
        quantity = "time" if key == "time" else f"hand_roll.{key}"
        old = next(line for line in tail.splitlines() if line.replace('"', "").startswith(f"{quantity} ="))
        tail = tail.replace(old, f"{old.partition('=')[0]}= {channel}")
    (lab / "study.toml").write_text(head + tail)


@pytest.mark.parametrize(
    ("columns", "time", "q"),
    [
        ("time / ms,q / deg", "time / ms", "q / deg"),
        ("time_ms,q_deg", "time_ms", "q_deg"),
        ("t [ms],q [deg]", "t [ms]", "q [deg]"),
        ("t (ms),q (deg)", "t (ms)", "q (deg)"),
    ],
)
def test_units_in_names_come_to_si(lab, columns, time, q):  # noqa: F811
    heads = (lab / "bad.csv").read_text().splitlines()[0].split(",")
    scaled(lab, ",".join([*columns.split(","), *heads[2:]]), 1e3, np.degrees(1.0))
    name(lab, time=f'"{time}"', q=f'"{q}"')
    call("ingest", lab)
    good, bad = (davinci_forces.read(lab, "Recording", log=log) for log in ("good", "bad"))
    for column in ("t", "q"):
        np.testing.assert_allclose(bad[column], good[column], rtol=1e-9, atol=1e-9)


def test_the_study_has_the_last_word_on_a_word_in_a_name(lab):  # noqa: F811
    heads = (lab / "bad.csv").read_text().splitlines()[0].split(",")
    edit(lab, lambda lines: [",".join([heads[0], "q_ma", *heads[2:]]), *lines[1:]])
    name(lab, q='"q_ma"')
    assert "is in 'mA', which measures current, but hand_roll.q needs angle; give its unit" in run(lab)
    name(lab, q='{ channel = "q_ma", unit = "rad" }')
    call("ingest", lab)
    good, bad = (davinci_forces.read(lab, "Recording", log=log) for log in ("good", "bad"))
    np.testing.assert_allclose(bad["q"], good["q"], rtol=1e-9, atol=1e-9)


def test_nanoseconds_since_1970_are_no_seconds(lab):  # noqa: F811
    """Without a header, too."""

    def stamp(line):
        t, *cells = line.split(",")
        return ",".join([str(1_792_065_599_800_000_000 + round(1e9 * float(t))), *cells])

    edit(lab, lambda lines: [stamp(line) for line in lines[1:]])
    heads = (lab / "good.csv").read_text().splitlines()[0].split(",")
    name(
        lab,
        time="0",
        q=str(heads.index("hand_roll.q")),
        dq=str(heads.index("hand_roll.dq")),
        tau=str(heads.index("hand_roll.tau")),
    )
    call("ingest", lab)
    good, bad = (davinci_forces.read(lab, "Recording", log=log) for log in ("good", "bad"))
    np.testing.assert_allclose(bad["t"], good["t"], atol=1e-6)


def test_names_state_units_in_other_formats_too():
    log, _ = read(matlab({"t_ms": np.arange(9.0), "arm": {"q_deg": np.ones(9), "tau": np.ones(9)}}), "log.mat")
    assert {channel.name: channel.unit for channel in log.channels} == {"t_ms": "ms", "arm/q_deg": "deg", "arm/tau": ""}
