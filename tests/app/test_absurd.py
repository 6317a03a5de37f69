"""Test ignored options, out-of-range numbers and wrong files: each gives an error message or a correct result."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

from eskin.app.options import build_config
from eskin.model.address_events import no_events
from eskin.model.config import ReadoutConfig
from eskin.model.events.recording import Recording

HUGE = "1" + "0" * 400


REFUSED = {
    "sim --ticks 0": "--ticks must be in 1..1e+12, not 0\n",
    "verilog -o v --leak-period 5": "--leak-period has no effect with --encoding lcs; ",
    "train --start -1e19": "--start must be in -9.22337e+18..9.22337e+18, not -1e+19\n",
    "sim --textures 1000000001": "--textures must be in 0..1e+09, not 1000000001\n",
    "replay --workers 0": "--workers must be in 1..4096, not 0\n",
    "rates --limit 0": "--limit must be in 1..1e+09, not 0\n",
    "frames --frame-rate 0": "--frame-rate must be in 1e-09..1e+12, not 0.0\n",
    "explore --min-resolution 11": "min-resolution must be in 1..10, not 11\n",
    "explore --event-rate -1": "event rate must be a number of events/s from 0, not -1\n",
    "power --noise 1e-300": "noise must be in 1e-15..1e+15 volts, not 1e-300\n",
    "power --rates r.json": "--rates has no effect on the published rates; add --mode consistent or ",
    "power --dataset embedded": "--dataset has no effect on the published rates; add --mode consistent or ",
    "power --preset physical --mode paper": "--preset has no effect on the published rates; add --mode ",
    "power --rates r.json --correct pads": "--rates has no effect on the published rates; add --mode ",
    "power --set io_voltage_v=1e300": "io_voltage_v must be in 1e-30..1e+15, not 1e+300",
    f"explore --rate-resolution {HUGE}": "--rate-resolution must be in 1..10, not 1000",
    f"explore --noise {HUGE}": "noise must be a positive number of volts, not inf",
    "verilog -o v --tiles 2x2 --merge --relays 1": "--relays has no effect with --merge; leave one of the two out",
    "verilog -o v --tiles 1x2 --report r.json": "--report has no effect with --tiles; leave one of the two out",
    "verilog -o v --tiles 1x2 --clock-gates": "--clock-gates has no effect with --tiles; leave one of the two out",
    "verilog -o v --tiles 4x4 --chip": "--chip has no effect with --tiles; leave one of the two out",
    "verilog -o v --readout frame --encoding lcs": "--encoding has no effect with --readout frame; leave it out",
    "asic --lib x.csv --readout frame --link four_phase": "--link has no effect with --readout frame; leave it out",
    "rates --start-row 1": "--start-row has no effect with --preset paper; leave it out",
    "train --taxels corners --events x": "--taxels has no effect with --events",
    "quantise . --bits 99": "--bits must be at most 8, not '99'",
    "demo --port x": "--port takes a whole number, not 'x'",
    "listen --port x --seconds q": "--seconds takes a number, not 'q'",
    "listen --port x --patience nan": "--patience must be at least 0.1, not 'nan'",
    "train --taxels 1+2+1": "--taxels 1+2+1 has taxel 1 twice; name every taxel once",
    "train --taxels lines": "choose taxels of 8 x 8 by across:K|",
    "train --taxels corners --disturbed 2": "chosen taxels need undisturbed scans of textures",
    "verilog -o v --tiles 9x9": "a merge takes at most 64 tiles, not 9 x 9",
    "verilog -o v --tiles 2x2 --relays 17": "relays must be in 0..16, not 17",
    "verilog -o v --tiles 2x1 --rows 64 --columns 64": "2 tiles of 64 x 64 taxels have 106497 input bits, but a "
    "module has at most 65000; write the merge with --merge, and a tile without --tiles\n",
    "rates --tau 0.2 --dataset embedded": "--tau is the leak of encoding nlcs or nlcs-bipolar, not of lcs; add ",
    "power --set supply_v": "--set takes NAME=NUMBER, such as io_voltage_v=3.3, not 'supply_v'",
    "power --synthesis bad.json": "--synthesis needs the correction digital; add --mode consistent or --correct "
    "digital",
    "power --mode consistent --dataset embedded --rates rates.json": "--dataset measures event rates, --rates reads "
    "them from a file; give one of them",
    "power --mode consistent --rates none.json": "cannot read the event rates none.json: No such file or directory; "
    "write one with python -m studies.event_rates",
    "explore --nlcs-event-rate 5": "--nlcs-event-rate needs --event-rate, the rate of LCS; give both",
    "explore --event-rate 5 --dataset embedded": "--event-rate replaces --dataset and --rates; give one of them",
    "dev formal --block link --small -o bad.json": "the results of proofs bad.json is damaged: properties is no ",
    "dev soak --only 1": "a run is a line of JSON, as a difference is printed: ",
    'dev soak --only {"config":{"rows":1e9}}': "rows must be of type int, not 1000000000.0",
    'dev soak --only {"config":{"sample_bits":1}}': "sample_bits must be in 3..24, not 1",
    'dev soak --only {"config":{},"share":"x"}': "share must be in 0..1, not 'x'",
}


@pytest.mark.parametrize("line", REFUSED)
def test_refused_in_one_sentence(line: str, refuses: Any, folder: Path) -> None:
    (folder / "bad.json").write_text('{"properties": 3}')
    refuses(f"error: {REFUSED[line]}", line)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{", "the configuration c.json is not JSON: "),
        ("[]", "the configuration c.json must be a JSON object, not list"),
        ('{"rows": 0}', "the configuration c.json: rows must be in 1..64, not 0"),
        ('{"row": 3}', "the configuration c.json: unknown configuration field 'row'; known fields are "),
        (f'{{"rows": {HUGE}}}', "the configuration c.json is not JSON: it contains a number of 401 digits"),
        (f'{{"sample_rate_hz": {HUGE[:300]}}}', "the configuration c.json: sample_rate_hz must be of type float"),
    ],
)
def test_a_wrong_configuration_is_named(text: str, sentence: str, refuses: Any, folder: Path) -> None:
    (folder / "c.json").write_text(text)
    refuses(f"error: {sentence}", "rates --config c.json")


def test_the_file_beside_the_verilog_is_a_configuration(folder: Path) -> None:
    from eskin.rtl.delivery import write

    wanted = ReadoutConfig(rows=2, columns=3, encoding="nlcs", resolution=4)
    write(wanted, folder)
    config, given = build_config({"resolution": 5}, None, folder / "eskin_readout.json")
    assert config == wanted.replace(resolution=5)
    assert given == set(wanted.to_dict())


def test_a_configuration_may_come_through_a_pipe(folder: Path) -> None:
    """Read a configuration from a pipe, as with the shell's ``--config <(...)``."""
    reading, writing = os.pipe()
    with os.fdopen(writing, "w") as pipe:
        pipe.write('{"rows": 3}')
    config, given = build_config({}, None, Path(f"/dev/fd/{reading}"))
    os.close(reading)
    assert (config, given) == (ReadoutConfig(rows=3), {"rows"})


def test_explore_says_whose_event_rates_it_takes(call: Any) -> None:
    sentence = "event rates: those of textures in the physical scan, which come with the project; --event-rate gives"
    code, out, err = call("explore")
    assert (code, err) == (0, "")
    assert out.startswith(sentence)
    code, out, err = call("explore --json")
    assert (code, err.startswith(sentence)) == (0, True)
    assert json.loads(out)["cheapest"]
    code, out, err = call("explore --event-rate 1000")
    assert (code, err, "event rates: those of textures" in out) == (0, "", False)


def test_the_folder_of_all_defaults_is_made(call: Any, folder: Path) -> None:
    (folder / "x.csv").write_text("0.1,0.2\n0.2,0.1\n")
    code, _, err = call("encode x.csv -o out/e.npz --rows 1 --columns 2 --sample-rate 1000")
    assert code == 0, err
    assert (folder / "out" / "e.npz").is_file()


@pytest.mark.parametrize(("rate", "clocks", "duration"), [(1e12, 2**24, 2**62), (1e-9, 1, 2**62), (1e-9, 1, 1)])
def test_compare_draws_any_clock_and_duration_that_a_recording_may_have(
    rate: float, clocks: int, duration: int, call: Any, folder: Path
) -> None:
    config = ReadoutConfig(rows=1, columns=2, sample_rate_hz=rate, clocks_per_sample=clocks)
    Recording(no_events(), config, duration).save(folder / "e.npz")
    code, _, err = call("compare e.npz e.npz --plot p.png")
    assert (code, err.count("\n") <= 1) == (code, True)
    assert code in (0, 2)
    assert (folder / "p.png").exists() == (code == 0)


def test_files_that_unpack_to_more_than_anybody_means_are_refused(
    refuses: Any, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import numpy as np

    np.savez_compressed("x.npz", samples=np.zeros((2**21, 1), np.int8))
    np.save("x.npy", np.zeros((2**21, 1), np.int8))
    (folder / "x.csv").write_text("1,2\n" * 2**20)
    monkeypatch.setattr("eskin.skin.readers.frame.MAX_VALUES", 2**20)
    monkeypatch.setattr("eskin.base.files.MAX_UNPACKED", 2**20)
    for name, sentence in (
        ("npz", "x.npz claims 2 MiB of data, more than 1, and is refused"),
        ("npy", "x.npy holds 2097152 values, more than 1048576; cut it into shorter recordings"),
        ("csv", "x.csv holds 2097152 values, more than 1048576; cut it into shorter recordings"),
    ):
        refuses(f"error: {sentence}\n", f"encode x.{name} -o e.npz --rows 1 --columns 1 --sample-rate 1000")
