"""Test ``eskin encode`` with samples, images, and invalid input."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.events.recording import Recording
from eskin.model.readout import Stimulus, simulate
from eskin.skin.encode import IMAGE_SUFFIXES
from eskin.skin.readers.registry import SUFFIXES

SIZE = "--rows 3 --columns 4"


def waves(ticks: int = 400, taxels: int = 12) -> np.ndarray[Any, Any]:
    """Return slow sines of different phase within +-0.9, shape (ticks, taxels)."""
    phase = np.random.default_rng(0).uniform(0, 2 * np.pi, taxels)
    return 0.9 * np.sin(2 * np.pi * np.arange(ticks)[:, None] / 200 + phase)


@pytest.mark.command("encode")
def test_encodes_floats_in_full_scale(call: Any, folder: Path) -> None:
    values = waves()
    values[7, 3] = 1.5
    np.save("x.npy", values)
    code, out, err = call(f"encode x.npy -o e.npz {SIZE} --sample-rate 10000 --resolution 4 --scale 1")
    assert code == 0
    assert err.startswith("warning: the link is too slow: ")  # the twelve sines start apart, all in one tick
    config = ReadoutConfig(rows=3, columns=4, sample_rate_hz=10_000, resolution=4)
    codes = np.clip(np.rint(values * 2048), -2048, 2047).astype(np.int32)
    recording = Recording.load(folder / "e.npz")
    assert recording.config == config
    assert recording.duration_clocks == 400 * 64
    assert np.array_equal(recording.events, simulate(config, Stimulus.from_samples(config, codes)))
    n = len(recording.events)
    counts = np.bincount(recording.events["y"] * 4 + recording.events["x"], minlength=12)
    least, most = int(counts.argmin()), int(counts.argmax())
    assert out.splitlines()[:4] == [
        f"e.npz: {n} events in 0.04 s, {n / 0.04:.6g} events/s",
        "lcs 4 b, 3 x 4 taxels, 400 samples at 10000 Hz, clock 640000 Hz",
        f"samples {codes.min() / 2048:+.4f}..+0.9995 of full scale, 1 of 4800 clipped, scale 1",
        f"events per taxel: {counts[least]} (row {least // 4}, column {least % 4}) to "
        f"{counts[most]} (row {most // 4}, column {most % 4})",
    ]
    assert n > 1000


def test_the_same_samples_in_any_form_give_the_same_events(call: Any, folder: Path) -> None:
    codes = np.rint(waves() * 2000).astype(int)
    np.save("codes.npy", codes)
    np.save("floats.npy", codes / 2048)
    np.save("cube.npy", codes.reshape(-1, 3, 4).astype(np.int16))
    np.savez("rated.npz", samples=codes, sample_rate_hz=1000, remark=1)
    np.savez("single.npz", codes)
    np.savetxt("codes.csv", codes, fmt="%d", delimiter=",")
    np.savetxt("headed.csv", codes / 2048, delimiter=",", header=",".join("abcdefghijkl"), comments="")
    (folder / "marked.csv").write_bytes(b"\xef\xbb\xbf" + (folder / "codes.csv").read_bytes())
    np.save("volts.npy", codes / 2048 * 3.3)
    rate = "--sample-rate 1000"
    for line in (
        f"codes.npy {SIZE} {rate}",
        f"floats.npy {SIZE} {rate}",
        f"cube.npy {rate}",
        f"cube.npy {SIZE} {rate}",
        f"rated.npz {SIZE}",
        f"single.npz {SIZE} {rate}",
        f"codes.csv {SIZE} {rate}",
        f"headed.csv {SIZE} {rate}",
        f"marked.csv {SIZE} {rate}",
        f"volts.npy {SIZE} {rate} --scale {1 / 3.3}",
    ):
        assert call(f"encode {line} -o e.npz --name n")[0] == 0, line
        recording = Recording.load(folder / "e.npz")
        config = ReadoutConfig(rows=3, columns=4, sample_rate_hz=1000)
        assert recording.config == config, line
        assert np.array_equal(recording.events, simulate(config, Stimulus.from_samples(config, codes))), line


@pytest.fixture
def encode(call: Any, folder: Path) -> Callable[..., str]:
    """Return a function that encodes a file or an array, and returns what the command prints."""

    def encode(source: Any, options: str, out: str = "e.npz") -> str:
        if not isinstance(source, str):
            np.save("x.npy", source)
        name = source if isinstance(source, str) else "x.npy"
        code, printed, err = call(f"encode {name} -o {out} {options}")
        assert code == 0, err
        return str(printed)

    return encode


@pytest.mark.parametrize(("text", "code"), [("1,2\n", 1), ("1e0,0\n", 2047), ("5E-1,0\n", 1024), (".5,0", 1024)])
def test_numbers_without_point_or_exponent_are_codes(text: str, code: int, encode: Any, folder: Path) -> None:
    (folder / "x.csv").write_text(text)
    out = encode("x.csv", "--rows 1 --columns 2 --sample-rate 1000")
    assert f"..{max(code, 2) / 2048:+.4f} of full scale" in out


def test_short_floats_are_not_rounded_twice(encode: Any, call: Any) -> None:
    halves = waves().astype(np.float16)
    for out, values in (("short.npz", halves), ("long.npz", halves.astype(np.float64))):
        encode(values, f"{SIZE} --sample-rate 1000 --sample-bits 24", out)
    assert call("compare short.npz long.npz")[0] == 0


def test_values_beyond_any_scale_saturate(encode: Any) -> None:
    out = encode(np.array([[1e308, -1e308]]), "--rows 1 --columns 2 --sample-rate 1000 --scale 1e9")
    assert "samples -1.0000..+0.9995 of full scale, 2 of 2 clipped" in out


def test_scale_max_uses_the_range_and_clips_nothing(encode: Any) -> None:
    for values in (waves() * 37, -waves() * 37, np.rint(waves() * 500).astype(int), np.zeros((9, 12))):
        out = encode(values, f"{SIZE} --sample-rate 1000 --scale max")
        assert "none clipped" in out
        assert "0.9995" in out or not values.any()


def test_a_single_taxel_equals_the_functional_model(encode: Any, call: Any) -> None:
    for encoding in registry.NAMES:
        options = f"--rows 1 --columns 1 --encoding {encoding} --sample-rate 1000 --model"
        for model in ("cycle", "functional"):
            encode(waves(taxels=1), f"{options} {model}", f"{model}.npz")
        assert call("compare cycle.npz functional.npz")[0] == 0


def test_metadata_say_where_events_come_from(encode: Any) -> None:
    encode(waves(), f"{SIZE} --sample-rate 1000 --label denim --model functional")
    metadata = {"name": "x", "source": "x.npy", "model": "functional", "input": "full scale", "scale": 1.0}
    assert Recording.load(Path("e.npz")).metadata == metadata | {"class": "denim"}
    encode(waves(), f"{SIZE} --sample-rate 1000 --name grass")
    assert Recording.load(Path("e.npz")).metadata["name"] == "grass"


def picture(high: int = 60, wide: int = 200) -> np.ndarray[Any, Any]:
    return np.random.default_rng(0).integers(0, 256, (high, wide)).astype(np.uint8)


def test_encodes_an_image(encode: Any) -> None:
    Image.fromarray(picture()).save("t.png")
    assert "2 x 3 taxels" in encode("t.png", "--rows 2 --columns 3 --start-row 4.5 --resolution 3")
    recording = Recording.load(Path("e.npz"))
    assert (recording.metadata["preset"], recording.metadata["start_row"]) == ("physical", 4.5)
    assert recording.config == ReadoutConfig(rows=2, columns=3, resolution=3)
    assert len(recording.events) > 100
    Image.fromarray(picture(300, 300)).save("t.png")
    encode("t.png", "--preset paper --resolution 2")
    assert Recording.load(Path("e.npz")).config.decide_every == "sample"


def test_an_image_is_the_same_in_any_kind_of_file(encode: Any, call: Any) -> None:
    image = picture()
    Image.fromarray(image).save("gray.png")
    Image.fromarray(image).save("gray.TIF")
    Image.fromarray(np.dstack([image] * 3)).save("colour.bmp")
    Image.fromarray(image.astype(np.uint16) * 257).save("deep.png")
    encode("gray.png", "", "a.npz")
    for name in ("gray.TIF", "colour.bmp", "deep.png"):
        encode(name, "", "b.npz")
        assert call("compare a.npz b.npz")[0] == 0


GOOD = np.zeros((5, 64))
with io.BytesIO() as file:
    np.save(file, GOOD)
    CUT_OFF = file.getvalue()[:-8]
RATE = "--sample-rate 1000"
SCALES = (
    "--scale needs a number other than 0, a number for each taxel such as 0.5,2, max, per-taxel, or a percentile such "
    "as p99.9"
)
IMAGES = ", ".join(IMAGE_SUFFIXES)


def plain(mode: str, colour: tuple[int, ...]) -> bytes:
    """Return a PNG file of one colour."""
    Image.new(mode, (64, 64), colour).save(file := io.BytesIO(), "PNG")
    return file.getvalue()


ENCODE_ERRORS: dict[str, tuple[str, Any, str]] = {
    "cannot read x.npy: No such file or directory": ("x.npy", None, RATE),
    "cannot read x.png: No such file or directory": ("x.png", None, ""),
    f"x.xyz is of unknown kind; give an image ({IMAGES}) or samples ({', '.join(SUFFIXES)})": ("x.xyz", b"", ""),
    "x.npy contains no sampling rate; add --sample-rate HZ": ("x.npy", GOOD, ""),
    "x.npy has the shape (5,); samples have (ticks, taxels) or (ticks, rows, columns); reshape a single taxel to "
    "(ticks, 1)": ("x.npy", np.zeros(5), RATE),
    "x.npy has the shape (); samples have (ticks, taxels) or (ticks, rows, columns)": ("x.npy", np.float64(5), RATE),
    "x.npy has the shape (0, 64): no samples; give at least one tick and one taxel": ("x.npy", np.zeros((0, 64)), RATE),
    "x.npy has nan in sample 3, column '3' (up to 10% of a column may be missing); replace it, or leave the column out "
    "with --taxel-columns": ("x.npy", np.where(np.arange(320).reshape(5, 64) == 130, np.nan, 0), RATE),
    "x.csv has -inf in sample 1, column '2'; replace it, or leave the column out with --taxel-columns":
        ("x.csv", b"0.1,-inf\n", RATE),
    "x.npy holds complex128 values; samples are integers (codes) or floats (full scale +-1.0)":
        ("x.npy", GOOD.astype(complex), RATE),
    "x.npy holds bool values; samples are integers (codes) or floats (full scale +-1.0)": ("x.npy", GOOD > 0, RATE),
    "x.npy is damaged or not a numerical .npy file; save it with numpy.save":
        ("x.npy", np.array([{}], dtype=object), RATE),
    "y.npy is damaged or not a numerical .npy file; save it with numpy.save": ("y.npy", CUT_OFF, RATE),
    "x.npz is damaged or not a numerical .npz file; save it with numpy.savez": ("x.npz", b"PK", RATE),
    "x.npz contains a (5, 64), b (5, 64); choose one with --field NAME, or name it 'samples'":
        ("x.npz", {"a": GOOD, "b": GOOD}, RATE),
    "x.npz contains nothing; name the array of samples 'samples', or choose one with --field NAME":
        ("x.npz", {}, RATE),
    "x.npz has a sample_rate_hz that is not one number; give it in hertz":
        ("x.npz", {"samples": GOOD, "sample_rate_hz": [1, 2]}, ""),
    "x.npz states the sampling rate -1; it must be a positive number":
        ("x.npz", {"samples": GOOD, "sample_rate_hz": -1.0}, ""),
    "x.csv is empty; fetch or record it again": ("x.csv", b"", RATE),
    "x.csv holds no samples; give at least one line of numbers": ("x.csv", b"# made by hand\n", RATE),
    "y.csv holds no samples below its header; give at least one line of numbers": ("y.csv", b"a,b\n", RATE),
    "x.csv: line 2 has 1 cells, but a sample has 2; repair this line, or set --delimiter and --decimal":
        ("x.csv", b"1,2\n3\n4,5\n5,6\n", RATE),
    "x.csv has 'x' in sample 2, column '2', which is no number; repair it, or leave the column out with "
    "--taxel-columns":
        ("x.csv", b"1,2\n3,x\n", RATE),
    "the samples have 12 columns, but the array has 8 x 8 = 64 taxels; use --rows 1 --columns 12":
        ("x.npy", np.zeros((50, 12)), RATE),
    "the samples have 192 columns, but the array has 4 x 8 = 32 taxels; use --rows 12 --columns 16, or another split "
    "of 192": ("x.npy", np.zeros((200, 192)), RATE + " --rows 4"),
    "the samples have 67 columns, but the array has 8 x 8 = 64 taxels; no array of at most 64 x 64 has 67 taxels, so "
    "leave some out": ("x.npy", np.zeros((70, 67)), RATE),
    "the samples have 3 x 4 taxels, but the array has 4 x 8; use --rows 3 --columns 4":
        ("x.npy", np.zeros((50, 3, 4)), RATE + " --rows 4"),
    "rows must be in 1..64, not 99": ("x.npy", np.zeros((500, 99, 2)), RATE),
    "x.npy has the code -2049 at tick 0, taxel 0, outside -2048..2047 of 12 bits; add --sample-bits, or --scale "
    "FACTOR if the file has physical values": ("x.npy", np.full((5, 64), -2049), RATE),
    "x.npy has 5 values beyond full scale, the largest 1.25 times full scale; subtract the baseline with --baseline "
    "first, or add --scale max": ("x.npy", np.where(np.eye(5, 64), -1.25, 1.0), RATE),
    "x.csv has the code 2048 at tick 1, taxel 0, outside -2048..2047 of 12 bits; add --sample-bits, or --scale "
    "FACTOR if the file has physical values": ("x.csv", b"time_s,a\n0,1\n1,2048\n2,3\n", ""),
    f"{SCALES}, not '0'": ("x.npy", GOOD, RATE + " --scale 0"),
    f"{SCALES}, not 'nan'": ("x.npy", GOOD, RATE + " --scale nan"),
    f"{SCALES}, not 'min'": ("x.npy", GOOD, RATE + " --scale min"),
    "--model must be one of cycle, functional, not 'ideal'": ("x.npy", GOOD, RATE + " --model ideal"),
    "--preset and --start-row are only for images, and this input has samples; "
    "leave them out": ("x.npy", GOOD, "--preset paper"),
    "--scale is only for samples; the preset sets the scale of an image": ("x.png", b"\x89PNG", "--scale 2"),
    "x.png is damaged or not an image that can be read; save it as .png with 8 or 16 bits": ("x.png", b"\x89PNG", ""),
    "x.png has the gray value 0 everywhere; give an image with a texture": ("x.png", plain("RGB", (0, 0, 0)), ""),
    "x.png has transparent pixels, which have no gray value; save it without transparency":
        ("x.png", plain("RGBA", (9, 9, 9, 99)), ""),
    "preset must be one of paper, physical, not 'best'": ("x.png", b"", "--preset best"),
    "rows must be in 1..64, not 0": ("x.npy", GOOD, RATE + " --rows 0"),
}  # fmt: skip


@pytest.mark.parametrize("sentence", ENCODE_ERRORS)
def test_encode_refuses(sentence: str, refuses: Any, folder: Path) -> None:
    name, content, options = ENCODE_ERRORS[sentence]
    if isinstance(content, bytes):
        (folder / name).write_bytes(content)
    elif isinstance(content, dict):
        np.savez(name, **content)
    elif content is not None:
        np.save(name, content)
    refuses(f"error: {sentence}\n", f"encode {name} -o e.npz", options)


def test_a_bad_output_is_refused_before_the_work(refuses: Any) -> None:
    refuses("error: event files end in .npz, e.csv does not; rename the output\n", "encode nothing.npy -o e.csv")
