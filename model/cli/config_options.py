"""The configuration as command-line options: fields of ReadoutConfig, ``--config`` and ``--tau``."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from model.cli.field_options import field_options, option, option_of, parse_fields, parse_number, replace_parameters
from model.config import ReadoutConfig
from model.errors import InputError
from model.frame_config import OWN_FIELDS

CONFIG_FILE = option("config_file", Path | None, "JSON configuration", "FILE", "--config")
TAU = option("tau", str | None, "nlcs: time constant, sets leak-shift and leak-period", "SECONDS", "--tau")


def option_name(field: str) -> str:
    """Return the command-line option of a field of ReadoutConfig."""
    return option_of(next(f for f in dataclasses.fields(ReadoutConfig) if f.name == field))


def with_config(
    command: Callable[..., Any] | None = None,
    *,
    fields: Sequence[str] | None = None,
    defaults: Mapping[str, object] | None = None,
    file: bool = True,
) -> Any:
    """Replace the parameter ``config`` of a command by one option per field of ReadoutConfig.

    Besides, ``--config FILE`` loads a JSON configuration, which explicit options override, and ``--tau``
    chooses the leak of an N-LCS taxel by its time constant, unless the command has a parameter ``tau`` of its own.
    A parameter ``given``, if the command has one, receives the names of the fields that the user set, as a
    frozenset of str; a parameter ``stored`` the fields of a frame readout in the file, which other commands refuse.

    Parameters
    ----------
    command : callable, optional
        Left out where the decorator is called with the others.
    fields : sequence of str, optional
        The fields that become options, all by default; ``--tau`` comes only with all.
    defaults : mapping of str to object, optional
        What the help says of a default, where the command has another than the class.
    file : bool
        False leaves ``--config`` out.

    Examples
    --------
    >>> @app.command()                                       # doctest: +SKIP
    ... @with_config
    ... def verilog(config: ReadoutConfig, out: Annotated[Path, typer.Option("-o")]) -> None: ...
    """
    if command is None:
        return lambda function: with_config(function, fields=fields, defaults=defaults, file=file)
    wants = inspect.signature(command).parameters
    options = field_options(ReadoutConfig, fields, defaults)
    options += ([TAU] if fields is None else []) + ([CONFIG_FILE] if file else [])

    def build(texts: dict[str, Any]) -> dict[str, Any]:
        path, tau = texts.pop("config_file", None), texts.pop("tau", None)
        tau_s = None if tau is None else parse_number("--tau", float, tau)
        stored: dict[str, Any] | None = {} if "stored" in wants else None
        config, given = build_config(parse_fields(ReadoutConfig, texts), tau_s, path, stored)
        made = {"config": config, "given": given, "stored": stored}
        return {name: value for name, value in made.items() if name in wants}

    return replace_parameters(command, ("config", "given", "stored"), options, build, last=True)


def build_config(
    explicit: dict[str, Any],
    tau_s: float | None = None,
    file: Path | None = None,
    stored: dict[str, Any] | None = None,
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
    stored : dict, optional
        Takes the fields of a frame readout in the file; without it they are refused.

    Returns
    -------
    ReadoutConfig
    frozenset of str
        Names of the fields that did not take their default.
    """
    given = set(explicit)
    fields = dict(explicit)
    if file is not None:
        found, named = ReadoutConfig.of_file(file, OWN_FIELDS)
        own = {name: named[name] for name in OWN_FIELDS if name in named}
        if own and stored is None:
            raise InputError(
                f"the configuration {file} is that of a frame readout ({', '.join(own)}); leave these out, or give it "
                f"to python -m model frames, or to python -m rtl verilog --readout frame"
            )
        if stored is not None:
            stored |= own
        fields = found.to_dict() | explicit
        given |= set(named) - set(own)
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
