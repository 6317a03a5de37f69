"""Fields of a dataclass as command-line options: name, help, unit and default come from the field itself."""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, Any, get_args, get_type_hints

import typer

from model.errors import InputError

_METAVARS = {"s": "SECONDS"}


def option_of(field: dataclasses.Field[Any]) -> str:
    """Return the command-line option of a field made by ``model.config.parameter``: its name without the unit."""
    name = field.metadata["option"] or field.name.removesuffix(f"_{field.metadata['unit'].lower()}")
    return "--" + name.replace("_", "-")


def field_options(
    cls: type, names: Iterable[str] | None = None, defaults: Mapping[str, object] | None = None
) -> list[inspect.Parameter]:
    """Return one option for each field, a text: the class refuses wrong values in its own words.

    Parameters
    ----------
    cls : dataclass
        Its fields are made by ``model.config.parameter``.
    names : iterable of str, optional
        Fields that become options; all by default.
    defaults : mapping of str to object, optional
        What the help says of the default, by field, where a command has another than the class.
    """
    hints, said = get_type_hints(cls), defaults or {}
    fields = {field.name: field for field in dataclasses.fields(cls)}
    options = []
    for name in fields if names is None else names:
        field = fields[name]
        default, unit = said.get(name, field.default), field.metadata["unit"]
        text = field.metadata["meaning"] + ("" if default in (None, "") else f" [{default}]")
        number = _METAVARS.get(unit, unit.upper() or "NUMBER") if hints[name] is float else "N"
        metavar = number if numeric(hints[name]) else "|".join(get_args(hints[name])) or "TEXT"
        options.append(option(name, str | None, text, metavar, option_of(field)))
    return options


def with_fields(
    cls: type, names: Sequence[str], into: str, defaults: Mapping[str, object] | None = None
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Replace the parameter ``into`` of a command by options for fields of a dataclass.

    The command receives the fields that the user set, by name.

    Examples
    --------
    >>> @with_fields(FrameConfig, ("word_bits",), "own")      # doctest: +SKIP
    ... def frames(own: dict[str, Any]) -> None: ...
    """
    options = field_options(cls, names, defaults)

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        return replace_parameters(command, [into], options, lambda texts: {into: parse_fields(cls, texts)})

    return decorate


def parse_fields(cls: type, texts: Mapping[str, str | None]) -> dict[str, Any]:
    """Return the values of the fields whose option was given, by name."""
    hints = get_type_hints(cls)
    fields = {field.name: field for field in dataclasses.fields(cls)}
    return {n: parse_number(option_of(fields[n]), hints[n], v) for n, v in texts.items() if v is not None}


def numeric(hint: Any) -> type | None:
    """Return int or float where a type hint is that, or that or None; None for other hints."""
    kinds = [kind for kind in (get_args(hint) or (hint,)) if kind in (int, float)]
    return kinds[0] if kinds else None


def parse_number(name: str, hint: Any, text: str) -> Any:
    """Return the number that the text of an option stands for; texts of other kinds stay as they are."""
    kind = numeric(hint)
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


def option(name: str, hint: Any, text: str, metavar: str, flag: str) -> inspect.Parameter:
    """Return an optional keyword parameter with an option; None stands for "not given"."""
    info = typer.Option(flag, help=text, metavar=metavar, show_default=False)
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Annotated[hint, info])


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
