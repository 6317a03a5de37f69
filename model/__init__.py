"""Golden model of the spiking e-skin readout, integer-exact, in NumPy and Numba."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("spiking-eskin-readout")
except PackageNotFoundError:  # run from a checkout that was never installed
    __version__ = "0.0.0+uninstalled"
