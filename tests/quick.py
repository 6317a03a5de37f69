"""List of the tests of ``make check`` beside those of commands, and order of all tests.

Each entry is a test function, of which the first case is taken, or the beginning of one case's name. Choose what fails
when the block is broken and takes a second or two; ``tests/test_quick.py`` says what is missing.
"""

from collections.abc import Sequence

TAXEL = "cocotb_tests/test_taxel.py::test_taxel_equals_its_reference_in_every_clock"
CLASSIFIER = "cocotb_tests/test_classifier.py::test_rtl_equals_the_model_in_every_potential_class_and_clock"
WINDOW = "cocotb_tests/test_window.py::test_window_equals_its_reference_in_every_clock"

BLOCKS = {
    "arbiter": "cocotb_tests/test_arbiter.py::test_arbiter_keeps_its_contract[icarus-3x5",
    "block": "tests/rtl/test_block.py::test_equal_blocks_share_their_text",
    "decay": "cocotb_tests/test_decay.py::test_decay_ticks_are_those_of_the_rule[3-rows-5",
    "delivery": "cocotb_tests/test_verilog.py::test_port_list_is_that_of_the_module",
    "frame": "cocotb_tests/test_frame.py::test_rtl_equals_the_model_in_every_clock[icarus-1x4-6b",
    "logic": "tests/rtl/test_logic.py::test_networks_compute_what_they_say",
    "readout": "cocotb_tests/test_readout.py::test_rtl_equals_model_in_every_encoding[lcs-2x3",
    "stream": "tests/rtl/test_stream.py::test_streams_carry_the_events_of_the_model_to_a_consumer_that_stalls[lcs",
    "taxel": f"{TAXEL}[icarus-lcs-digital-12b-5b",
    "verilog": "cocotb_tests/test_verilog.py::test_lint_is_clean",
    "window": f"{WINDOW}[analog-m1-5",
    "yosys": "tests/rtl/test_yosys.py::test_the_stamp_goes_and_a_port_is_declared_once",
}
"""A test for each file of rtl/, by its name."""

OTHERS = {
    "study": "tests/studies/test_power.py::test_fig6_data_are_the_model",
    "study of sweeps": "tests/studies/test_figures.py::test_the_figure_shows_the_values_of_the_sweeps",
    "study of networks": "tests/studies/test_trained.py::test_power_is_that_of_the_model_at_these_rates",
    "frontier": "tests/studies/test_frontier.py::test_frames_and_events_of_one_rate_and_network_are_paired",
    "sweep": "tests/snn/test_sweep.py::test_only_missing_cells_are_run",
    "layers": "tests/test_layers.py",
    "link": "cocotb_tests/test_link.py::test_link_keeps_the_protocol_and_equals_its_reference[icarus-3x5",
    "classifier": f"{CLASSIFIER}[2-1-3",
    "classifier of membranes": f"{CLASSIFIER}[16-33-4-16l",
    "classifier of wide biases": f"{CLASSIFIER}[6-8-7-8l",
    "chip": "cocotb_tests/test_touch.py::test_every_event_potential_and_class[lcs-icarus",
    "decay of settings": "cocotb_tests/test_decay.py::test_decay_ticks_are_those_of_the_rule[3-rows-7",
    "frame of half words": "cocotb_tests/test_frame.py::test_rtl_equals_the_model_in_every_clock[icarus-2x3-5b",
    "frame of whole words": "cocotb_tests/test_frame.py::test_rtl_equals_the_model_in_every_clock[icarus-3x5-6b-6b",
    "taxel analog": f"{TAXEL}[icarus-cw-lcs-analog-12b-10b",
    "taxel nlcs analog": f"{TAXEL}[icarus-nlcs-analog-12b-10b",
    "taxel nlcs": f"{TAXEL}[icarus-nlcs-digital-12b-5b",
    "taxel cw-lcs": f"{TAXEL}[icarus-cw-lcs-digital-12b-5b",
    "window of no ticks": f"{WINDOW}[digital-m16-1",
    "period of a window": "tests/verify/test_proofs.py::test_a_small_block_keeps_every_property[window",
    "ends of counters": "tests/verify/test_proofs.py::test_a_small_block_keeps_every_property[registers",
    "spi": "cocotb_tests/test_spi.py::test_slave_equals_its_model_in_every_clock[icarus-sync",
    "registers": "cocotb_tests/test_registers.py::test_file_equals_its_model_in_every_clock[3x5-nlcs",
    "pattern": "cocotb_tests/test_pattern.py::test_pattern_equals_its_model_in_every_clock[3x5-lcs",
    "settings at the pins": "tests/verify/test_proofs.py::test_a_small_block_keeps_every_property[host",
    "host": "cocotb_tests/test_host.py::test_readout_equals_the_model_while_a_host_sets_it[3x5-nlcs-digital",
    "merge": "cocotb_tests/test_merge.py::test_merge_keeps_its_contract_and_equals_its_models[icarus-3",
    "relay": "cocotb_tests/test_relay.py::test_relay_keeps_its_contract_and_equals_its_model[icarus-5b",
    "tiles": "cocotb_tests/test_tiles.py::test_a_skin_equals_its_model[icarus-4-nlcs",
    "make": "tests/app/test_make.py::test_make_refuses_a_wrong_variable",
    "errors": "tests/app/test_app.py::test_every_mistake_is_one_sentence",
    "network": "tests/snn/test_network.py::test_a_neuron_by_hand",
    "limits of faults": "tests/verify/test_faults.py::test_an_upset_beyond_the_stated_bounds_is_a_problem",
    "operators of mutants": "tests/verify/test_mutants.py::test_every_operator_makes_its_examples",
    "kernel": "tests/snn/test_network.py::test_kernel_equals_plain_autograd",
    "quick": "tests/test_quick.py",
}
"""What else is quick and tells much: a file, or a function, by subject."""


def fits(node: str, entry: str) -> bool:
    """Return True if a list entry selects a test."""
    function, bracket, case = entry.partition("[")
    return node.startswith(function) and (not bracket or node.partition("[")[2].startswith(case))


def chosen(nodes: list[str]) -> set[str]:
    """Return the first test selected by each list entry."""
    firsts = {next((node for node in nodes if fits(node, entry)), "") for entry in BLOCKS.values()}
    return (firsts - {""}) | {node for node in nodes for entry in OTHERS.values() if fits(node, entry)}


LONG = (
    "tests/independent/test_agreement.py::test_skins_of_tiles",
    "tests/docs/test_site.py::test_the_site",
    "tests/independent/test_agreement.py::test_both_give_the_same_events",
    "tests/test_wheel.py::test_commands_work_elsewhere",
    "tests/docs/test_tutorial.py::test_the_page_shows",
    "tests/board/test_gateware.py::test_a_recording",
    "tests/board/test_gateware.py::test_the_classes",
    "tests/verify/test_coverage.py::test_a_dead_line",
    "tests/board/test_demo.py::test_the_page",
    "tests/snn/test_train.py::test_a_killed_command",
    "tests/snn/test_sweep.py::test_a_sweep_outlives",
    "tests/app/test_simulate.py::test_replay",
    "tests/verify/test_coverage.py::test_small_runs",
    "tests/board/test_gateware.py::test_a_foreign_chip",
    "cocotb_tests/test_readout.py::test_verilator_sees_the_same",
)
"""Those of five seconds and more; a function, or the beginning of a case's name.

The first of two workers begins with the tests that compile the model for every encoder, the second one with tests that
do not need it: else both would compile it.
"""


def long_first(nodes: Sequence[str], workers: int) -> list[int]:
    """Return the indices of the tests with these names in order of execution.

    ``--dist worksteal`` gives every worker a block of equal size to begin with; who is done first takes from the end
    of another's.
    """
    long = list(dict.fromkeys(place for entry in LONG for place, node in enumerate(nodes) if fits(node, entry)))
    short = sorted({*range(len(nodes))} - {*long})
    order: list[int] = []
    for worker in range(workers):
        block = long[worker::workers]
        room = max((len(nodes) - len(order)) // (workers - worker) - len(block), 0)
        order += block + short[:room]
        short = short[room:]
    return order
