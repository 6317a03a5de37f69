"""Functions of ``import eskin``: read, encode, decode, run the RTL, plot, train, predict and quantise.

Signals are integer codes of ``config.sample_bits`` bits, or floats in full scales (-1.0 to 1.0). Their shape is
(ticks, taxels) or (ticks, rows, columns); a readout of one taxel also takes (ticks,). Events are an array with the
fields ``t`` (clock), ``x`` (column), ``y`` (row) and ``p`` (True for ON). The time is ``t / config.clock_hz`` seconds.

Wrong values raise ``InputError`` with one sentence that names the value and the remedy.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eskin.base.errors import InputError
from eskin.model.address_events import Events, check_events
from eskin.model.config import ReadoutConfig

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from eskin.model.classifier.file import IntegerWeights
    from eskin.snn.data.scans import ScanData
    from eskin.snn.exchange.weights import Weights
    from eskin.snn.training import Epoch

# -- signals and events ------------------------------------------------------------------------------


class Signal(NamedTuple):
    """Signals of a recording, as ``read`` returns them."""

    values: NDArray[np.float64]
    """In the unit of the file, shape (ticks, taxels)."""
    rate_hz: float | None
    """Samples per second; None if the file has neither a rate nor time stamps."""
    names: tuple[str, ...]
    """Names of the taxels; their numbers from 1 if the file has none."""
    notes: tuple[str, ...]
    """How the file was interpreted, each with the option that changes it."""

    def __repr__(self) -> str:
        rate = "unknown rate" if self.rate_hz is None else f"{self.rate_hz:g} Hz"
        return f"Signal({len(self.values)} samples of {self.values.shape[1]} taxels, {rate})"


def read(path: str | Path, **options: Any) -> Signal:
    """Return the signals in a file of samples, with time stamps resampled to an even rate.

    Parameters
    ----------
    path : str or Path
        .csv, .npy, .npz, .mat, .h5, .parquet, .feather, .xlsx, .json, .wav, ROS bags, .mcap and others.
    **options
        Fields of ``eskin.skin.recordings.options.Preparation``, for example ``taxel_columns="2-17"``; and
        ``sample_rate_hz``.

    Raises
    ------
    InputError
        If the file cannot be read, or an option is unknown.
    """
    import dataclasses

    from eskin.skin.recordings.columns import read_one
    from eskin.skin.recordings.options import Preparation
    from eskin.skin.recordings.prepare import common_rate, on_grid

    rate_hz = options.pop("sample_rate_hz", None)
    known = [field.name for field in dataclasses.fields(Preparation)]
    if wrong := [name for name in options if name not in known]:
        raise InputError(f"unknown option {wrong[0]!r}; known options are sample_rate_hz, {', '.join(known)}")
    table, notes = read_one(Path(path), Preparation(**options), rate_hz)
    if rate_hz is None and (table.time_s is not None or table.rate_hz is not None):
        rate_hz = common_rate([table])
    values = table.values if rate_hz is None else on_grid(table, rate_hz)[0]
    return Signal(values, rate_hz, table.names, notes)


def encode(config: ReadoutConfig, signal: ArrayLike) -> Any:
    """Return the address events of a signal, computed by the golden model.

    Parameters
    ----------
    config : ReadoutConfig
    signal : integer or float array, shape (ticks, taxels) or (ticks, rows, columns)
        Codes, or full scales. One sample per tick, at ``config.sample_rate_hz``. A batch, of shape (signals, ticks,
        taxels) or (signals, ticks, rows, columns), gives a list.

    Returns
    -------
    Events, shape (events,), or list of Events
        Events in order of transfer, with the delays of arbiter and link.

    Raises
    ------
    InputError
        If the signal does not fit the array, exceeds full scale, or is not made of numbers.
    """
    from eskin.model.readout import Stimulus, simulate

    if _is_batch(config, signal):
        return [encode(config, one) for one in cast(Any, signal)]
    return simulate(config, Stimulus.from_samples(config, _codes(config, signal)))


def decode(config: ReadoutConfig, events: Events, ticks: int) -> NDArray[np.float64]:
    """Return the signals reconstructed from events.

    An event counts for the tick in which it left the readout.

    Parameters
    ----------
    config : ReadoutConfig
        The readout that sent the events.
    events : Events, shape (events,)
        Events from ``encode``, ``run_rtl`` or a ``Recording``.
    ticks : int
        Length of the signals in sample ticks.

    Returns
    -------
    float64 array, shape (ticks, taxels)
        In full scales.

    Raises
    ------
    InputError
        If the events belong to another array or encoder, or are after the last tick.
    """
    from eskin.model import taxel

    if ticks < 0:
        raise InputError(f"ticks must not be negative, not {ticks}")
    check_events(events, config, ticks * config.clocks_per_sample)
    counts, late = taxel.counts_of_events(config, events, ticks)
    return taxel.decode(config, counts, late) / config.full_scale


def run_rtl(
    config: ReadoutConfig, signal: ArrayLike, simulator: Literal["verilator", "icarus"] = "verilator"
) -> Events:
    """Return the address events of a signal, computed by simulating the RTL and compared with the golden model.

    The first call builds the Verilog of the configuration for the simulator, which takes seconds to minutes, depending
    on the array; later calls reuse the program.

    Parameters
    ----------
    config, signal
        Same as for ``encode``.
    simulator : "verilator" or "icarus"
        Verilator needs g++, make and perl; Icarus Verilog needs iverilog.

    Returns
    -------
    Events, shape (events,)

    Raises
    ------
    InputError
        If ``encode`` would refuse the signal, or the simulator is not installed.
    MismatchFound
        If RTL and model differ (``eskin.cocotb_tests.runner.process``).
    """
    codes = _codes(config, signal)
    with _named_group():
        from eskin.cocotb_tests.runner.sim import play_samples

        return play_samples(config, codes, simulator)


def plot(
    config: ReadoutConfig,
    events: Events,
    signal: ArrayLike | None = None,
    rebuilt: ArrayLike | None = None,
    title: str = "",
    path: str | Path | None = None,
) -> Figure:
    """Return a picture with a raster of events below their signals.

    Parameters
    ----------
    config : ReadoutConfig
    events : Events, shape (events,)
    signal : integer or float array, as for ``encode``, optional
        Encoded signal; the picture shows the signals of the receptive fields.
    rebuilt : float array, shape (ticks, taxels), optional
        Signal from ``decode``.
    title : str
    path : str or Path, optional
        File to write too: .png, .pdf or .svg.

    Raises
    ------
    InputError
        If a signal does not fit the array, or the file cannot be written.
    """
    from eskin.base.figures.style import save_figure
    from eskin.model.encoders.fields import signals
    from eskin.skin.figures.raster import draw_signals

    shown = {} if signal is None else {"signal": signals(config, _codes(config, signal)) / config.full_scale}
    shown |= {} if rebuilt is None else {"reconstruction": _flat(config, rebuilt).astype(np.float64)}
    figure = draw_signals(events, shown, config, title)
    figure._repr_png_ = lambda: _png(figure)  # type: ignore[attr-defined]  # what a notebook asks for
    if path is not None:
        save_figure(figure, path)
    return figure


# -- classes -----------------------------------------------------------------------------------------


def dataset(
    config: ReadoutConfig,
    signals: Sequence[ArrayLike],
    classes: Sequence[str] | None = None,
    bin_s: float = 0.004,
) -> ScanData:
    """Return a dataset for networks: event counts per bin, with a class for each signal.

    Parameters
    ----------
    config : ReadoutConfig
    signals : sequence of arrays, or one array of shape (recordings, ticks, taxels)
        Signals as for ``encode``. Lengths may differ; shorter signals end with empty bins.
    classes : sequence of str, optional
        Class of each signal. Not needed to predict.
    bin_s : float
        Length of a time bin in seconds.

    Returns
    -------
    ScanData
        A ``torch.utils.data.Dataset``: ``data[0]`` is a tensor of event counts, shape (bins, channels), and the number
        of the class. ``values`` has the shape (recordings, bins, channels); ON and OFF of a taxel are two channels.

    Raises
    ------
    InputError
        If a signal does not fit, or is shorter than a bin; if the number of classes is another.
    """
    from eskin.model.events.recording import Recording
    from eskin.snn.data.bins import BinConfig
    from eskin.snn.data.scans import collect

    kinds = ["unknown"] * len(signals) if classes is None else [str(kind) for kind in classes]
    if len(kinds) != len(signals) or not kinds:
        raise InputError(f"every signal needs its class, but there are {len(signals)} signals and {len(kinds)} classes")
    recordings = []
    for number, (signal, kind) in enumerate(zip(signals, kinds, strict=True)):
        codes = _codes(config, signal)
        clocks = len(codes) * config.clocks_per_sample
        recordings.append(
            Recording(encode(config, codes), config, clocks, metadata={"name": str(number), "class": kind})
        )
    found = collect(recordings, BinConfig(bin_s=bin_s))
    with _named_group():
        from eskin.snn.data.torch_set import ScanSet
    return ScanSet.of(found)


def train(
    data: ScanData,
    recordings: Sequence[int] | None = None,
    *,
    recipe: str = "tuned",
    seed: int = 0,
    progress: Callable[[Epoch], object] | None = None,
    **settings: Any,
) -> Weights:
    """Train a network on a dataset and return its weights.

    Parameters
    ----------
    data : ScanData
        Data from ``dataset``.
    recordings : sequence of int, optional
        Indices of the training recordings; the others remain for a test. All by default.
    recipe : str
        Settings to start from, as ``eskin train --recipe``.
    seed : int
        Seed of weights, order and augmentation.
    progress : callable, optional
        Called with the ``Epoch`` after each one: its number, loss and accuracy.
    **settings
        Fields of ``NetworkConfig`` and ``TrainConfig``, for example ``hidden=64, decay=0.9, epochs=60``.

    Returns
    -------
    Weights
        Network for ``predict`` and ``save_weights``.

    Raises
    ------
    InputError
        If a setting is unknown or out of range, torch is not installed, or the training diverges.
    """
    with _named_group():
        from eskin.snn import train as training
    from eskin.snn.data.scans import Split
    from eskin.snn.exchange.weights import Weights
    from eskin.snn.experiments.recipes import RECIPES
    from eskin.snn.network_config import NetworkConfig
    from eskin.snn.training import TrainConfig, parted

    if recipe not in RECIPES:
        raise InputError(f"recipe must be one of {', '.join(RECIPES)}, not {recipe!r}")
    of_network, of_training = parted({"epochs": 60} | RECIPES[recipe] | settings)
    shape = {"inputs": data.channels, "classes": len(data.class_names)}
    learned = range(len(data.names)) if recordings is None else _numbers(data, recordings)
    done = training.train(
        Split(data, learned),
        NetworkConfig.from_dict(of_network | shape),
        TrainConfig.from_dict(of_training),
        seed,
        progress=progress,
    )
    return Weights(done.network, data.class_names, data.step_s)


@overload
def predict(
    weights: Weights, data: ScanData, recordings: Sequence[int] | None = None, scores: Literal[False] = False
) -> list[str]: ...
@overload
def predict(
    weights: Weights, data: ScanData, recordings: Sequence[int] | None = None, *, scores: Literal[True]
) -> tuple[list[str], NDArray[np.float32]]: ...
def predict(
    weights: Weights, data: ScanData, recordings: Sequence[int] | None = None, scores: bool = False
) -> list[str] | tuple[list[str], NDArray[np.float32]]:
    """Return the predicted class of each recording.

    Parameters
    ----------
    weights : Weights
        Network from ``train`` or ``load_weights``.
    data : ScanData
        Data from ``dataset``, with the readout and the time bin of the training.
    recordings : sequence of int, optional
        Numbers of some recordings; all by default.
    scores : bool
        Also return the evidence for each class of ``weights.class_names``, shape (recordings, classes).

    Raises
    ------
    InputError
        If the data have another number of channels or another time bin than the network.
    """
    with _named_group():
        from eskin.snn.train import logits_of

    if data.step_s != weights.step_s:
        raise InputError(f"the network takes time bins of {weights.step_s:g} s, not {data.step_s:g} s; set bin_s")
    chosen = np.arange(len(data.names)) if recordings is None else _numbers(data, recordings)
    logits = logits_of(weights.network, data, data.first_scans(chosen))
    classes = [weights.class_names[number] for number in logits.argmax(1)]
    return (classes, logits) if scores else classes


def quantise(weights: Weights, bits: int = 8, **precision: Any) -> IntegerWeights:
    """Return the integer network for the classifier in hardware.

    Parameters
    ----------
    weights : Weights
        Network from ``train``, ``load_weights`` or ``load_nir``.
    bits : int
        Bits of all weights, 2 to 8.
    **precision
        Fields of ``eskin.snn.exchange.integer.Precision``, for example ``rec_bits=4``.

    Raises
    ------
    InputError
        If the network has no integer form, or a number of bits is out of range.
    """
    with _named_group():
        from eskin.snn.exchange import integer

    widths = {"in_bits": bits, "rec_bits": bits, "out_bits": bits} | precision
    return integer.quantise(weights, integer.Precision(**widths))


# -- checks ------------------------------------------------------------------------------------------


def _codes(config: ReadoutConfig, signal: ArrayLike) -> NDArray[np.int32]:
    """Return a signal as integer codes, shape (ticks, taxels)."""
    from eskin.skin.textures.scan import quantise

    values = _flat(config, signal)
    wrong = ~((values >= -1) & (values <= 1)) if values.dtype.kind == "f" else np.zeros_like(values, np.bool_)
    if wrong.any():
        tick, taxel = (int(place) for place in np.argwhere(wrong)[0])
        remedy = "divide it by its largest value, or give integer codes"
        if np.isnan(values[tick, taxel]):
            remedy = "replace the missing samples, for example by interpolation"
        raise InputError(
            f"signal is {values[tick, taxel]:g} at tick {tick} of taxel {taxel}, but floats must be in full scales "
            f"from -1 to 1; {remedy}"
        )
    if values.dtype.kind == "f":
        return quantise(values.astype(np.float64), config.sample_bits)[0]
    low, high = -config.full_scale, config.full_scale - 1
    for worst in (values.min(initial=0), values.max(initial=0)):
        if not low <= worst <= high:
            raise InputError(
                f"signal has the code {worst}, outside {low}..{high} of {config.sample_bits} bits; divide it by its "
                f"full scale to give floats, or raise sample_bits"
            )
    return values.astype(np.int32)


def _is_batch(config: ReadoutConfig, signal: Any) -> bool:
    """Return True for several signals, which no single signal of this array can be."""
    if isinstance(signal, (list, tuple)) and len(signal) and isinstance(signal[0], np.ndarray):
        return signal[0].ndim >= 2
    shapes = [(config.rows, config.columns), (config.taxels,)]
    shape = np.shape(signal) if isinstance(signal, np.ndarray) else ()
    return len(shape) >= 3 and shape[1:] not in shapes and (shape[2:] in shapes)


def _flat(config: ReadoutConfig, signal: ArrayLike) -> NDArray[Any]:
    """Return a signal as an array of shape (ticks, taxels)."""
    values = np.asarray(signal)
    if values.dtype.kind not in "iuf":
        raise InputError(f"signal must be integer codes or floats in full scales, not {values.dtype}")
    shapes = [(config.rows, config.columns), (config.taxels,), *([()] if config.taxels == 1 else [])]
    if values.ndim == 0 or values.shape[1:] not in shapes:
        raise InputError(
            f"signal must have the shape (ticks, {config.taxels}) or (ticks, {config.rows}, {config.columns}), not "
            f"{values.shape}; reshape it, or set rows and columns of ReadoutConfig"
        )
    return values.reshape(len(values), config.taxels)


def _png(figure: Figure) -> bytes:
    with io.BytesIO() as file:
        figure.savefig(file, format="png")
        return file.getvalue()


def _numbers(data: ScanData, recordings: Sequence[int]) -> NDArray[np.int64]:
    """Return the indices of the chosen recordings of a dataset."""
    numbers = np.asarray(recordings)
    if numbers.ndim != 1 or not numbers.size or numbers.dtype.kind not in "iu":
        raise InputError("recordings must be a list of at least one recording number")
    for number in numbers.tolist():
        if not 0 <= number < len(data.names):
            raise InputError(
                f"there is no recording {number}; the recordings have the numbers 0..{len(data.names) - 1}"
            )
    return numbers.astype(np.int64)


@contextmanager
def _named_group() -> Iterator[None]:
    """Raise an error that names the pip extra to install if a package is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        from eskin.app.cli import missing_group

        raise InputError(missing_group(error)) from None
