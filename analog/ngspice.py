"""Run the circuit simulator ngspice, a program of the system, on one netlist after the other."""

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from eskin.base.errors import InputError

MEASURE = re.compile(r"(?m)^(\w+)\s+=\s+(\S+)")
FAILED = re.compile(r"(?im)^.*(?:error|timestep too small|singular|no convergence).*(?:(?<=:)\n.*\n.*)?$")


def missing() -> str:
    """Return a sentence if ngspice is not installed, else nothing."""
    return "" if shutil.which("ngspice") else "ngspice not found; install it with: apt-get install ngspice"


def simulate(netlist: str, measures: list[str]) -> dict[str, float]:
    """Return the results of ``.measure`` lines, ``NAME ...`` of a transient, by name; those that failed are absent."""
    if sentence := missing():
        raise InputError(sentence)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "circuit.sp"
        lines = [f".measure tran {line}" for line in measures]
        file.write_text("\n".join(["* " + file.name, netlist, *lines, ".end\n"]))
        command, alone = ["ngspice", "-n", "-b", file.name], os.environ | {"OMP_THREAD_LIMIT": "1"}
        # ngspice starts two threads whatever OMP_NUM_THREADS is. They wait for each other most of the time: on a busy
        # machine, a small circuit takes fifty times longer.
        done = subprocess.run(command, cwd=folder, env=alone, capture_output=True, text=True)
    found = {name.lower(): float(value) for name, value in MEASURE.findall(done.stdout)}
    if not found:
        text = done.stdout + done.stderr
        reason = FAILED.search(text)
        words = " ".join((reason[0] if reason else text[-300:]).split())
        raise InputError(f"ngspice cannot simulate the circuit: {words}")
    return found
