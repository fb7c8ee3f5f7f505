"""What every test may ask for, which tests take long, and how a run speaks of what it did not check."""

import os
import signal
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from typer.testing import CliRunner

from davinci_forces.runner.processes import arithmetic

if (
    signal.getsignal(signal.SIGINT) == signal.SIG_IGN
):  # as of a run in the background, whose children would pass it over
    signal.signal(signal.SIGINT, signal.default_int_handler)
arithmetic.pin()  # before anything loads numpy, as on the command line
os.environ["MPLBACKEND"] = "Agg"
# How long examples take is a matter of the machine and of what else it does: no test fails of it.
slow_machine = [HealthCheck.too_slow]
settings.register_profile("project", deadline=None, derandomize=True, suppress_health_check=slow_machine)
settings.register_profile("quick", settings.get_profile("project"), max_examples=20)
settings.load_profile("project")

HERE = Path(__file__).parent
ROOT = HERE.parent
BESIDE = ROOT.parent / "shared" / "data"
BENCHMARKS = HERE / "benchmarks"
# An arm whose friction the models describe (`matched`), and the same arm with another friction (`realistic`).
TWO_FRICTIONS = str(HERE / "simulation" / "two-frictions.toml")

# Tests that take seconds beside those that take moments; a whole file where no test is named.  A new test says so
# itself, with `@pytest.mark.medium`.
MEDIUM: dict[str, tuple[str, ...]] = {
    "contracts/test_formats.py": ("test_a_file_that_was_cut_gives_whole_rows_or_a_clear_error",),
    "contracts/test_sections.py": (),
    "logs/test_lvm.py": (
        "test_any_table_cut_at_any_byte_gives_whole_rows_or_a_clear_error",
        "test_blocks_of_any_size_give_the_same_samples",
    ),
    "models/test_model.py": (
        "test_a_filter_tracks_each_joint_of_a_coupled_arm_with_what_the_model_says_of_it",
        "test_the_effort_of_a_coupled_arm_is_that_of_its_links_drives_and_friction",
    ),
    "robot/test_kernels.py": (),
    "logs/test_labview_files.py": (
        "test_a_file_of_each_kind_cut_at_every_other_byte_gives_whole_rows_or_a_clear_error",
    ),
    "report/test_report_figures.py": ("test_another_process_gives_the_same_bytes",),
    "report/test_report_html.py": (
        "test_a_dozen_long_traces_stay_under_five_megabytes",
        "test_hundreds_of_small_figures_leave_room_and_each_takes_three_kilobytes",
    ),
    "robot/test_rigid_body.py": (
        "test_mass_matrix_coriolis_and_gravity_are_those_of_an_independent_lagrangian[6]",
        "test_mass_matrix_coriolis_and_gravity_are_those_of_an_independent_lagrangian[7]",
    ),
    "simulation/test_closed_loop.py": (),
    "simulation/test_control.py": (),
    "simulation/test_excitation.py": (
        "test_a_design_for_the_condition_number_is_better_at_it_than_one_for_the_determinant",
        "test_a_design_for_the_condition_number_need_not_touch_the_limits",
        "test_a_designed_trajectory_is_the_best_there_is_and_keeps_its_limits_at_every_instant",
        "test_the_same_seed_designs_the_same_trajectory",
    ),
    "simulation/test_excite_command.py": (
        "test_how_far_the_starts_of_a_search_agree_is_said",
        "test_a_plot_is_the_same_bytes_twice",
        "test_a_robot_of_a_laboratory_can_be_excited_too",
        "test_joints_of_independent_models_that_move_together_share_a_period_and_sum_their_objectives",
    ),
    "simulation/test_friction.py": (),
    "simulation/test_simulation_plant.py": (),
    "simulation/test_simulation_step.py": (),
    "test_bad_logs.py": ("test_names_that_are_markup_appear_as_text_in_both_reports",),
    "test_design.py": (),
    "test_estimation.py": ("test_parameters_are_found_as_well_as_they_claim_to_be",),
    "test_real_data.py": (),
    "test_robustness.py": (
        "test_a_missing_file_costs_its_own_log_and_no_other",
        "test_the_readers_of_logs_count_for_ingest_and_the_store_for_every_stage",
        "test_verify_compares_a_file_with_what_every_task_knew_of_it",
        "test_verify_names_a_deviation_or_a_unit_that_was_altered",
        "test_verify_names_results_that_are_gone_or_odd",
        "test_verify_passes_over_files_that_are_no_entries",
    ),
    "test_runs.py": (),
}


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="run the longest studies, too")
    parser.addoption("--full", action="store_true", help="run benchmarks, at their full size")


def pytest_configure(config: pytest.Config) -> None:
    if "not medium" in config.getoption("markexpr"):
        settings.load_profile("quick")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Benchmarks hold on a machine that does nothing else, so they run by themselves: asked for, or named."""
    return True if collection_path == BENCHMARKS and not _benchmarks(config) else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    for item in items:
        if _medium(item):
            item.add_marker(pytest.mark.medium)
        if "slow" in item.keywords and not config.getoption("--slow"):
            item.add_marker(pytest.mark.skip(reason="one of the longest studies; run with --slow"))


def _medium(item: pytest.Item) -> bool:
    """Whether a test is listed as medium, by its own name or with its whole file."""
    file = item.path.relative_to(HERE).as_posix() if item.path.is_relative_to(HERE) else ""
    names = MEDIUM.get(file)
    return names is not None and (not names or bool({item.name, item.name.partition("[")[0]} & set(names)))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """One line for every test, or file of tests, that was not run, with the reason."""
    skipped = defaultdict(list)
    for report in terminalreporter.stats.get("skipped", ()):
        file, _, name = report.nodeid.partition("::")
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        skipped[file, reason.removeprefix("Skipped: ")].append(name.partition("[")[0].removeprefix("test_"))
    for (file, reason), names in skipped.items():
        many = list(dict.fromkeys(name.replace("_", " ") for name in names if name))
        what = "all of it" if not many else many[0] if len(many) == 1 else f"{len(names)} tests, {many[0]!r} the first"
        terminalreporter.write_line(f"not checked: {file}: {what} ({reason})")
    left_out = [mark for mark in ("medium", "slow") if f"not {mark}" in config.getoption("markexpr")]
    if left_out:
        terminalreporter.write_line(f"not checked: tests marked {' or '.join(left_out)} (`make test` runs them)")
    if not _benchmarks(config) and HERE.is_relative_to(config.rootpath):
        terminalreporter.write_line("not checked: how fast it is (`make bench` does)")


def _benchmarks(config: pytest.Config) -> bool:
    named = any(Path(argument.partition("::")[0]).resolve().is_relative_to(BENCHMARKS) for argument in config.args)
    return named or bool(config.getoption("--full"))


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real recordings, which are not ours to ship; tests on them skip where it is absent."""
    folder = Path(os.environ.get("DAVINCI_FORCES_DATA", BESIDE))
    if not folder.is_dir():
        pytest.skip(f"real recordings are not at {folder}; set DAVINCI_FORCES_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small study that every stage has run on; it is made once a run of the tests, and not to be changed."""

    def make(home: Path) -> None:
        from davinci_forces.cli import app
        from tests.arm import write_study

        done = CliRunner().invoke(app, ["all", str(write_study(home / "raw" / "arm"))])
        assert done.exit_code == 0, done.output

    return once(tmp_path_factory, "analysed", make) / "raw" / "arm"


def once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """A folder that one of the processes that run the tests fills, and that the others wait for."""
    base = factory.getbasetemp()
    home = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name
    done, failed = home.with_suffix(".done"), home.with_suffix(".failed")
    try:
        os.close(os.open(home.with_suffix(".begun"), os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        until = time.monotonic() + 600
        while not done.exists():
            if failed.exists() or time.monotonic() > until:
                pytest.fail(f"{name} was not made by the process that began to; its own error says why")
            time.sleep(0.1)
        return home
    try:
        make(home)
    except BaseException:
        failed.touch()
        raise
    done.touch()
    return home
