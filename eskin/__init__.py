"""Spiking readout for electronic skin: encode and decode signals, run the RTL, plot events, classify recordings.

``docs/guide/python.md`` shows all of it in ten lines. A name is imported when it is first used, so ``import eskin``
takes no time and needs no other package. The rooms are subpackages: ``eskin.model``, ``eskin.rtl``, and so on.
"""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from eskin.api import Signal, dataset, decode, encode, plot, predict, quantise, read, run_rtl, train
    from eskin.base.errors import InputError
    from eskin.model.config import ReadoutConfig
    from eskin.model.events.recording import Recording
    from eskin.rtl.readout import Readout
    from eskin.rtl.stream import StreamReadout
    from eskin.snn.exchange.nir_network import load_nir, save_nir
    from eskin.snn.exchange.transforms import LevelCrossing
    from eskin.snn.exchange.weights import Weights, load_weights, save_weights

_MODULES = {
    "eskin.api": "Signal read encode decode run_rtl plot dataset train predict quantise",
    "eskin.base.errors": "InputError",
    "eskin.model.config": "ReadoutConfig",
    "eskin.model.events.recording": "Recording",
    "eskin.rtl.readout": "Readout",
    "eskin.rtl.stream": "StreamReadout",
    "eskin.snn.exchange.nir_network": "load_nir save_nir",
    "eskin.snn.exchange.transforms": "LevelCrossing",
    "eskin.snn.exchange.weights": "Weights load_weights save_weights",
}
_PLACES = {name: module for module, names in _MODULES.items() for name in names.split()}

__all__ = [
    "InputError",
    "LevelCrossing",
    "Readout",
    "ReadoutConfig",
    "Recording",
    "Signal",
    "StreamReadout",
    "Weights",
    "dataset",
    "decode",
    "encode",
    "load_nir",
    "load_weights",
    "plot",
    "predict",
    "quantise",
    "read",
    "run_rtl",
    "save_nir",
    "save_weights",
    "train",
]


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    try:
        module = import_module(_PLACES[name])
    except ModuleNotFoundError as error:
        from eskin.app.cli import missing_group

        raise ImportError(missing_group(error)) from None
    globals()[name] = found = getattr(module, name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
