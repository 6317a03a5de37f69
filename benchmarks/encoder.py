"""Measure taxel-samples per second of the encoders on one core, relative to a plain copy.

``python benchmarks/encoder.py --json benchmarks/results/encoder.json``

In every round all candidates run once, one after the other, so that a change of the machine's speed meets all
of them; ratios are taken within a round. Times are CPU time of the process. Arrays are allocated and touched
before. The NumPy loop has the rule of the LCS encoder, and the same events are demanded of it (exit code 1
otherwise). The delta modulation of
snnTorch compares neighbouring samples, so slow changes never fire; it is there for its speed, on at most
1,024 signals (it fills new arrays), and is left out where snnTorch is not installed.
"""

import os
import statistics
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
import typer
from measure import JsonFile, spread, timed, versions, write
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

from eskin.model.config import ReadoutConfig
from eskin.model.encoders.encoder import Encoder
from eskin.model.encoders.registry import ENCODERS
from eskin.model.taxel import count_events, encode

RMS = 0.17
BAND_HZ = (5.0, 80.0)
"""Texture signals of the ``physical`` preset: rms in full scales, and the band that holds their power."""

Codes = NDArray[np.int16]


@dataclass
class Candidate:
    """A function to time."""

    name: str
    call: Callable[[], Any]
    taxel_samples: int  # samples of one call
    events: Callable[[], int] | None = None  # returns the number of events of the last call
    seconds: list[float] = field(default_factory=list)  # one for every round


def texture_like(samples: int, signals: int, config: ReadoutConfig, seed: int) -> Codes:
    """Return band-limited noise with the statistics of texture signals, codes of shape (samples, signals)."""
    generator = np.random.default_rng(seed)
    sos = butter(4, BAND_HZ, "bandpass", fs=config.sample_rate_hz, output="sos")
    settle = int(config.sample_rate_hz / BAND_HZ[0])
    codes = np.empty((samples, signals), np.int16)
    high = config.full_scale - 1
    for start in range(0, signals, 512):
        width = min(512, signals - start)
        noise = generator.standard_normal((settle + samples, width), np.float32)
        smooth = sosfilt(sos, noise, axis=0)[settle:]
        smooth *= RMS * config.full_scale / smooth.std()
        codes[:, start : start + width] = np.clip(np.rint(smooth), -high - 1, high)
    return codes


def numpy_lcs(config: ReadoutConfig, samples: Codes, counts: Codes) -> None:
    """Write the LCS events of every sample into counts, with NumPy over taxels and a Python loop over time."""
    shift, cap = config.step.bit_length() - 1, config.decisions_per_tick
    u = np.full(samples.shape[1], config.reference_reset // config.step, np.int16)
    difference = np.empty_like(u)
    for sample, count in zip(samples, counts, strict=True):
        np.right_shift(sample, shift, out=difference)
        np.subtract(difference, u, out=difference)
        np.add(difference, difference < 0, out=count)
        np.clip(count, -cap, cap, out=count)
        u += count


def snntorch_delta(config: ReadoutConfig, samples: Codes) -> Candidate | None:
    """Return snnTorch's delta modulation as a candidate, or None if snnTorch is not installed."""
    try:
        import torch  # type: ignore[import-not-found]  # optional, and not part of the project
        from snntorch import spikegen
    except ImportError:
        return None
    torch.set_num_threads(1)
    data = torch.from_numpy(samples[:, :1024].astype(np.float32))
    kept: list[Any] = [None]

    def call() -> None:
        kept[0] = None  # two results need not fit the memory
        kept[0] = spikegen.delta(data, threshold=float(config.step), off_spike=True)

    return Candidate("snntorch delta", call, data.numel(), lambda: int(kept[0].abs().sum(dtype=torch.float64)))


def candidates(config: ReadoutConfig, samples: Codes) -> list[Candidate]:
    """Return all functions to time, the copy first."""
    out, loop = np.zeros_like(samples), np.zeros_like(samples)
    columns = min(64, samples.shape[1])
    array = config.replace(rows=min(64, samples.shape[1] // columns), columns=columns)
    part = np.ascontiguousarray(samples[:, : array.taxels])
    part_out = np.zeros_like(part)

    def magnitude(counts: Codes) -> Callable[[], int]:
        return lambda: sum(int(np.abs(line).sum(dtype=np.int64)) for line in counts)

    def of(encoder: Encoder) -> Candidate:
        """Return the candidate for an encoder; an encoder with staggered leaks takes the signals of a whole array."""
        base, codes, counts = (array, part, part_out) if encoder.leaks else (config, samples, out)
        own = base.replace(encoding=encoder.name)
        return Candidate(encoder.name, lambda: encode(own, codes, out=counts), codes.size, magnitude(counts))

    first, *others = map(of, ENCODERS)
    totals: list[NDArray[np.int64]] = []
    found = [
        Candidate("copy", lambda: np.copyto(out, samples), samples.size),
        first,
        Candidate(
            "lcs, counts per taxel only",
            lambda: totals.append(count_events(config, samples)),
            samples.size,
            lambda: int(totals[-1].sum()),
        ),
        *others,
        Candidate("lcs, numpy over time", lambda: numpy_lcs(config, samples, loop), samples.size, magnitude(loop)),
        snntorch_delta(config, samples),
    ]
    return [candidate for candidate in found if candidate is not None]


def summary(candidate: Candidate, copy: Candidate, events: int | None) -> dict[str, Any]:
    """Return the time of a candidate per taxel-sample, relative to the copy in the same round."""
    per_sample = copy.taxel_samples / candidate.taxel_samples
    ratios = [a / b * per_sample for a, b in zip(candidate.seconds, copy.seconds, strict=True)]
    median = statistics.median(candidate.seconds)
    return {
        "name": candidate.name,
        "taxel_samples": candidate.taxel_samples,
        "events": events,
        "seconds": {"median": median, "all": candidate.seconds},
        "taxel_samples_per_second": candidate.taxel_samples / median,
        "times_the_copy": spread(ratios),
    }


def main(
    json_file: JsonFile = None,
    signals: Annotated[int, typer.Option(min=1, help="taxels side by side (240 images of 64)")] = 15_360,
    samples: Annotated[int, typer.Option(min=1, help="samples of each (0.4 s at 20 kS/s)")] = 8_008,
    rounds: Annotated[int, typer.Option(min=1, help="how often everything is timed")] = 7,
    seed: Annotated[int, typer.Option(help="of the signals")] = 0,
) -> None:
    """Compare the speed of the encoders on one core with a plain copy of the samples."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    config = ReadoutConfig(encoding="lcs")
    codes = texture_like(samples, signals, config, seed)
    tried = candidates(config, codes)
    if tried[-1].name != "snntorch delta":
        print("snnTorch is not installed: spikegen.delta is left out.")
    events: dict[str, int | None] = {}
    for candidate in tried:  # compiles, and touches all memory
        candidate.call()
        events[candidate.name] = candidate.events() if candidate.events else None
    for _ in range(rounds):
        for candidate in tried:
            candidate.seconds.append(timed(candidate.call)[1])
    results = [summary(candidate, tried[0], events[candidate.name]) for candidate in tried]

    print(f"{signals} signals x {samples} samples, {config.sample_bits} bits, N = {config.resolution}, one core")
    print(f"{'':28}{'M samples/s':>12}{'times the copy (least..most)':>32}{'events':>14}")
    for result in results:
        ratio = "{median:.2f} ({least:.2f}..{most:.2f})".format(**result["times_the_copy"])
        speed = result["taxel_samples_per_second"] / 1e6
        print(f"{result['name']:28}{speed:12.0f}{ratio:>32}{result['events'] or '':>14}")
    options = {"signals": signals, "samples": samples, "rounds": rounds}
    libraries = versions("numpy", "numba", "scipy", "torch", "snntorch")
    content = options | {"seed": seed, "config": config.to_dict(), "versions": libraries, "results": results}
    write(json_file, "encoder", " ".join(f"--{name} {value}" for name, value in options.items()), content)
    same = {events[name] for name in ("lcs", "lcs, counts per taxel only", "lcs, numpy over time")}
    if len(same) != 1:
        print(f"The LCS encoders disagree on the number of events: {sorted(map(str, same))}.", file=sys.stderr)
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
