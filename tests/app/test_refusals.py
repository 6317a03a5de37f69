"""Test options before any work: effects, ranges of numbers, and output paths."""

import re
from functools import cache
from pathlib import Path
from typing import Any, get_args

import pytest
import typer

from eskin.app.catalogue import COMMANDS, words_of
from eskin.app.options import option_name, outputs_of
from eskin.app.refusals import IDLE, RANGES, rules_of
from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from tests.conftest import command


def line_of(name: str, given: dict[str, str]) -> str:
    """Return a command line with given options, and "x" for every required one."""
    words = words_of(name)
    for parameter in command(name).params:
        if parameter.param_type_name == "argument":
            words += ["x"] * (parameter.required or parameter.nargs != 1)
        elif (option := max(parameter.opts, key=len)) in given:
            words += [option, given[option]]
        elif parameter.required:
            words += [option, "x"]
    return " ".join(words)


@cache
def needed(name: str) -> list[str]:
    """Return the required arguments and options of a command."""
    return line_of(name, {}).split()[len(words_of(name)) :]


NUMBERS = ("nan", "inf", "1e300", "9" * 30, "-" + "9" * 30)


def options_of(name: str) -> dict[str, Any]:
    """Return the options of a command by long name."""
    found = [p for p in command(name).params if p.param_type_name == "option"]
    return {word: p for p in found for word in (*p.opts, *p.secondary_opts) if word.startswith("--")}


def is_number(parameter: Any) -> bool:
    """Return True if an option is parsed as a number."""
    hint = parameter.type_descriptor.annotation
    return bool({int, float} & {hint, *get_args(hint)})


def words_for(name: str, option: str) -> list[str]:
    """Return an option as typed, with its default value if it has one."""
    parameter = options_of(name)[option]
    if parameter.is_flag:
        return [option]
    field = ReadoutConfig.__dataclass_fields__.get(str(parameter.name))
    default = parameter.default if field is None else field.default
    least = RANGES.get(str(parameter.name), (parameter.min or 1,))[0] if is_number(parameter) else "x"
    return [option, str(least if default in (None, "") else default)]


def fulfilled(name: str, condition: str) -> list[str]:
    """Return options for which the condition of a rule holds."""
    if condition.startswith(("no ", "not ")):
        return []
    if "=" in condition:
        option, value = condition.split("=")
        return [f"--no-{option[2:]}"] if value == "False" else [option, value]
    return [word for option in condition.split(" & ") for word in words_for(name, option)]


RULES = [
    (name, condition, option)
    for name in COMMANDS
    for condition, options in rules_of(name)
    for option in options
    if condition not in IDLE or option in options_of(name)
]


def test_an_option_without_effect_is_refused_even_with_its_default() -> None:
    for name, condition, option in RULES:
        words = [*needed(name), *fulfilled(name, condition), *words_for(name, option)]
        with pytest.raises(InputError, match=f"^{option} has no effect with"):
            command(name).check(command(name).make_context(name, words))


@pytest.mark.parametrize("encoder", registry.ENCODERS, ids=registry.NAMES)
def test_a_setting_of_another_encoder_is_refused(encoder: Any, folder: Path) -> None:
    idle = ReadoutConfig(encoding=encoder.name).idle_fields
    assert idle
    for name in ("encode", "verilog", "sim"):
        for field in idle:
            option = option_name(field)
            words = [*needed(name), "--encoding", encoder.name, *words_for(name, option)]
            with (
                pytest.raises(InputError, match=f"^{option} has no effect with --encoding {encoder.name}; "),
                command(name).make_context(name, words) as context,
            ):
                command(name).invoke(context)


def numbers_of(name: str) -> dict[str, Any]:
    """Return the numeric options of a command; shared readout options only for one command."""
    found = {}
    for option, parameter in options_of(name).items():
        if parameter.name in ReadoutConfig.__dataclass_fields__ and name != "encode" and parameter.default is None:
            continue
        if is_number(parameter) or parameter.metavar in ("N", "NUMBER", "HZ", "V", "CODES"):
            found[option] = parameter
    return found


@pytest.mark.parametrize("name", [name for name in COMMANDS if numbers_of(name)])
def test_every_number_has_a_range(name: str, folder: Path) -> None:
    for option in numbers_of(name):
        for number in NUMBERS:
            with (
                pytest.raises((InputError, typer.TyperException)) as refused,
                command(name).make_context(name, [*needed(name), f"{option}={number}"]) as context,
            ):
                command(name).invoke(context)
            error = refused.value
            said = error.format_message() if isinstance(error, typer.TyperException) else str(error)
            assert option[2:] in re.sub("[_ ]", "-", said), (number, said)
    assert not list(folder.iterdir())


# -- outputs ----------------------------------------------------------------------------------------


OUTPUTS = {"-o", "--out", "--keep", "--plot", "--data-out"}
"""Options under which commands take a place to write to."""


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_a_wrong_output_is_refused_before_the_work(name: str, call: Any, folder: Path) -> None:
    (folder / "file").touch()
    (folder / "folder").mkdir()
    found, outputs = outputs_of(command(name).callback), [p for p in command(name).params if OUTPUTS & set(p.opts)]
    assert {str(p.name) for p in outputs} == set(found), "an output without a mark, or a mark on an input"
    for parameter in outputs:
        for place in ("file" if found[str(parameter.name)].folder is True else "folder", "file/x", "/proc/x"):
            if name == "encode" and place == "folder":
                continue  # it may be one
            code, out, err = call(line_of(name, {max(parameter.opts, key=len): place}))
            assert (code, out, err.count("\n")) == (2, "", 1), (place, err)
            assert err.startswith("error: cannot write "), err
    assert sorted(path.name for path in folder.rglob("*")) == ["file", "folder"]


def test_the_input_is_neither_replaced_nor_searched_for_output(call: Any, folder: Path) -> None:
    (folder / "skin" / "a").mkdir(parents=True)
    (folder / "x.csv").write_text("1,2\n3,4\n")
    (folder / "link.csv").symlink_to("x.csv")
    inside = "it is inside the input skin; choose a folder outside\n"
    for line in (
        "encode skin -o skin/events",
        "train --data skin -o skin",
        "play x --port y --data skin -o skin/e.npz",
    ):
        code, out, err = call(line)
        assert (code, out) == (2, "")
        assert err == f"error: cannot write to {line.split()[-1]}: {inside}"
    assert call("decode x.csv -o link.csv") == (
        2,
        "",
        "error: cannot write x.csv: it is the input; choose another name\n",
    )
