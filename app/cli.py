"""Common parts of all commands: app, exit codes and error messages."""

import importlib
import shlex
import sys
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, NoReturn, cast

import typer
import typer.core

from eskin.app.catalogue import ABOUT, ABOUT_DEV, CHECKS, COMMANDS, DEV, overview, sections
from eskin.app.leave import EXIT_INPUT_ERROR, leave_quietly
from eskin.app.options import SHARED, check_outputs
from eskin.app.refusals import check_options
from eskin.base.errors import InputError
from eskin.base.outputs import remove_empty
from eskin.base.packages import missing
from eskin.base.workers.garbage import collect_seldom

OF_THIS_RUN = {"out", "workers", "scheduler"}
"""Options that do not change the result."""

NETWORK = "weights"
"""Name of the argument that every command also takes as an option."""


class Command(typer.core.TyperCommand):
    """Command with its own options first in the help, then groups of common options."""

    running: ClassVar[Any]
    """Context of the command that runs."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse a command line; accept ``--weights FILE`` in place of the argument WEIGHTS."""
        if any(p.name == NETWORK and p.param_type_name == "argument" for p in self.params):
            if args[-1:] == [f"--{NETWORK}"]:
                raise InputError(f"--{NETWORK} needs a file; give the file after this option")
            args = [word.removeprefix(f"--{NETWORK}=") for word in args if word != f"--{NETWORK}"]
        return super().parse_args(ctx, args)

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the help sections: arguments, the command's own options, then groups of common options."""
        found: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for parameter in self.get_params(ctx):
            own = "Arguments" if parameter.param_type_name == "argument" else "Options"
            if (record := parameter.get_help_record(ctx)) is not None:
                if own == "Arguments" and parameter.name == NETWORK:
                    record = (record[0], f"{record[1]}; also --{NETWORK} FILE")
                found.setdefault(getattr(parameter, "rich_help_panel", None) or own, []).append(record)
        for heading in sorted(found, key=["Arguments", "Options", *SHARED].index):
            if found[heading]:
                with formatter.section(heading):
                    formatter.write_dl(found[heading])

    def invoke(self, ctx: Any) -> Any:
        """Run the command after checking its options and outputs; leave no empty folder after an error."""
        self.check(ctx)
        Command.running = ctx
        made = check_outputs(cast(Callable[..., Any], self.callback), ctx.params)
        try:
            return super().invoke(ctx)
        except InputError:
            remove_empty(made)
            raise

    def check(self, ctx: Any) -> None:
        """Check for numbers out of range and for options without effect."""
        options = {word: str(p.name) for p in self.params for word in p.opts if word.startswith("--")}
        source = {name: ctx.get_parameter_source(name) for name in options.values()}
        typed = frozenset(name for name, at in source.items() if at is not None and at.name == "COMMANDLINE")
        check_options(str(self.name), options, ctx.params, typed)


class Commands(Mapping[str, typer.core.TyperCommand]):
    """Group that imports only the command in use, for fast help and error messages."""

    def __init__(self, names: Iterable[str]) -> None:
        self.names = tuple(names)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __getitem__(self, name: str) -> typer.core.TyperCommand:
        if name not in self.names:
            raise KeyError(name)
        if name == DEV:
            return cast(typer.core.TyperCommand, typer.main.get_command(make_app(ABOUT_DEV, Checks)))
        module, function = importlib.import_module(COMMANDS[name].module), name.replace("-", "_")
        alone = _new_app()
        alone.command(name, cls=Command)(getattr(module, function, None) or getattr(module, f"{function}_"))
        return cast(typer.core.TyperCommand, typer.main.get_command(alone))


class Group(typer.core.TyperGroup):
    """Group of commands in the order of the catalogue."""

    names: tuple[str, ...]

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = Commands(self.names)  # type: ignore[assignment]  # read only

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return list(self.commands)


class Checks(Group):
    """The command group ``eskin dev``, for checks of the project."""

    names = tuple(CHECKS)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the list of all checks."""
        formatter.write("\n".join(sections({"Commands": {name: COMMANDS[name].summary for name in CHECKS}})) + "\n")


class AllCommands(Group):
    """The command group ``eskin``."""

    names = (*(name for name in COMMANDS if name not in CHECKS), DEV)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command by name; checks are only available in ``dev``."""
        if cmd_name in CHECKS:
            raise InputError(f"{cmd_name} is a check of the project; run eskin {DEV} {cmd_name}")
        return super().get_command(ctx, cmd_name)

    def get_help(self, ctx: Any) -> str:
        """Return the help text, with the commands in sections."""
        return overview()


def _new_app(**options: Any) -> typer.Typer:
    """Return an app with plain help, without completion options and decorated tracebacks."""
    return typer.Typer(
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110},
        **options,
    )


def make_app(help_text: str, group: type[typer.core.TyperGroup] | None = None) -> typer.Typer:
    """Return an app without commands."""
    app = _new_app(help=help_text, cls=group)
    app.callback()(lambda: None)  # keeps the name of the subcommand even where there is only one
    return app


def run(app: typer.Typer, prog_name: str, args: Sequence[str] | None = None) -> NoReturn:
    """Run an app and exit the process.

    An InputError, or a wrong option, prints ``error: <sentence>`` on standard error and exits with code 2.
    Ctrl-C and a reader that closes the pipe are quiet: codes 130 and 141. Commands choose other codes by
    ``raise typer.Exit(code)``. Anything else is a defect of the program and keeps its traceback. The arguments are
    those of the process by default.
    """
    if args is None:
        collect_seldom()
    leave_quietly(lambda: _invoke(app, prog_name, list(sys.argv[1:] if args is None else args)))


def _invoke(app: typer.Typer, prog_name: str, args: list[str]) -> int:
    command = typer.main.get_command(app)
    args = [*args, "--help"] if args in ([], [DEV]) else args
    try:
        with command.make_context(prog_name, args) as context:
            command.invoke(context)
    except typer.Exit as leave:
        return leave.exit_code
    except ModuleNotFoundError as error:
        return _report(missing_group(error))
    except InputError as error:
        return _report(str(error))
    except typer.TyperException as error:  # a usage error: unknown option, missing argument
        message, where = wrong_value(error) or error.format_message().rstrip("."), getattr(error, "ctx", None)
        help_of = f"; {where.command_path} --help explains it" if where and message.startswith("Missing") else ""
        return _report(message + help_of)
    except OverflowError as error:  # an absurd number that no check caught, not a defect
        return _report(f"a number is too large ({error}); give one that a float can hold")
    except MemoryError as error:
        return _report(f"not enough memory: {str(error) or 'the data are too large'}")
    except RuntimeError as error:  # pathlib of Python below 3.13
        if not str(error).startswith("Symlink loop from "):
            raise
        return _report(f"cannot use {error.args[0].removeprefix('Symlink loop from ')}: it is a link to itself")
    except OSError as error:
        if error.filename is None:  # a broken pipe, or a defect
            raise
        return _report(f"cannot use {error.filename}: {error.strerror}")
    return 0


def wrong_value(error: typer.TyperException) -> str | None:
    """Return a sentence with the value that an option does not take; None for other usage errors."""
    find = getattr(error.__cause__, "errors", None)  # pydantic has found what is wrong
    if find is None:
        return None
    (wrong, *_), hint = find(), cast(Any, error).param.get_error_hint()
    bounds, option = wrong.get("ctx", {}), hint.rpartition(" / ")[2].strip("'")
    if (least := bounds.get("ge")) is not None:
        needs = f"must be at least {least:g}"
    elif (most := bounds.get("le")) is not None:
        needs = f"must be at most {most:g}"
    else:
        needs = f"takes {'a whole' if wrong['type'].startswith('int') else 'a'} number"
    return f"{option} {needs}, not {str(wrong['input'])[:80]!r}"


def missing_group(error: ModuleNotFoundError) -> str:
    """Return the remedy for a missing package of a group; raise other import errors again."""
    if (sentence := missing((error.name or "").partition(".")[0])) is None:
        raise error
    return sentence


def asked_for() -> str:
    """Return the command line as the user typed it, to store with results."""
    return shlex.join(["eskin", *sys.argv[1:]])


def command_line() -> str:
    """Return the command line that reproduces the result, without default options and options of this run alone."""
    context = Command.running
    words = ["eskin", str(context.info_name)]
    for option in context.command.params:
        value = context.params.get(str(option.name))
        if option.name in OF_THIS_RUN or value is None or value == option.get_default(context):
            continue
        named = [] if option.param_type_name == "argument" else [max(option.opts, key=len)]
        for one in value if isinstance(value, (list, tuple)) else [value]:
            words += [*named, str(one)]
    return shlex.join(words)


_OBEYED = ("Cc", "Cf", "Cs", "Zl", "Zp")
"""Unicode categories of control characters, and of characters that disguise a name."""


def printable(text: object) -> str:
    """Return a text with control characters escaped, such as \\x1b."""
    return "".join(c.encode("unicode_escape").decode() if unicodedata.category(c) in _OBEYED else c for c in str(text))


def echo(text: object, **where: Any) -> None:
    """Print a text with its control characters escaped, because a file name may contain them."""
    print(printable(text), **where)


app = make_app(ABOUT, AllCommands)
"""The command ``eskin``."""


def _report(message: str) -> int:
    """Print an error as one line on standard error, and return its exit code."""
    sentence = printable(" ".join(message.split())).removesuffix(".")
    print(f"error: {sentence}", file=sys.stderr)
    return EXIT_INPUT_ERROR
