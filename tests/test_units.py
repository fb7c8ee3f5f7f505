"""Units, their spellings, and the units that names of channels state."""

import pytest

from davinci_forces.maths.units import UNITS, canonical, measures, size, split_ratio, unit_after_groups, unit_in

SPELLED = {
    "deg": ("°", "Deg", "DEGREES", "degs"),
    "deg/s": ("°/s", "deg/sec", "degrees per second", "deg s^-1", "dps", "deg·s⁻¹"),
    "rad/s": ("radians/s", "rad s-1"),
    "N m": ("Nm", "N-m", "N·m", "N*m", "nm", "NEWTON METERS"),
    "mN m": ("mNm", "N mm"),
    "ms": ("msec", "Milliseconds", "MS"),
    "us": ("µs", "μs", "usecs"),
    "ns": ("nanosec",),
    "s": ("Sec", "seconds", "sec."),
    "rpm": ("RPM", "1/min", "rev/min", "min^-1", "U/min"),
    "A": ("Amps", "Ampere"),
    "mA": ("milliamps", "ma"),
    "um": ("µm",),
    "min": ("minutes", "mins"),
    "rev": ("turns", "revs"),
}
NAMED = {
    "deg": (
        "q [deg]",
        "q(deg)",
        "q {deg}",
        "q / deg",
        "q/deg",
        "q_deg",
        "q deg",
        "q-deg",
        "q.deg",
        "qDeg",
        "posDeg",
        "q_DEG",
        "q_deg_1",
        "q_deg_filtered",
        "q[0] (deg)",
        "q_deg[0]",
        "Angle [deg] J1",
        "q / (deg)",
        "q (joint 1) [deg]",
        "q, deg",
        "/arm/joint1/q_deg",
        "q_degrees",
    ),
    "°": ("q [°]", "q / °"),
    "deg/s": ("dq_deg_s", "dq_deg_per_s", "dq / deg/s", "dq [deg/s]", "dqDegPerS", "dq_dps", "deg/s"),
    "ms": ("time / ms", "time_ms", "TimeMs", "time (ms)", "time_msec", "t ms"),
    "us": ("t_us", "time_usec", "us"),
    "ns": ("t_ns", "time_nanosec", "/js/stamp/t_nsec"),
    "min": ("time_min", "t / min"),
    "s": ("t_s", "t/s", "time_sec"),
    "N m": ("tau_Nm", "tau_N_m", "torqueNm", "tau / Nm", "tau_nm"),
    "mN m": ("tau_mNm", "tau_mN_m", "torquemNm", "tau / (mN m)"),
    "mA": ("i_mA", "i_ma", "currentmA", "i / mA"),
    "A": ("current_A", "I / A"),
    "rpm": ("speed_rpm", "motorRpm", "n_rev_min"),
    "mm": ("x_mm", "x / mm"),
    "m": ("depth_m", "x / m"),
    "counts": ("q_counts", "q / counts"),
    "V": ("force_V", "u [V]"),
    "kgf": ("load_kgf",),
    "lbf": ("q [lbf]",),
    "rev?": ("q_rev",),
    "rad/s^2": ("ddq [rad/s^2]",),
    "outer yaw": ("q (outer yaw)",),
    "": (
        "q",
        "q[0]",
        "q(1)",
        "effort[outer_yaw]",
        "tau (joint 2)",
        "theta_m",
        "q_min",
        "q_s",
        "tau_g",
        "x_m",
        "deg_q",
        "grad",
        "position",
        "/joint_states/position/panda_joint1",
        "field.position0",
        "%time",
        "sec",
        "m",
        "q_1",
        "",
        "phase_b",
        "/arm/rad/q",
        "arm / q",
        "radius",
        "current",
        "Motor Pos",
        "f_N",
    ),
}


def test_spellings_of_a_unit_are_one_unit():
    for unit, spellings in SPELLED.items():
        assert {written: canonical(written) for written in spellings} == dict.fromkeys(spellings, unit)


@pytest.mark.parametrize(
    "word", ["M", "S", "g", "V", "counts", "rad/s^2", "deg/s2", "10^-3 rad", "1e-3 rad", "kN m", "joint", ""]
)
def test_other_words_are_no_units(word):
    assert measures(word) is None
    assert canonical(word) == word


def test_a_name_states_the_unit_that_people_read_in_it():
    for unit, names in NAMED.items():
        assert {name: canonical(unit_in(name)) for name in names} == dict.fromkeys(names, canonical(unit))


def test_a_quantity_over_its_unit_is_split():
    assert split_ratio("time / ms") == ("time", "ms")
    assert split_ratio("dq / (deg/s)") == ("dq", "deg/s")
    assert split_ratio("dq (deg/s)") == ("dq (deg/s)", "")
    assert split_ratio("/arm/s") == ("/arm/s", "")
    assert split_ratio("Roll vel, rad/s") == ("Roll vel", "rad/s")
    assert split_ratio("speed_deg/s") == ("speed", "deg/s")


def test_the_unit_of_a_channel_in_groups_stands_after_their_names():
    named = {
        "Roll vel (deg/s)": "deg/s", "arm/1/speed [m/s]": "m/s", "arm/speed deg/s": "deg/s", "arm/q_deg": "deg",
        "group [A]/q [rad]": "rad", "group [A]/count": "", "arm/time / ms": "ms", "rad/s/q": "",
    }  # fmt: skip
    assert {name: unit_after_groups(name) for name in named} == named


def test_sizes_are_those_of_si():
    assert size("mN m") == 1e-3
    assert 6 * size("deg/s") == pytest.approx(size("rpm"))
    assert size("h") == 60 * size("min") == 3600 * size("s")
    assert all(canonical(unit) == unit for unit in UNITS)
