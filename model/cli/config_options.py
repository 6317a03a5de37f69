"""The configuration as command-line options: one for every field of ReadoutConfig."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import typer

from model.config import ReadoutConfig
from model.errors import InputError

FIELD_HELP = {
    "rows": "rows of taxels, 1..64",
    "columns": "columns of taxels, 1..64",
    "encoding": "level crossing, with closing window, or leaky neuron",
    "sample_bits": "W, bits of a signed sample",
    "resolution": "N, LSB = 2**-N of full scale, 1..W-2",
    "decide_every": "a free taxel decides once per clock or per sample",
    "reference_reset": "reference after reset, in codes",
    "closing_shift": "cw-lcs: window closes by D / 2**shift",
    "window_period": "cw-lcs: sample ticks per closing step",
    "leak_shift": "nlcs: k of the leak",
    "leak_period": "nlcs: P, sample ticks per decay tick",
    "fraction_bits": "nlcs: F, bits of the reference below the sample LSB",
    "link": "valid/ready stream or REQ/ACK",
    "frontend": "samples in, or comparator decisions in",
    "reset": "reset style of the flops",
    "sample_rate_hz": "sample ticks per second",
    "clocks_per_sample": "clocks per sample tick",
}
"""Help text of every field of ReadoutConfig; the type, the choices and the default come from the class."""


OPTION_NAMES = {"sample_rate_hz": "--sample-rate"}
"""Options whose name is not that of the field; the unit is in the help."""


_UNITS = {"sample_rate_hz": "HZ"}


def option_name(field: str) -> str:
    """Return the command-line option of a field of ReadoutConfig."""
    return OPTION_NAMES.get(field, "--" + field.replace("_", "-"))


def with_config(command: Callable[..., Any]) -> Callable[..., Any]:
    """Replace the parameter ``config`` of a command by one option per field of ReadoutConfig.

    Besides, ``--config FILE`` loads a JSON configuration, which explicit options override, and ``--tau``
    chooses the leak of an N-LCS taxel by its time constant. A parameter ``given``, if the command has one,
    receives the names of the fields that the user set, as a frozenset of str.

    Examples
    --------
    >>> @app.command()                                       # doctest: +SKIP
    ... @with_config
    ... def verilog(config: ReadoutConfig, out: Annotated[Path, typer.Option("-o")]) -> None: ...
    """
    fields = dataclasses.fields(ReadoutConfig)
    hints = get_type_hints(ReadoutConfig)
    wants_given = "given" in inspect.signature(command).parameters
    options = [_config_parameter(field, hints[field.name]) for field in fields]
    options += [_option("tau", str | None, "nlcs: time constant, sets leak-shift and leak-period", "SECONDS")]
    options += [_option("config_file", Path | None, "JSON configuration", "FILE", "--config")]

    def build(texts: dict[str, Any]) -> dict[str, Any]:
        file, tau = texts.pop("config_file"), texts.pop("tau")
        explicit = {n: _parse(option_name(n), hints[n], v) for n, v in texts.items() if v is not None}
        config, given = build_config(explicit, None if tau is None else _parse("--tau", float, tau), file)
        return {"config": config} | ({"given": given} if wants_given else {})

    return replace_parameters(command, ("config", "given"), options, build, last=True)


def replace_parameters(
    command: Callable[..., Any],
    names: Sequence[str],
    options: Sequence[inspect.Parameter],
    build: Callable[[dict[str, Any]], dict[str, Any]],
    last: bool = False,
) -> Callable[..., Any]:
    """Return a command that has options in the place of some of its parameters.

    Parameters
    ----------
    command : callable
    names : sequence of str
        The parameters that go; those that the command does not have are passed over.
    options : sequence of inspect.Parameter
        What the user sees instead.
    build : callable
        Gives the arguments of the command for ``names`` from the values of the options by name.
    last : bool
        The options stand behind all others in the help, else where the first of ``names`` stood.
    """
    signature = inspect.signature(command, eval_str=True)
    own = list(signature.parameters.values())
    kept = [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in own if p.name not in names]
    at = len(kept) if last else next(number for number, p in enumerate(own) if p.name in names)
    parameters = [*kept[:at], *options, *kept[at:]]

    @functools.wraps(command)
    def wrapper(**arguments: Any) -> Any:
        values = {option.name: arguments.pop(option.name) for option in options}
        return command(**arguments, **build(values))

    wrapper.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    wrapper.__annotations__ = {p.name: p.annotation for p in parameters}
    return wrapper


def _config_parameter(field: dataclasses.Field[Any], hint: Any) -> inspect.Parameter:
    """Return the option of one field, a text: the configuration refuses wrong values in its own words."""
    metavar = "|".join(get_args(hint)) or _UNITS.get(field.name, "N")
    return _option(field.name, str | None, f"{FIELD_HELP[field.name]} [{field.default}]", metavar)


def _option(name: str, hint: Any, text: str, metavar: str, option: str = "") -> inspect.Parameter:
    """Return an optional keyword parameter; None stands for "not given"."""
    info = typer.Option(option or option_name(name), help=text, metavar=metavar, show_default=False)
    annotation = Annotated[hint, info]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=annotation)


def _parse(option: str, kind: Any, text: str) -> Any:
    """Return the number that the text of an option stands for; other kinds stay text."""
    if kind not in (int, float):
        return text
    try:
        return kind(text)
    except ValueError:
        noun = "a whole number" if kind is int else "a number"
        raise InputError(f"{option} takes {noun}, not {text!r}") from None


def build_config(
    explicit: dict[str, Any], tau_s: float | None = None, file: Path | None = None
) -> tuple[ReadoutConfig, frozenset[str]]:
    """Return a configuration from a file, explicit fields and a time constant, in rising priority.

    Parameters
    ----------
    explicit : dict
        Fields of ReadoutConfig that the user set.
    tau_s : float, optional
        Time constant of the N-LCS leak in seconds.
    file : Path, optional
        JSON configuration; its absent fields take their defaults.

    Returns
    -------
    ReadoutConfig
    frozenset of str
        Names of the fields that did not take their default.
    """
    given = set(explicit)
    fields = dict(explicit)
    if file is not None:
        fields = ReadoutConfig.load(file).to_dict() | explicit
        given |= set(json.loads(file.read_text()))
    config = ReadoutConfig.from_dict(fields)
    if tau_s is None:
        return config, frozenset(given)
    if clash := [name for name in ("leak_shift", "leak_period") if name in explicit]:
        raise InputError(f"--tau sets {clash[0]} itself; give --tau or {option_name(clash[0])}, not both")
    if config.encoding != "nlcs":
        raise InputError(f"--tau is the leak of encoding nlcs, not of {config.encoding}; add --encoding nlcs")
    leak = ReadoutConfig.from_tau(tau_s, 1.0 / config.sample_rate_hz)
    config = config.replace(leak_shift=leak.leak_shift, leak_period=leak.leak_period)
    return config, frozenset(given | {"leak_shift", "leak_period"})
