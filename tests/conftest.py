"""What every test may ask for, which tests take long, and how a run speaks of what it did not check."""

import gc
import os
import pickle
import shutil
import signal
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from typer.testing import CliRunner

from davinci_forces.runner.processes import arithmetic

if (
    signal.getsignal(signal.SIGINT) == signal.SIG_IGN
):  # as of a run in the background, whose children would pass it over
    signal.signal(signal.SIGINT, signal.default_int_handler)
IN_MEMORY, ROOM = Path("/dev/shm"), 3e9  # [bytes]; a run holds a sixth of it at a time
if "TMPDIR" not in os.environ and IN_MEMORY.is_dir() and shutil.disk_usage(IN_MEMORY).free > ROOM:
    # A run makes and removes 36,000 small files, for which a file system on a disk takes a fifth of the CPU time.
    os.environ["TMPDIR"] = tempfile.tempdir = str(IN_MEMORY)
arithmetic.pin()  # before anything loads numpy, as on the command line
os.environ["MPLBACKEND"] = "Agg"
gc.set_threshold(10_000)  # Python's own costs a twentieth of the time: modules and tests are many objects to search
# How long examples take is a matter of the machine and of what else it does: no test fails of it.
slow_machine = [HealthCheck.too_slow]
settings.register_profile("project", deadline=None, derandomize=True, suppress_health_check=slow_machine)
settings.register_profile("quick", settings.get_profile("project"), max_examples=20)
settings.load_profile("project")

HERE = Path(__file__).parent
ROOT = HERE.parent
BESIDE = ROOT.parent / "shared" / "data"
BENCHMARKS = HERE / "benchmarks"
DRAWN: dict[bytes, dict[str, bytes]] = {}  # the pages of documents, by a hash of what they show
# An arm whose friction the models describe (`matched`), and the same arm with another friction (`realistic`).
TWO_FRICTIONS = str(HERE / "simulation" / "two-frictions.toml")
# A coarser design of a robot: one start of each search of an excitation, and larger tolerances of simulated control.
QUICK_DESIGN = {
    "davinci_forces.stages.design.STARTS": 1,
    "davinci_forces.maths.simulation.continuous.RELATIVE": 1e-4,
    "davinci_forces.maths.simulation.continuous.ABSOLUTE": 1e-6,
}

# Tests that take seconds beside those that take moments; a whole file where no test is named.  A new test says so
# itself, with `@pytest.mark.medium`.
MEDIUM: dict[str, tuple[str, ...]] = {
    "contracts/test_approved.py": (),
    "contracts/test_estimators.py": (),
    "contracts/test_exports.py": (),
    "contracts/test_formats.py": ("test_a_file_that_was_cut_gives_whole_rows_or_a_clear_error",),
    "contracts/test_sections.py": (),
    "contracts/test_stream.py": (),
    "haptics/test_feel.py": (),
    "haptics/test_hand_limits.py": (),
    "haptics/test_limit.py": (),
    "haptics/test_stability.py": (),
    "logs/test_labview_files.py": (
        "test_a_file_of_each_kind_cut_at_every_other_byte_gives_whole_rows_or_a_clear_error",
    ),
    "logs/test_lvm.py": (
        "test_any_table_cut_at_any_byte_gives_whole_rows_or_a_clear_error",
        "test_blocks_of_any_size_give_the_same_samples",
    ),
    "models/test_model.py": (
        "test_a_filter_tracks_each_joint_of_a_coupled_arm_with_what_the_model_says_of_it",
        "test_the_effort_of_a_coupled_arm_is_that_of_its_links_drives_and_friction",
    ),
    "new/test_dialects.py": (),
    "report/test_campaign.py": (),
    "report/test_joint_pages.py": (),
    "report/test_report_figures.py": (),
    "report/test_report_html.py": ("test_a_dozen_long_traces_stay_under_five_megabytes",),
    "robot/test_kernels.py": (),
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
    "test_arrays.py": (),
    "test_bad_logs.py": (),
    "test_clock_faults.py": (),
    "test_compare.py": (),
    "test_consistent.py": (),
    "test_design.py": (),
    "test_error_band.py": (),
    "test_estimation.py": (),
    "test_export.py": (),
    "test_force_sensor.py": (),
    "test_new.py": (),
    "test_period.py": (),
    "test_real_data.py": (),
    "test_robustness.py": (),
    "test_runs.py": (),
    "test_sizes.py": (),
    "test_small_files.py": (),
    "test_tampering.py": (),
    "test_total_least_squares.py": (),
    "test_verified_runs.py": (),
    "test_weighing.py": (),
    "test_whiteness.py": (),
    "tissue/test_palpation.py": (),
}

# Tests that `make test` leaves to `--slow`, which continuous integration runs: for every test of a file, or with a
# number, for the cases of a test beyond so many.
SLOW: dict[str, dict[str, int]] = {
    "contracts/test_estimators.py": {
        "test_errors_are_as_large_as_stated": 5,
        "test_errors_are_as_large_as_stated_where_noise_differs_over_the_period": 3,
    },
    "contracts/test_exports.py": {
        "test_a_stranger_computes_the_predicted_effort_from_the_json_alone": 1,
    },
    "contracts/test_formats.py": {
        "test_a_file_that_was_cut_gives_whole_rows_or_a_clear_error": 0,
    },
    "contracts/test_sections.py": {
        "test_a_kind_of_record_that_is_missing_costs_no_section": 10,
    },
    "contracts/test_stages.py": {
        "test_the_same_records_give_the_same_records_and_nothing_else_is_read": 0,
    },
    "contracts/test_stream.py": {
        "test_jitter_and_single_gaps_are_no_other_rate": 0,
        "test_samples_at_another_rate_warn_and_give_no_number": 2,
        "test_effort_and_inertia_are_those_of_the_model_with_every_term": 1,
    },
    "guide/test_notebook.py": {},
    "guide/test_tutorials.py": {},
    "haptics/test_feel.py": {
        "test_a_device_that_scales_motion_and_force_renders_a_stiffness_scaled_by_both": 0,
        "test_a_file_with_the_lines_that_the_report_shows_has_the_limits_of_the_report": 0,
        "test_a_stated_stiffness_takes_the_place_of_the_measured_one": 0,
        "test_the_filter_s_noise_is_the_joint_s": 0,
    },
    "haptics/test_hand_limits.py": {
        "test_formula_response_and_simulation_of_the_same_loop_agree_within_5_percent": 1,
        "test_the_limit_by_simulation_is_the_same_from_every_guess": 1,
        "test_with_an_ideal_arm_every_limit_is_that_of_a_held_force": 1,
    },
    "haptics/test_haptic_scenario.py": {},
    "haptics/test_stability.py": {
        "test_no_switching_at_random_grows_below_the_limit": 1,
    },
    "logs/test_damage.py": {},
    "logs/test_isolated.py": {
        "test_a_child_ends_with_its_parent": 0,
        "test_a_child_that_takes_too_long_is_ended": 1,
    },
    "logs/test_ros_cut.py": {
        "test_damage_of_any_other_bag_is_refused_or_changes_no_more_than_what_it_hit": 1,
        "test_of_a_bag_that_is_cut_anywhere_the_messages_before_are_read_and_counted": 1,
    },
    "models/test_together.py": {
        "test_coupling_that_one_log_shows_is_part_of_the_search": 0,
        "test_the_searched_model_of_coupled_joints_is_chosen": 0,
    },
    "new/test_dialects.py": {
        "test_a_folder_of_the_field_is_read_right_without_an_edit": 5,
    },
    "report/test_campaign.py": {
        "test_a_campaign_opens_in_a_browser_without_a_word_of_error": 0,
        "test_a_trend_through_values_that_scatter_is_that_of_statsmodels": 0,
        "test_joints_of_two_robots_share_nothing_but_a_name": 0,
        "test_the_same_studies_give_the_same_bytes": 0,
    },
    "report/test_report_browser.py": {
        "test_a_browser_opens_it_without_a_word_and_nothing_is_wider_than_the_window": 1,
        "test_a_finger_that_swipes_over_traces_scrolls_the_page": 0,
        "test_a_number_shows_its_key_and_an_address_finds_it": 0,
        "test_colours_follow_the_page_into_the_dark": 0,
        "test_the_contents_show_where_the_reader_is": 0,
    },
    "report/test_report_pdf.py": {
        "test_an_equation_stays_on_the_page_of_the_table_that_follows_it": 0,
        "test_no_table_leaves_the_page_and_a_long_one_repeats_its_header": 1,
    },
    "robot/test_rigid_body.py": {
        "test_mass_matrix_coriolis_and_gravity_are_those_of_an_independent_lagrangian": 1,
    },
    "robot/test_urdf.py": {
        "test_a_base_turned_in_the_study_is_a_base_turned_in_the_file": 0,
    },
    "simulation/test_excitation.py": {
        "test_a_designed_trajectory_is_the_best_there_is_and_keeps_its_limits_at_every_instant": 1,
    },
    "simulation/test_excitation_limits.py": {
        "test_the_gradient_of_the_search_is_that_of_differences": 1,
        "test_a_motion_is_shrunk_until_efforts_and_obstacles_hold_at_every_instant": 0,
        "test_ranges_of_a_design_touch_a_limit": 0,
    },
    "simulation/test_excite_command.py": {
        "test_a_plot_is_the_same_bytes_twice": 0,
    },
    "simulation/test_thesis_study.py": {},
    "test_arrays.py": {
        "test_a_constant_offset_is_subtracted_where_free_windows_are_given": 0,
        "test_a_saved_study_gives_the_numbers_of_the_arrays_and_a_stream": 0,
        "test_data_frames_give_the_numbers_of_arrays_with_joints_by_their_names": 0,
        "test_nothing_is_printed_and_the_folder_is_removed_with_the_object": 0,
        "test_settings_are_saved_and_a_robot_of_no_file_is_not": 0,
    },
    "test_averaging.py": {
        "test_a_period_of_any_length_is_found_to_its_stated_uncertainty": 0,
    },
    "test_bad_logs.py": {
        "test_a_spoilt_log_is_named_and_the_good_one_goes_on": 3,
        "test_names_that_are_markup_appear_as_text_in_both_reports": 0,
    },
    "test_cli.py": {
        "test_tasks_that_run_together_say_what_each_took": 0,
    },
    "test_compare.py": {
        "test_a_report_says_what_changed_since_its_baseline_and_is_made_anew_when_that_changes": 0,
        "test_an_altered_contact_log_changes_its_own_numbers_alone": 0,
        "test_two_runs_of_the_same_data_find_nothing": 0,
    },
    "test_compiled.py": {},
    "test_consistent.py": {
        "test_the_arm_has_a_fit_of_its_own_by_this_estimator": 0,
    },
    "test_design.py": {
        "test_a_chain_that_no_table_describes_has_links_without_parameters": 0,
        "test_a_robot_of_any_number_of_joints_has_a_design": 0,
    },
    "test_error_band.py": {
        "test_an_unseen_log_is_covered_overall_and_at_every_speed": 2,
    },
    "test_estimation.py": {
        "test_a_joint_is_fitted_anew_at_most_twenty_times_however_many_its_logs_are": 0,
        "test_many_logs_are_left_out_in_twenty_folds_of_neighbours": 0,
    },
    "test_export_c.py": {},
    "test_faults.py": {
        "test_a_disk_that_takes_no_more_is_said_and_leaves_no_partial_file": 1,
        "test_a_report_that_failed_once_is_the_same_as_that_of_a_clean_run": 0,
        "test_a_report_that_is_stopped_leaves_no_half_page": 0,
        "test_a_run_that_is_stopped_says_so_in_one_line_and_goes_on_next_time": 1,
        "test_a_run_that_is_stopped_while_a_child_reads_a_log_leaves_no_child": 0,
        "test_a_stage_that_failed_once_leaves_nothing_behind": 0,
        "test_where_nothing_can_be_written_what_needs_no_writing_is_done": 0,
    },
    "test_files.py": {
        "test_a_log_that_is_a_pipe_costs_its_own_tasks_and_no_other": 0,
        "test_a_pipe_in_place_of_what_a_run_made_is_replaced_by_the_next": 0,
        "test_verify_names_what_a_run_made_and_is_no_file_any_more": 0,
    },
    "test_impossible_logs.py": {
        "test_no_log_however_impossible_ends_in_a_bug": 3,
    },
    "test_force_sensor.py": {
        "test_a_simulated_sensor_gives_the_error_the_lag_and_the_coverage_that_were_simulated": 0,
    },
    "test_new.py": {
        "test_a_joint_of_another_arm_is_identified_from_what_new_writes_corrected_or_not": 0,
        "test_a_stranger_s_folder_becomes_a_study": 2,
    },
    "test_nothing_lost.py": {
        "test_a_report_that_fails_leaves_the_last_one_and_says_that_it_is_older": 0,
        "test_an_entry_of_another_shape_is_none": 2,
        "test_what_an_earlier_version_made_goes_and_the_rest_is_as_if_it_had_never_been": 0,
    },
    "test_period.py": {
        "test_a_step_of_the_clock_costs_the_shorter_side_at_most": 3,
        "test_intervals_of_the_period_cover_whatever_the_colour_of_the_noise": 0,
        "test_motion_at_random_does_not_repeat": 3,
    },
    "test_planning.py": {
        "test_planning_takes_steps_in_proportion_to_the_logs": 0,
        "test_what_a_call_reads_does_not_grow_with_the_logs": 0,
    },
    "test_project.py": {
        "test_benchmarks_run_only_where_they_are_asked_for": 0,
    },
    "test_real_data.py": {},
    "test_robustness.py": {
        "test_a_missing_file_costs_its_own_log_and_no_other": 0,
        "test_verify_names_a_deviation_or_a_unit_that_was_altered": 1,
        "test_what_one_joint_of_a_log_suffers_costs_no_other_joint_or_log": 0,
        "test_without_flock_exactly_one_of_many_runs_takes_a_lock_that_was_left": 1,
    },
    "test_runs.py": {
        "test_a_group_of_a_fresh_study_runs_its_stages_and_what_they_need": 0,
        "test_a_report_of_long_records_whose_columns_are_read_when_asked_for_is_the_same": 0,
        "test_a_report_that_fails_says_so_costs_no_stage_and_is_tried_again": 0,
        "test_a_run_ends_with_the_answer_the_times_and_where_it_is": 0,
        "test_a_stage_runs_again_and_says_why": 0,
        "test_the_report_is_written_again_when_what_it_shows_or_it_itself_changed": 0,
        "test_the_same_data_give_the_same_bytes_whatever_the_number_of_processes": 0,
    },
    "test_shown.py": {
        "test_a_name_that_is_no_unicode_costs_a_message": 0,
        "test_a_run_and_its_pages_show_them": 0,
    },
    "test_small_files.py": {
        "test_a_study_of_as_many_logs_as_may_be_is_read": 0,
        "test_a_study_that_would_cost_minutes_is_refused_in_words": 1,
        "test_a_urdf_that_would_cost_minutes_is_refused_in_words": 2,
    },
    "test_standstill.py": {
        "test_a_period_is_predicted_by_who_has_not_seen_it": 1,
    },
    "test_tampering.py": {
        "test_a_flipped_byte_in_any_record_is_a_message": 5,
        "test_a_printed_page_tells_a_report_that_was_forged_with_all_its_files": 0,
        "test_a_stage_that_fails_only_when_it_is_recomputed_is_named": 0,
        "test_an_honest_study_comes_from_raw_byte_for_byte_and_is_not_touched": 0,
        "test_on_another_processor_numbers_are_compared": 0,
        "test_verify_names_what_was_done": 2,
        "test_what_was_forged_with_all_its_hashes_does_not_come_from_raw": 0,
    },
    "test_verified_runs.py": {
        "test_verify_names_a_file_in_which_one_byte_was_altered": 3,
    },
    "test_weighing.py": {
        "test_free_motion_at_another_speed_is_part_of_the_error_of_each_joint": 0,
        "test_intervals_of_torque_constants_hold_the_true_ones_at_the_stated_rate": 0,
        "test_joints_that_tell_different_masses_are_named_and_widen_the_interval": 0,
        "test_the_proposed_constant_does_not_depend_on_the_one_in_use_and_is_not_applied": 1,
    },
    "test_wheel.py": {},
    "test_whiteness.py": {
        "test_white_noise_fails_each_test_as_often_as_stated": 1,
    },
    "test_workers.py": {
        "test_a_worker_that_is_killed_with_nothing_to_do_is_replaced": 0,
        "test_workers_end_with_their_parent_however_it_ends": 0,
    },
    "tissue/test_tissue_logs.py": {},
}


# Files that take longest: they come first, so that no process ends long before the others, and no two that make the
# same study are next to each other.
FIRST = (
    "test_other_arms.py", "test_files.py", "guide/test_tutorials.py", "test_impossible_logs.py", "test_faults.py",
    "test_runs.py", "test_cluster.py", "test_long_logs.py", "test_real_data.py", "simulation/test_excitation_limits.py",
    "contracts/test_approved.py", "test_tampering.py", "test_weighing.py", "contracts/test_sections.py",
    "test_wheel.py", "logs/test_damage.py", "guide/test_notebook.py", "logs/test_bag_study.py", "tissue/test_arm.py",
    "test_compiled.py", "test_robustness.py", "test_verified_runs.py", "logs/test_ros_cut.py", "robot/test_kernels.py",
    "simulation/test_thesis_study.py", "tissue/test_palpation.py", "simulation/test_excitation.py", "test_ekf.py",
    "tissue/test_tissue_logs.py", "simulation/test_closed_loop.py", "test_period.py", "contracts/test_estimators.py",
    "report/test_campaign.py", "test_consistent.py", "test_parameter_errors.py", "test_shipped_studies.py",
    "test_small_files.py",
)  # fmt: skip


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="run the longest studies, too")
    parser.addoption("--approve", action="store_true", help="keep what there is now as what was approved")
    parser.addoption("--full", action="store_true", help="run benchmarks, at their full size")


def pytest_configure(config: pytest.Config) -> None:
    if "not medium" in config.getoption("markexpr") or not config.getoption("--slow"):
        settings.load_profile("quick")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Benchmarks hold on a machine that does nothing else, so they run by themselves: asked for, or named."""
    return True if collection_path == BENCHMARKS and not _benchmarks(config) else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if "PYTEST_XDIST_WORKER" in os.environ:
        items.sort(key=lambda item: FIRST.index(_file(item)) if _file(item) in FIRST else len(FIRST))
    cases: Counter[tuple[str, str]] = Counter()
    for item in items:
        file, test = _file(item), item.name.partition("[")[0]
        if _medium(item):
            item.add_marker(pytest.mark.medium)
        cases[file, test] += 1
        if file in SLOW and (not SLOW[file] or cases[file, test] > SLOW[file].get(test, cases[file, test])):
            item.add_marker(pytest.mark.slow)
        if "slow" in item.keywords and not config.getoption("--slow"):
            item.add_marker(pytest.mark.skip(reason="one of the longest studies; run with --slow"))


def pytest_collection_finish() -> None:
    """Let the collector pass over what was collected of tests and modules, which stays to the end."""
    gc.freeze()


def _medium(item: pytest.Item) -> bool:
    """Whether a test is listed as medium, by its own name or with its whole file."""
    names = MEDIUM.get(_file(item))
    return names is not None and (not names or bool({item.name, item.name.partition("[")[0]} & set(names)))


def _file(item: pytest.Item) -> str:
    """The file of a test within this folder; "" of another folder."""
    return item.path.relative_to(HERE).as_posix() if item.path.is_relative_to(HERE) else ""


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


@pytest.fixture(scope="module")
def drawn_once() -> Iterator[None]:
    """Each document is drawn once a process: where a report is made anew, it is nearly always what it was.

    Not where the same data have to give the same pages, in test_runs.py: a page that is remembered is the same anyhow.
    """
    from davinci_forces.report import report

    draw = report.render_all

    def remembered(documents):
        pages = {}
        for document in documents:
            key = sha256(pickle.dumps(document)).digest()
            if key not in DRAWN:
                DRAWN[key] = draw((document,))
            pages |= DRAWN[key]
        return pages

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "render_all", remembered)
        yield


@pytest.fixture(scope="module")
def quick_design() -> Iterator[None]:
    """A coarser design of the robot, for tests on logs, which it does not depend on."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in QUICK_DESIGN.items():
            patch.setattr(name, value)
        yield


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
