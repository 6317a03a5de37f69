"""Checks of command options before any work: no option without effect, no number out of range."""

import math
from collections.abc import Mapping
from typing import Any

from eskin.app.catalogue import COMMANDS
from eskin.base.configuration import option_of
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.frame_config import SHARED_FIELDS

SPIKING = " ".join(
    option_of(field) for name, field in ReadoutConfig.__dataclass_fields__.items() if name not in SHARED_FIELDS
)
"""Options that a frame readout does not have: the word SPIKING in the declaration of a command."""

IDLE = {"not --baseline=highpass": "--highpass"}
"""Options without effect by condition, of all commands that have these options; a command declares its others.

A condition is ``--x`` (the user gave it), ``no --x`` (without it), ``--x=value``, which may be the default, or ``not``
before that.
"""

SECONDS, BITS, MANY, SEED = (1e-9, 1e9), (2, 8), (1, 10**9), (0, 10**18)
RANGES: dict[str, tuple[float, float]] = {
    "baud": (1, 10**8), "bias_bits": (2, 16), "bin_s": SECONDS, "checkpoint_every": MANY,
    "clock": (1e3, 1e12), "clocks": (1, 10**15), "decay_bits": (2, 16), "disturbed": MANY, "epochs": MANY,
    "fold": (0, 10**9), "folds": MANY, "frame_rate": (1e-9, 1e12), "hours": (0, 1e4), "in_bits": BITS,
    "lanes": (1, 4096), "limit": MANY, "membrane_bits": (2, 64), "only": SEED, "out_bits": BITS, "page": (0, 65535),
    "patience": (0.1, 1e6), "rate_resolution": (1, 10), "rec_bits": BITS, "relays": (0, 4096), "rtl": (0, 10**4),
    "run": (0, 10**9), "seconds": (0, 1e9), "seed": SEED, "seeds": MANY, "speed": (1e-4, 1e6),
    "start": (-(2.0**63), 2.0**63), "start_row": (0, 1e6), "start_rows": MANY, "step": SECONDS, "tau": SECONDS,
    "textures": (0, 10**9), "threads": (1, 4096), "threshold_bits": (2, 16), "ticks": (1, 10**12),
    "workers": (1, 4096), "wrap": (1, 64),
}  # fmt: skip
"""Least and largest value of a number that an option takes, by parameter.

Other numbers are fields of a class, or are checked together with other values before the work.
"""


def check_options(command: str, options: Mapping[str, str], values: Mapping[str, Any], typed: frozenset[str]) -> None:
    """Check for options without effect and numbers out of range.

    ``options`` names the parameter of each option, such as ``--start-row``. ``values`` of all parameters are typed or
    default. ``typed`` are the parameters that the user typed, even if with the default.
    """
    for option, parameter in options.items():
        found = values.get(parameter)
        for value in (found if isinstance(found, list | tuple) else [found]) if parameter in typed else ():
            if isinstance(value, int | float) and parameter in RANGES:
                _check_range(option, value, *RANGES[parameter])
    for condition, idle in rules_of(command):
        given = [option for option in idle if options.get(option) in typed]
        if given and (words := _holding(condition, options, values, typed)) is not None:
            raise InputError(f"{given[0]} has no effect {words}")


def rules_of(command: str) -> list[tuple[str, list[str]]]:
    """Return the conditions of a command, and the options that have no effect under each."""
    declared = {**IDLE, **COMMANDS[command].idle}
    return [(condition, idle.replace("SPIKING", SPIKING).split()) for condition, idle in declared.items()]


def _check_range(option: str, value: float, low: float, high: float) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"{option} takes a finite number, not {value}")
    if not low <= value <= high:
        raise InputError(f"{option} must be in {low:g}..{high:g}, not {value}")


def _holding(
    condition: str, options: Mapping[str, str], values: Mapping[str, Any], typed: frozenset[str]
) -> str | None:
    """Return the end of an error message if a condition holds, else None."""
    if condition.startswith("no "):
        option = condition.removeprefix("no ")
        return f"without {option}; add {option}, or leave it out" if _absent(values[options[option]]) else None
    option, given, value = condition.removeprefix("not ").partition("=")
    if condition.startswith("not "):
        other = str(values[options[option]]) != value
        return f"without {option} {value}; add that, or leave it out" if other else None
    if given:
        said = f"--no-{option[2:]}" if value == "False" else f"{option} {value}"
        return f"with {said}; leave it out" if str(values[options[option]]) == value else None
    names = condition.split(" & ")
    if not all(options[name] in typed and not _absent(values[options[name]]) for name in names):
        return None
    return f"with {' and '.join(names)}; leave one of {'them' if len(names) > 1 else 'the two'} out"


def _absent(value: object) -> bool:
    """Return True if an option was not given or a flag is off."""
    return value is False or value in (None, "", [], ())
