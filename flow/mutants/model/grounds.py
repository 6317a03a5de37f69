"""Which files of ``model/`` and ``snn/`` are mutated, and the tests that each is asked about."""

from __future__ import annotations


def _of(file: str, *names: str) -> tuple[str, ...]:
    """Return some tests of a file: the others take long, or look at something else."""
    return tuple(f"{file}::test_{name}" for name in names)


AGREEMENT = "tests/second/test_agreement.py"
READOUT = (AGREEMENT, "tests/model/test_readout.py", "tests/model/test_ends.py")
TAXEL = ("tests/model/test_taxel.py", *READOUT, "tests/model/test_taxel_leak.py")
NETWORK = ("tests/snn/test_network.py",)

REGISTERS = "tests/model/test_registers.py"
SPI = "cocotb_tests/test_spi.py::test_slave_equals_its_model_in_every_clock"
PATTERN = "cocotb_tests/test_pattern.py::test_pattern_equals_its_model_in_every_clock"
HOST = "cocotb_tests/test_host.py::test_readout_equals_the_model_while_a_host_sets_it"
FILE = "cocotb_tests/test_registers.py::test_file_equals_its_model_in_every_clock"

TABLES = _of(
    "tests/commands/test_power.py",
    "rates_that_were_not_measured_are_refused",
    "rates_between_time_constants_lie_between_and_scale_with_taxels",
    "a_damaged_table_is_refused",
    "a_table_is_read_back",
    "measured_rates_are_those_of_the_rates_command",
    "stored_rates_are_the_published_ones",
    "stored_rates_of_the_embedded_textures_are_measured_again",
    "event_rates_writes_a_file_that_power_reads",
)
DIFFERENCES = _of(
    "tests/model/test_compare.py",
    "finds_the_field_that_differs",
    "only_the_first_of_several_is_named",
    "a_recording_that_ends_early_differs_at_its_end",
    "description_shows_three_events_around",
    "counts_per_taxel",
    "unmatched_is_the_difference_of_the_multisets",
    "unmatched_marks_the_last_of_equal_events",
    "equal_files",
    "different_files",
    "order_alone_makes_a_difference",
)
SCANS = _of(
    "tests/snn/test_data.py",
    "an_event_belongs_to_the_bin_in_which_it_leaves",
    "without_polarity_on_and_off_share_a_channel",
    "nlcs_has_one_channel_a_taxel",
    "the_time_window_cuts_and_a_partial_last_bin_is_left_out",
    "a_recording_of_more_counts_than_are_taken_is_refused",
    "the_paper_preset_starts_where_its_events_count",
    "differences_and_crossings_by_hand",
    "a_scan_that_has_not_begun_has_no_differences",
    "scans_at_other_speeds_keep_their_events",
    "frames_that_enter_repeat_the_edge",
    "the_speed_of_every_scan_is_drawn_anew",
    "augmentation_shifts_and_silences_whole_scans",
    "bad_bins_are_refused",
    "bad_recordings_are_refused_in_one_sentence",
    "the_name_of_frames_says_rate_bits_and_what_the_receiver_makes_of_them",
    "frames_come_from_the_same_scans",
    "tensors_of_rtl_event_files_and_of_the_model_are_equal",
    "start_rows_are_scans_of_one_image_and_only_the_first_is_tested",
)
SET = _of(
    "tests/model/test_recordings.py",
    "a_baseline_is_taken_off_every_taxel",
    "a_percentile_clips_what_lies_above_it_and_says_so",
    "a_baseline_that_is_left_and_dead_columns_are_named",
    "nlcs_warns_of_what_lies_below_zero",
    "time_constants_mean_the_same_on_every_sensor",
    "the_array_follows_the_number_of_taxels",
    "warnings_say_what_is_there_and_no_more",
    "recordings_of_other_arrays_or_rates_are_refused",
    "what_leaves_in_the_first_tick_counts",
    "the_snr_is_that_of_a_plain_reconstruction",
    "more_bits_give_a_better_signal_because_the_clock_follows_the_slope",
    "the_clock_is_as_slow_as_can_be",
    "jittering_time_stamps_are_resampled",
    "options_that_mean_nothing_are_refused",
    "cw_lcs_renders_a_slow_skin_as_well_as_lcs",
    "one_scale_and_one_configuration_hold_for_the_whole_set",
)
PRESETS = "tests/model/test_presets.py"
OF_SCANS = _of(
    "tests/model/test_rates.py",
    "rate_is_events_over_the_whole_scan_without_those_skipped",
    "published_rates_are_those_of_the_table",
    "clipped_samples_are_counted",
    "nothing_to_measure_is_refused",
    "rates_grow_with_the_array",
    "workers_do_not_change_the_result_and_every_image_is_reported",
)
SKINS = "tests/model/test_recordings.py"
BOARD = "tests/model/test_board.py"
TILES = ("tests/model/test_tiles.py", AGREEMENT)
WHOLE = ("tests/model/test_classifier.py", AGREEMENT)
INTERVALS = _of(
    "tests/snn/test_train.py",
    "the_published_interval_comes_out",
    "the_interval_holds_the_spread_of_images_and_seeds",
    "the_summary_of_two_cells_by_hand",
)
WEIGHTS = (
    "tests/snn/test_weights.py",
    *_of("tests/snn/test_hostile.py", "class_names_are_different_texts_one_for_each_class"),
)
NIR = ("tests/snn/test_nir_network.py",)
DISTURBED = (
    *_of("tests/snn/test_robustness.py", "each_does_what_it_says", "directions_move_the_array_as_it_is"),
    "tests/snn/test_robustness.py",
)

TESTS: dict[str, tuple[str, ...]] = {
    "model/taxel_kernels.py": TAXEL,
    "model/taxel.py": TAXEL,
    "model/window.py": (REGISTERS, *TAXEL),
    "model/decay.py": TAXEL,
    "model/arbiter.py": ("tests/model/test_arbiter.py", *READOUT),
    "model/link.py": ("tests/model/test_link.py", *READOUT),
    "model/tiles/config.py": TILES,
    "model/tiles/merge.py": TILES,
    "model/tiles/relay.py": TILES,
    "model/tiles/run.py": TILES,
    "model/registers/settings.py": (REGISTERS, f"{HOST}[2x2-nlcs-analog]", f"{HOST}[3x5-cw-lcs-digital]", *READOUT),
    "model/config.py": ("tests/model/test_config.py",),
    "model/frame_config.py": ("tests/model/test_frame.py", AGREEMENT),
    "model/frame.py": ("tests/model/test_frame.py", AGREEMENT),
    "model/frame_words.py": ("tests/model/test_frame.py", AGREEMENT),
    "model/events/address.py": ("tests/model/test_recording.py", "tests/model/test_compare.py"),
    "model/events/compare.py": DIFFERENCES,
    "model/events/recording.py": ("tests/model/test_recording.py",),
    "model/classifier/config.py": WHOLE,
    "model/classifier/file.py": ("tests/model/test_classifier.py", "tests/snn/test_integer.py"),
    "model/classifier/network.py": WHOLE,
    "model/classifier/run.py": WHOLE,
    "model/textures/scan.py": (PRESETS,),
    "model/textures/physical.py": (PRESETS,),
    "model/textures/paper.py": (PRESETS,),
    "model/textures/dataset.py": ("tests/model/test_dataset.py",),
    "model/textures/rates.py": OF_SCANS,
    "model/recordings/prepare.py": SET,
    "model/recordings/quality.py": (*SET, "tests/commands/test_decode.py"),
    "model/recordings/suit.py": (SKINS,),
    "model/recordings/table.py": (SKINS,),
    "model/board/frames.py": (BOARD,),
    "model/power/equations.py": ("tests/model/test_power.py",),
    "model/power/build.py": ("tests/model/test_power.py", "tests/commands/test_power.py"),
    "model/power/rates.py": TABLES,
    "model/registers/driver.py": (REGISTERS,),
    "model/registers/spi.py": (REGISTERS, f"{SPI}[icarus-sync]"),
    "model/registers/file.py": (REGISTERS, f"{FILE}[3x5-nlcs-async]"),
    "model/registers/pattern.py": (REGISTERS, f"{PATTERN}[3x5-lcs]"),
    "snn/network.py": NETWORK,
    "snn/network_config.py": NETWORK,
    "snn/kernels/rule.py": NETWORK,
    "snn/kernels/reference.py": NETWORK,
    "snn/kernels/dense.py": NETWORK,
    "snn/kernels/sparse.py": NETWORK,
    "snn/kernels/layer.py": NETWORK,
    "snn/exchange/integer.py": ("tests/snn/test_integer.py", "tests/snn/test_precision.py"),
    "snn/exchange/nir_network.py": NIR,
    "snn/exchange/nir_layers.py": NIR,
    "snn/exchange/weights.py": (*WEIGHTS, *NIR),
    "snn/exchange/transforms.py": ("tests/snn/test_transforms.py",),
    "snn/rounding.py": ("tests/snn/test_integer.py", "tests/snn/test_precision.py"),
    "snn/adam.py": ("tests/snn/test_adam.py",),
    "snn/calibration.py": ("tests/snn/test_calibration.py",),
    "snn/data/bins.py": SCANS,
    "snn/data/augment.py": SCANS,
    "snn/data/frame_steps.py": SCANS,
    "snn/data/coding.py": ("tests/snn/test_coding.py",),
    "snn/data/disturb.py": DISTURBED,
    "snn/experiments/intervals.py": INTERVALS,
    "model/readout.py": (*READOUT, "tests/model/test_recording.py", f"{HOST}[2x2-nlcs-analog]"),
}
"""Files that are mutated, and the tests of each: those that call it, and not what reaches it by chance.

They are what the results rest on: encoders, arbiter, link, frames, tiles, classifier, registers, power, textures,
events, and what the network is made of, trained on and exported as. Left out are what parses and prints (commands,
options), draws (figures, pages) or carries (workers, caches, the link to a board), and sweeps on top of these.
"""
