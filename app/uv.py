"""Install packages with uv, from the indexes and folders of pip's configuration.

Only the standard library is used here, since this runs before anything is installed.
"""

import os
import re
import subprocess
from pathlib import Path

FROM_PIP = {
    "index-url": "--default-index",
    "extra-index-url": "--index",
    "find-links": "--find-links",
    "trusted-host": "--allow-insecure-host",
}
"""Settings of pip, and the options of uv for them. uv does not read pip's configuration."""

FOR_CPUS, FOR_GPUS = "0.2 GB to download, 0.7 GB on disk", "2.7 GB to download, 4.6 GB on disk"
"""Sizes of PyTorch without and with its libraries for GPUs."""
GPU = "nvidia-"
"""Start of the names of these libraries."""


class SetupError(Exception):
    """Raised for a missing program or package, or a wrong target or variable; the message names the remedy."""


def uv(python: str) -> list[str]:
    """Return the command line of uv that installs into the environment of an interpreter."""
    listed = subprocess.run([python, "-m", "pip", "config", "list"], capture_output=True, text=True, check=False).stdout
    settings = re.findall(r"^(?:global|install|:env:)\.([\w-]+)='(.*)'$", listed, re.MULTILINE)
    words = [str(Path(python).with_name("uv")), "pip", "install", "--python", python]
    for name, value in dict(reversed(settings)).items():  # pip lists the environment, which wins, first
        for place in re.split(r"\s+|\\n", value) if name in FROM_PIP else ():
            words += [FROM_PIP[name], place]
    return [*words, "--index-strategy=unsafe-best-match"]  # as pip: the newest version of all indexes


def install(command: list[str]) -> None:
    """Run a command line of uv, and print its progress without the list of all packages."""
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        for line in process.stderr or ():
            if not line.startswith((" + ", " - ", " ~ ", " Downloaded")):
                print(line.rstrip(), flush=True)
    if process.returncode:
        raise SetupError("the packages could not be installed; see the error above")


def build_of_torch(command: list[str]) -> list[str]:
    """Return uv's option for the build of PyTorch that suits this machine, and print the size of the build.

    On Linux, the package index has the build for GPUs, with several GB of libraries. The index of PyTorch also has
    small builds, but not every network reaches this index.
    """
    planned, auto = _planned(command), "--torch-backend=auto"
    if " + torch==" not in planned:
        return []
    suited = _planned([*command, auto], UV_HTTP_RETRIES="0", UV_HTTP_TIMEOUT="10") if GPU in planned else ""
    if GPU in (suited or planned):
        why = "" if suited else "; the index of PyTorch, which has smaller builds, was not reached"
        print(f"PyTorch with its libraries for GPUs: {FOR_GPUS}{why}", flush=True)
    else:
        print(f"PyTorch without libraries for GPUs: {FOR_CPUS}", flush=True)
    return [auto] if suited else []


def _planned(command: list[str], **variables: str) -> str:
    """Return the packages that a command line of uv would install; empty if uv fails."""
    done = subprocess.run(
        [*command, "--dry-run"], capture_output=True, text=True, check=False, env=os.environ | variables
    )
    return "" if done.returncode else done.stderr
