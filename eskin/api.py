"""Functions of ``import eskin``: encode, decode, run the RTL, plot, train and predict.

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
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eskin.base.errors import InputError
from eskin.model.address_events import Events, check_events
from eskin.model.config import ReadoutConfig

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from eskin.snn.data.scans import ScanData
    from eskin.snn.exchange.weights import Weights
    from eskin.snn.training import Epoch

# -- signals and events ------------------------------------------------------------------------------


def encode(config: ReadoutConfig, signal: ArrayLike) -> Events:
    """Return the address events of a signal, computed by the golden model.

    Parameters
    ----------
    config : ReadoutConfig
    signal : integer or float array, shape (ticks, taxels) or (ticks, rows, columns)
        Codes, or full scales. One sample per tick, at ``config.sample_rate_hz``.

    Returns
    -------
    Events, shape (events,)
        Events in order of transfer, with the delays of arbiter and link.

    Raises
    ------
    InputError
        If the signal does not fit the array, exceeds full scale, or is not made of numbers.
    """
    from eskin.model.readout import Stimulus, simulate

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
        ``values`` has the shape (recordings, bins, channels); ON and OFF of a taxel are two channels.

    Raises
    ------
    InputError
        If a signal does not fit, is shorter than a bin, or causes no event; if the number of classes is another.
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
    return collect(recordings, BinConfig(bin_s=bin_s))


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


def predict(weights: Weights, data: ScanData, recordings: Sequence[int] | None = None) -> list[str]:
    """Return the predicted class of each recording.

    Parameters
    ----------
    weights : Weights
        Network from ``train`` or ``load_weights``.
    data : ScanData
        Data from ``dataset``, with the readout and the time bin of the training.
    recordings : sequence of int, optional
        Numbers of some recordings; all by default.

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
    return [weights.class_names[number] for number in logits.argmax(1)]


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
