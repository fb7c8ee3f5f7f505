"""How long tests take: those that `make quick` and `make test` leave out, and the files that begin first."""

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
        "test_errors_are_as_large_as_stated": 1,
        "test_errors_are_as_large_as_stated_where_noise_differs_over_the_period": 1,
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
        "test_contacts_and_standstill_are_told": 0,
        "test_effort_and_inertia_are_those_of_the_model_with_every_term": 1,
        "test_jitter_and_single_gaps_are_no_other_rate": 0,
        "test_samples_at_another_rate_warn_and_give_no_number": 2,
        "test_the_band_holds_a_push_that_the_filter_shows_late": 0,
    },
    "guide/test_notebook.py": {},
    "guide/test_tutorials.py": {},
    "haptics/test_feel.py": {
        "test_a_device_that_scales_motion_and_force_renders_a_stiffness_scaled_by_both": 0,
        "test_a_file_with_the_lines_that_the_report_shows_has_the_limits_of_the_report": 0,
        "test_a_stated_stiffness_takes_the_place_of_the_measured_one": 0,
        "test_the_filter_s_noise_is_the_joint_s": 0,
        "test_the_tick_that_is_named_for_an_unstable_arm_is_the_longest_that_has_limits": 0,
    },
    "haptics/test_hand_limits.py": {
        "test_formula_response_and_simulation_of_the_same_loop_agree_within_5_percent": 0,
        "test_the_best_delay_is_that_of_the_largest_limit_and_no_setting_changes": 0,
        "test_the_limit_by_simulation_is_the_same_from_every_guess": 0,
        "test_with_an_ideal_arm_every_limit_is_that_of_a_held_force": 0,
    },
    "haptics/test_haptic_scenario.py": {},
    "haptics/test_stability.py": {
        "test_a_map_takes_little_longer_than_its_bare_solves": 0,
        "test_no_switching_at_random_grows_below_the_limit": 1,
    },
    "logs/test_clocks.py": {
        "test_any_history_of_writes_has_the_samples_of_nptdms_and_the_times_of_a_slow_witness": 0,
    },
    "logs/test_damage.py": {},
    "logs/test_isolated.py": {
        "test_a_child_ends_with_its_parent": 0,
        "test_a_child_that_takes_too_long_is_ended": 1,
    },
    "logs/test_labview_files.py": {
        "test_a_file_of_each_kind_cut_at_every_other_byte_gives_whole_rows_or_a_clear_error": 0,
    },
    "logs/test_ros.py": {
        "test_blocks_of_a_long_bag_are_bounded_and_whole": 0,
    },
    "logs/test_ros_cut.py": {
        "test_damage_of_any_other_bag_is_refused_or_changes_no_more_than_what_it_hit": 1,
        "test_of_a_bag_that_is_cut_anywhere_the_messages_before_are_read_and_counted": 1,
    },
    "logs/test_ros_messages.py": {
        "test_every_number_is_what_rosbags_deserialises": 1,
    },
    "models/test_search.py": {
        "test_a_noisy_motion_gets_a_lower_cutoff": 0,
        "test_friction_that_reverses_within_a_short_way_is_found_and_not_hidden_by_a_low_pass": 0,
    },
    "models/test_simulated_friction.py": {
        "test_friction_that_the_joint_has_terms_for_gets_none": 0,
    },
    "models/test_together.py": {
        "test_coupling_that_one_log_shows_is_part_of_the_search": 0,
        "test_the_consistent_inertia_of_a_joint_by_itself_is_one_that_a_filter_can_divide_by": 0,
        "test_the_searched_model_of_coupled_joints_is_chosen": 0,
        "test_where_no_inertia_is_positive_it_is_warned_of_unless_another_is_used": 1,
    },
    "new/test_dialects.py": {
        "test_a_folder_of_the_field_is_read_right_without_an_edit": 1,
        "test_what_is_not_known_is_missing_and_all_says_so_and_stops": 1,
    },
    "report/test_campaign.py": {
        "test_a_campaign_opens_in_a_browser_without_a_word_of_error": 0,
        "test_a_trend_through_values_that_scatter_is_that_of_statsmodels": 0,
        "test_joints_of_two_robots_share_nothing_but_a_name": 0,
        "test_numbers_that_scatter_as_their_errors_say_are_no_finding": 0,
        "test_the_same_studies_give_the_same_bytes": 0,
    },
    "report/test_report_browser.py": {
        "test_a_browser_opens_it_without_a_word_and_nothing_is_wider_than_the_window": 1,
        "test_a_finger_that_swipes_over_traces_scrolls_the_page": 0,
        "test_a_number_shows_its_key_and_an_address_finds_it": 0,
        "test_colours_follow_the_page_into_the_dark": 0,
        "test_the_contents_show_where_the_reader_is": 0,
    },
    "report/test_report_figures.py": {
        "test_all_files_written_side_by_side_are_those_written_alone": 0,
        "test_another_process_gives_the_same_bytes": 0,
        "test_no_number_on_an_axis_touches_the_next": 1,
    },
    "report/test_report_pdf.py": {
        "test_a_caption_stays_with_the_first_row_of_its_table": 0,
        "test_an_equation_stays_on_the_page_of_the_table_that_follows_it": 0,
        "test_no_table_leaves_the_page_and_a_long_one_repeats_its_header": 1,
    },
    "robot/test_rigid_body.py": {
        "test_mass_matrix_coriolis_and_gravity_are_those_of_an_independent_lagrangian": 1,
    },
    "robot/test_urdf.py": {
        "test_a_base_turned_in_the_study_is_a_base_turned_in_the_file": 0,
    },
    "simulation/test_closed_loop.py": {
        "test_the_damping_of_a_controller_is_its_gain_times_the_change_of_position_over_its_period": 0,
    },
    "simulation/test_excitation.py": {
        "test_a_designed_trajectory_is_the_best_there_is_and_keeps_its_limits_at_every_instant": 0,
    },
    "simulation/test_excitation_limits.py": {
        "test_a_motion_is_shrunk_until_efforts_and_obstacles_hold_at_every_instant": 0,
        "test_ranges_of_a_design_touch_a_limit": 0,
        "test_the_gradient_of_the_search_is_that_of_differences": 0,
    },
    "simulation/test_excitation_search.py": {
        "test_a_search_keeps_its_memory_between_its_steps": 0,
    },
    "simulation/test_excite_command.py": {
        "test_a_plot_is_the_same_bytes_twice": 0,
        "test_how_far_the_starts_of_a_search_agree_is_said": 0,
    },
    "simulation/test_friction.py": {
        "test_bristles_that_slide_steadily_push_with_the_level_of_their_velocity": 1,
    },
    "simulation/test_scenario.py": {
        "test_no_scenario_file_however_odd_ends_in_anything_but_problems": 0,
    },
    "simulation/test_simulation_step.py": {
        "test_a_constant_effort_gives_a_parabola_exactly": 0,
    },
    "simulation/test_thesis_study.py": {},
    "test_arrays.py": {
        "test_a_constant_offset_is_subtracted_where_free_windows_are_given": 0,
        "test_a_log_for_validation_is_not_fitted_and_gives_the_band": 0,
        "test_a_saved_study_gives_the_numbers_of_the_arrays_and_a_stream": 0,
        "test_an_external_effort_leaves_the_models_and_the_predictions_as_they_are": 0,
        "test_data_frames_give_the_numbers_of_arrays_with_joints_by_their_names": 0,
        "test_notebooks_show_parameters_efforts_and_contacts": 0,
        "test_nothing_is_printed_and_the_folder_is_removed_with_the_object": 0,
        "test_settings_are_saved_and_a_robot_of_no_file_is_not": 0,
        "test_the_log_of_an_external_effort_is_saved_with_its_windows": 0,
        "test_what_a_study_s_run_warns_of_is_a_warning_of_python": 0,
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
    "test_clock_faults.py": {
        "test_missing_samples_are_filled_for_filters_and_neither_fitted_nor_judged": 0,
    },
    "test_compare.py": {
        "test_a_report_says_what_changed_since_its_baseline_and_is_made_anew_when_that_changes": 0,
        "test_an_altered_contact_log_changes_its_own_numbers_alone": 0,
        "test_two_runs_of_the_same_data_find_nothing": 0,
    },
    "test_compiled.py": {},
    "test_consistent.py": {
        "test_signs_alone_are_non_negative_least_squares": 0,
        "test_signs_that_a_joint_does_not_know_are_not_held": 0,
        "test_the_arm_has_a_fit_of_its_own_by_this_estimator": 0,
    },
    "test_design.py": {
        "test_a_chain_that_no_table_describes_has_links_without_parameters": 0,
        "test_a_robot_of_any_number_of_joints_has_a_design": 0,
    },
    "test_ekf.py": {
        "test_the_push_of_section_7_3_is_found_as_well_as_any_walk_would_and_smoothed_twice_as_well": 0,
        "test_without_a_walk_the_search_begins_at_the_effort_of_the_first_recording": 0,
    },
    "test_error_band.py": {
        "test_an_unseen_log_is_covered_overall_and_at_every_speed": 2,
    },
    "test_estimation.py": {
        "test_a_joint_is_fitted_anew_at_most_twenty_times_however_many_its_logs_are": 0,
        "test_correlated_residuals_widen_the_stated_errors_to_those_there_are": 0,
        "test_every_log_is_left_out_once_by_refits_to_all_the_others": 0,
        "test_many_logs_are_left_out_in_twenty_folds_of_neighbours": 0,
        "test_the_path_of_a_fitted_log_is_new_only_where_no_other_fitted_log_follows_it": 0,
    },
    "test_export.py": {
        "test_a_rejected_study_leaves_only_if_asked_twice_and_its_files_say_so": 0,
        "test_an_export_is_a_folder_beside_whoever_asks_for_it": 0,
    },
    "test_export_c.py": {},
    "test_faults.py": {
        "test_a_disk_that_takes_no_more_is_said_and_leaves_no_partial_file": 0,
        "test_a_report_that_failed_once_is_the_same_as_that_of_a_clean_run": 0,
        "test_a_report_that_is_stopped_leaves_no_half_page": 0,
        "test_a_run_that_is_stopped_says_so_in_one_line_and_goes_on_next_time": 0,
        "test_a_run_that_is_stopped_while_a_child_reads_a_log_leaves_no_child": 0,
        "test_a_stage_that_failed_once_leaves_nothing_behind": 0,
        "test_where_nothing_can_be_written_what_needs_no_writing_is_done": 0,
    },
    "test_files.py": {
        "test_a_log_that_is_a_pipe_costs_its_own_tasks_and_no_other": 0,
        "test_a_pipe_in_place_of_what_a_run_made_is_replaced_by_the_next": 0,
        "test_verify_names_what_a_run_made_and_is_no_file_any_more": 0,
    },
    "test_force_sensor.py": {
        "test_a_sensor_of_the_opposite_sign_is_named_axis_by_axis": 0,
        "test_a_simulated_sensor_gives_the_error_the_lag_and_the_coverage_that_were_simulated": 0,
    },
    "test_impossible_logs.py": {
        "test_no_log_however_impossible_ends_in_a_bug": 3,
    },
    "test_new.py": {
        "test_a_joint_of_another_arm_is_identified_from_what_new_writes_corrected_or_not": 0,
        "test_a_stranger_s_folder_becomes_a_study": 1,
        "test_the_robot_that_more_joints_may_be_of_is_named_where_their_number_and_ranges_allow": 1,
        "test_where_there_is_no_time_the_velocities_tell_the_rate": 1,
        "test_without_their_names_motion_and_effort_tell_the_roles_of_the_demonstration": 0,
    },
    "test_nothing_lost.py": {
        "test_a_first_report_that_fails_speaks_of_no_earlier_one": 0,
        "test_a_report_that_fails_leaves_the_last_one_and_says_that_it_is_older": 0,
        "test_an_entry_of_another_shape_is_none": 2,
        "test_what_an_earlier_version_made_goes_and_the_rest_is_as_if_it_had_never_been": 0,
    },
    "test_period.py": {
        "test_a_step_of_the_clock_costs_the_shorter_side_at_most": 3,
        "test_intervals_of_the_period_cover_whatever_the_colour_of_the_noise": 0,
        "test_memory_and_work_of_a_search_grow_as_the_log_does": 0,
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
        "test_no_import_of_a_module_is_overlooked": 0,
        "test_verify_compares_a_file_with_what_every_task_knew_of_it": 0,
        "test_verify_names_a_deviation_or_a_unit_that_was_altered": 1,
        "test_what_one_joint_of_a_log_suffers_costs_no_other_joint_or_log": 0,
        "test_without_flock_exactly_one_of_many_runs_takes_a_lock_that_was_left": 1,
    },
    "test_runs.py": {
        "test_a_group_of_a_fresh_study_runs_its_stages_and_what_they_need": 0,
        "test_a_log_that_leaves_the_study_takes_its_records_with_it": 0,
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
        "test_a_robot_of_thousands_of_joints_is_refused": 0,
        "test_a_study_of_as_many_logs_as_may_be_is_read": 0,
        "test_a_study_that_would_cost_minutes_is_refused_in_words": 0,
        "test_a_urdf_that_would_cost_minutes_is_refused_in_words": 2,
    },
    "test_standstill.py": {
        "test_a_period_is_predicted_by_who_has_not_seen_it": 0,
    },
    "test_tampering.py": {
        "test_a_flipped_byte_in_any_record_is_a_message": 5,
        "test_a_printed_page_tells_a_report_that_was_forged_with_all_its_files": 0,
        "test_a_stage_that_fails_only_when_it_is_recomputed_is_named": 0,
        "test_an_honest_study_comes_from_raw_byte_for_byte_and_is_not_touched": 0,
        "test_on_another_processor_numbers_are_compared": 0,
        "test_verify_names_what_was_done": 1,
        "test_what_was_forged_with_all_its_hashes_does_not_come_from_raw": 0,
    },
    "test_toml.py": {
        "test_every_key_has_the_line_that_it_is_written_on": 0,
    },
    "test_total_least_squares.py": {
        "test_classical_errors_are_as_large_as_those_that_noise_of_the_motion_makes_and_stated_ones_no_smaller": 0,
    },
    "test_verified_runs.py": {
        "test_verify_names_a_file_in_which_one_byte_was_altered": 1,
    },
    "test_weighing.py": {
        "test_free_motion_at_another_speed_is_part_of_the_error_of_each_joint": 0,
        "test_intervals_of_torque_constants_hold_the_true_ones_at_the_stated_rate": 0,
        "test_joints_that_tell_different_masses_are_named_and_widen_the_interval": 0,
        "test_the_proposed_constant_does_not_depend_on_the_one_in_use_and_is_not_applied": 1,
    },
    "test_wheel.py": {},
    "test_whiteness.py": {
        "test_white_noise_fails_each_test_as_often_as_stated": 0,
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
