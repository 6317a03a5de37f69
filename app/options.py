"""Make command options from dataclass fields, with name, help, unit and default of each field.

Every value arrives as text, and the class refuses a wrong one in its own sentence.
"""

import dataclasses
import functools
import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_type_hints

from typer.models import ArgumentInfo, OptionInfo

from eskin.base import outputs
from eskin.base.configuration import option_of
from eskin.base.errors import InputError
from eskin.model.config import NO_LOGIC, ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.frame_config import OWN_FIELDS, SHARED_FIELDS

Command = Callable[..., Any]
Decorated = TypeVar("Decorated", bound=Command)

TRAINED = Path("out/train/weights.npz")
"""Weights that ``eskin train`` writes; commands that read a network take them by default."""

READOUT, RECORDINGS, DETAIL = SHARED = ("Readout", "Reading your recordings", "Readout in detail")
"""Headings of the options that commands share, in the order of the help."""

MAIN = ("rows", "columns", "encoding", "resolution", "sample_rate_hz")
"""Fields of ReadoutConfig under the heading ``READOUT``; the other fields follow under ``DETAIL``."""


def command(heading: str, **declared: str | Mapping[str, str]) -> Callable[[Decorated], Decorated]:
    """Declare a command under a heading of the help; ``eskin.app.catalogue.Declaration`` explains the arguments."""
    return lambda function: function


# -- options and arguments of a command, and paths that it writes ------------------------------------


def opt(default: Any, *words: str, **limits: Any) -> Any:
    """Return a command-line option for its default, its flags, its metavar and its help text.

    The default is ``...`` for a required option, or if the option belongs to an annotation. Without flags, the
    parameter's name gives the flag. The metavar may be absent. ``limits`` are other arguments of ``typer.Option``.
    """
    return _filled(OptionInfo, default, words, limits)


def arg(default: Any, *words: str, **limits: Any) -> Any:
    """Return a command-line argument for its default, its metavar and its help text."""
    return _filled(ArgumentInfo, default, words, limits)


def _filled(kind: type[Any], default: Any, words: Sequence[str], limits: Mapping[str, Any]) -> Any:
    flags = [word for word in words[:-1] if word.startswith("-")]
    metavar = next((word for word in words[:-1] if not word.startswith("-")), None)
    return kind(default=default, param_decls=flags, metavar=metavar, help=words[-1], **limits)


class Output(OptionInfo):
    """Option for an output path, with the flag ``-o`` by default."""

    folder: bool | Callable[[Mapping[str, Any]], bool]  # a callable receives the arguments of the command by name

    def path(self, path: Path, given: Mapping[str, Any], inputs: Iterable[Path]) -> Path:
        """Return the path to write: a folder unchanged, a file with its links resolved.

        Raises InputError if the output cannot be written, is an input, or is inside an input.
        """
        if self.folder(given) if callable(self.folder) else self.folder:
            outputs.check_folder(path)
        else:
            path = outputs.file_of(path)
        real = path.resolve()
        for place in inputs:
            own = place.resolve()
            if own.is_dir() and own in (real, *real.parents):
                raise InputError(f"cannot write to {path}: it is inside the input {place}; choose a folder outside")
            if own == real and own.is_file():
                raise InputError(f"cannot write {path}: it is the input; choose another name")
        return path


def out_file(default: Any, *words: str, when: bool | Callable[[Mapping[str, Any]], bool] = False, **limits: Any) -> Any:
    """Return an option for an output file, or for an output folder if ``when`` is True.

    ``when`` may be a function of the command's arguments.
    """
    made = _filled(Output, default, words if words[0].startswith("-") else ("-o", "--out", *words), limits)
    made.folder = when
    return made


out_folder = functools.partial(out_file, when=True)
"""Function that returns an option for an output folder."""


def outputs_of(command: Command) -> dict[str, Output]:
    """Return the output options of a command by parameter name."""
    parameters = inspect.signature(command, eval_str=True).parameters.items()
    return {n: mark for n, p in parameters for mark in (p.default, *get_args(p.annotation)) if isinstance(mark, Output)}


def check_outputs(command: Command, arguments: dict[str, Any]) -> list[Path]:
    """Check the output paths in a command's arguments, and resolve their links; return their missing folders."""
    marks = outputs_of(command)
    given = [value if isinstance(value, list) else [value] for name, value in arguments.items() if name not in marks]
    inputs = [one for values in given for one in values if isinstance(one, Path)]
    if isinstance(arguments.get("dataset"), str):
        inputs.append(Path(arguments["dataset"]))
    for name, mark in marks.items():
        if arguments[name] is not None:
            arguments[name] = mark.path(arguments[name], arguments, inputs)
    return [folder for name in marks if arguments[name] for folder in outputs.missing_folders(arguments[name])]


# -- fields of any dataclass -------------------------------------------------------------------------


def option(
    name: str, hint: Any, text: str, metavar: str | None, flag: str, heading: str | None = None
) -> inspect.Parameter:
    """Return an optional keyword parameter with a command-line option; its default None means "not given"."""
    info = opt(..., flag, *filter(None, [metavar]), text, show_default=False, rich_help_panel=heading)
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[hint, info])


def field_options(
    cls: type,
    names: Iterable[str] | None = None,
    defaults: Mapping[str, object] | None = None,
    heading: str | None = None,
) -> list[inspect.Parameter]:
    """Return an option for each field of a dataclass, or only for the named fields.

    Fields are made by ``eskin.model.config.parameter``. ``defaults`` are defaults in the help that differ from the
    class. ``heading`` is that of the options in the help.
    """
    hints, fields = get_type_hints(cls), {field.name: field for field in dataclasses.fields(cls)}
    options = []
    for name in fields if names is None else names:
        field, hint = fields[name], hints[name]
        default = (defaults or {}).get(name, field.default)
        if hint is bool:
            flag = option_of(field)
            both, words = f"{flag}/--no-{flag[2:]}", f"{field.metadata['meaning']} [{'yes' if default else 'no'}]"
            options.append(option(name, bool | None, words, None, both, heading))
            continue
        text = field.metadata["meaning"] + ("" if default in (None, "") else f" [{default}]")
        unit = {"s": "SECONDS", "": "NUMBER"}.get(field.metadata["unit"], field.metadata["unit"].upper())
        metavar = (
            (unit if hint is float else "N")
            if _numeric(hint)
            else field.metadata["values"] or "|".join(get_args(hint)) or "TEXT"
        )
        section = (READOUT if name in MAIN else DETAIL) if cls is ReadoutConfig else heading
        options.append(option(name, str | None, text, metavar, option_of(field), section))
    return options


def parse_fields(cls: type, texts: Mapping[str, str | bool | None]) -> dict[str, Any]:
    """Return the values of the given field options, by field name."""
    hints, fields = get_type_hints(cls), {field.name: field for field in dataclasses.fields(cls)}
    return {n: parse_number(option_of(fields[n]), hints[n], v) for n, v in texts.items() if v is not None}


def parse_number(name: str, hint: Any, text: Any) -> Any:
    """Return an option's text as a number if the type hint is numeric."""
    kind = _numeric(hint)
    if kind is None:
        return text
    try:
        value = kind(text)
    except ValueError:
        noun = "a whole number" if kind is int else "a number"
        raise InputError(f"{name} takes {noun}, not {text!r}") from None
    if not math.isfinite(value):
        raise InputError(f"{name} takes a finite number, not {text!r}")
    return value


def _numeric(hint: Any) -> type | None:
    """Return int or float for a numeric type hint, possibly optional; None for others."""
    return next((kind for kind in (get_args(hint) or (hint,)) if kind in (int, float)), None)


def replace_parameters(
    command: Command,
    names: Sequence[str],
    options: Sequence[inspect.Parameter],
    build: Callable[[dict[str, Any]], dict[str, Any]],
    last: bool = False,
) -> Command:
    """Return a command with options in place of its parameters ``names``.

    A name that is no parameter of the command is ignored.

    ``build`` returns the arguments for ``names`` from the values of the options by name. The options are the last in
    the help, or stand where the first of ``names`` stood.
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


def with_fields(
    cls: type,
    names: Sequence[str],
    into: str,
    defaults: Mapping[str, object] | None = None,
    heading: str | None = None,
) -> Callable[[Command], Command]:
    """Replace the parameter ``into`` of a command, a dictionary of fields, by one option per field."""
    options = field_options(cls, names, defaults, heading)
    return lambda command: replace_parameters(command, [into], options, lambda t: {into: parse_fields(cls, t)})


# -- the configuration of the readout ----------------------------------------------------------------

CONFIG_FILE = option("config_file", Path | None, "JSON configuration", "FILE", "--config", READOUT)
LEAKY = tuple(encoder.name for encoder in registry.ENCODERS if encoder.leaks)
"""Encoders with a leak, which ``--tau`` sets."""

_TAU_HELP = f"{', '.join(LEAKY)}: time constant, sets leak-shift and leak-period"
TAU = option("tau", str | None, _TAU_HELP, "SECONDS", "--tau", DETAIL)


def check_leaks(config: ReadoutConfig) -> None:
    """Check that ``--tau`` is given only for an encoder with leak."""
    if not config.encoder.leaks:
        first, named = LEAKY[0], " or ".join(LEAKY)
        raise InputError(f"--tau is the leak of encoding {named}, not of {config.encoding}; add --encoding {first}")


def check_frame(config: ReadoutConfig, given: frozenset[str]) -> None:
    """Check that no settings of a spiking readout are given for a frame readout."""
    idle = [n for n in sorted(given - {*SHARED_FIELDS}) if getattr(config, n) != getattr(ReadoutConfig(), n)]
    if idle:
        raise InputError(f"{option_name(idle[0])} has no effect on a frame readout; leave it out")


def option_name(field: str, cls: Any = ReadoutConfig) -> str:
    """Return the command-line option for a field of a dataclass."""
    return option_of(cls.__dataclass_fields__[field])


def check_encoder(config: ReadoutConfig, typed: Iterable[str]) -> None:
    """Check that no options of another encoder are given."""
    if idle := [name for name in config.idle_fields if name in typed]:
        readers = [encoder.name for encoder in registry.ENCODERS if idle[0] in encoder.parameters]
        raise InputError(
            f"{option_name(idle[0])} has no effect with --encoding {config.encoding}; leave it out, or add --encoding "
            f"{readers[0]}"
        )


LOGIC = tuple(name for name in ReadoutConfig.__dataclass_fields__ if name not in NO_LOGIC)
"""Fields that change the gates of a readout."""


def with_config(
    command: Command | None = None, *, fields: Sequence[str] | None = None, file: bool = True, every: bool = False
) -> Any:
    """Replace the parameter ``config`` of a command by one option per field of ReadoutConfig.

    ``--config FILE`` loads a JSON configuration, which explicit options override. With all fields, ``--tau`` chooses
    the leak of an N-LCS taxel by its time constant. A parameter ``given`` of the command receives the names of the
    fields that the user set, as a frozenset of str; a parameter ``stored`` the fields of a frame readout in the file,
    which other commands refuse.

    ``fields`` become options, by default all for which the command has no parameter. Without ``file`` the command has
    no ``--config``. ``every`` means that the command runs all encoders unless the user names one, so that the options
    of each have an effect.
    """
    if command is None:
        return lambda function: with_config(function, fields=fields, file=file, every=every)
    wanted = inspect.signature(command).parameters
    names = [name for name in fields or ReadoutConfig.__dataclass_fields__ if name not in wanted]
    options = [*field_options(ReadoutConfig, names), *([TAU] if fields is None else []), *([CONFIG_FILE] * file)]

    def build(texts: dict[str, Any]) -> dict[str, Any]:
        path, tau = texts.pop("config_file", None), texts.pop("tau", None)
        tau_s = None if tau is None else parse_number("--tau", float, tau)
        stored: dict[str, Any] | None = {} if "stored" in wanted else None
        typed = parse_fields(ReadoutConfig, texts)
        config, given = build_config(typed, tau_s, path, stored)
        if not every or "encoding" in given:
            check_encoder(config, typed)
        made = {"config": config, "given": given, "stored": stored}
        return {name: value for name, value in made.items() if name in wanted}

    return replace_parameters(command, ("config", "given", "stored"), options, build, last=True)


def build_config(
    explicit: dict[str, Any],
    tau_s: float | None = None,
    file: Path | None = None,
    stored: dict[str, Any] | None = None,
) -> tuple[ReadoutConfig, frozenset[str]]:
    """Return the configuration from a file, changed by explicit fields and a time constant.

    Also returns the names of the fields that the user, the file or the time constant set. ``stored`` receives the
    fields of a frame readout in the file; without ``stored`` they are refused.
    """
    given = set(explicit)
    fields = dict(explicit)
    if file is not None:
        found, named = ReadoutConfig.of_file(file, OWN_FIELDS)
        own = {name: named[name] for name in OWN_FIELDS if name in named}
        if own and stored is None:
            raise InputError(
                f"the configuration {file} is for a frame readout ({', '.join(own)}); leave these fields out, or use "
                f"the file with eskin frames or eskin verilog --readout frame"
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
    check_leaks(config)
    leak = ReadoutConfig.from_tau(tau_s, 1.0 / config.sample_rate_hz)
    config = config.replace(leak_shift=leak.leak_shift, leak_period=leak.leak_period)
    return config, frozenset(given | {"leak_shift", "leak_period"})
