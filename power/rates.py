"""Event rates per taxel against resolution and time constant, for the power model.

A table is measured with the project's encoders on a dataset and kept as JSON; event_rates.json beside this file holds
those of the two datasets in both presets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import read_json
from eskin.base.workers.engine import Pool
from eskin.model.config import ReadoutConfig
from eskin.power.equations import FloatArray, TaxelRates
from eskin.power.parameters import MAX_RESOLUTION, MIN_RESOLUTION
from eskin.power.readouts import Readout, published
from eskin.skin.textures.presets import Scan
from eskin.skin.textures.rates import Image, Watch, each_image, scan_image, unwatched

if TYPE_CHECKING:
    from eskin.skin.textures.dataset import Dataset

TAUS_S = (2.0, 0.2, 0.02)
"""N-LCS time constants of Fig. 7 in seconds."""

RESOLUTIONS = tuple(range(MIN_RESOLUTION, MAX_RESOLUTION + 1))

POWER_SHARE = 0.99
"""Share of the signal's power below the bandwidth in a table."""

STORED = Path(__file__).with_name("event_rates.json")
"""File with the tables of the project."""

_DIGITS = 5  # significant digits of a stored rate


@dataclass(frozen=True, eq=False)
class RateTable:
    """Table of mean event rates of every taxel over a dataset."""

    # dataset and scan preset (docs/guide/textures.md)
    dataset: str
    preset: str
    images: int
    rows: int
    columns: int
    # frequency below which 99 % of the power of the sensor's output lies, all taxels and images pooled
    bandwidth_hz: float
    resolutions: tuple[int, ...]
    taus_s: tuple[float, ...]  # requested N-LCS time constants of the rates
    # lcs_hz, nlcs_hz: events/s of every taxel, mean over the images; shapes (resolutions, taxels) and
    # (taus, resolutions, taxels)
    lcs_hz: NDArray[np.float64]
    nlcs_hz: NDArray[np.float64]

    def population_hz(self, readout: Readout, resolution: int, tau_s: float = 0.2) -> float:
        """Return the events/s of the whole measured array."""
        rates = self.taxel_rates(readout, np.array(float(resolution)), np.array(tau_s), self.rows * self.columns)
        return float(rates.population_hz)

    def taxel_rates(self, readout: Readout, resolution: FloatArray, tau_s: FloatArray, taxels: int) -> TaxelRates:
        """Return the event rates of a spiking readout; see ``RateSource``.

        Between measured time constants both moments are interpolated, logarithms over logarithms. Arrays of another
        size have the same rates a taxel.
        """
        wanted = np.asarray(resolution, int)
        if missing := sorted(set(wanted.ravel().tolist()) - set(self.resolutions)):
            raise InputError(
                f"there are no measured event rates of {missing[0]} b, only of "
                f"{', '.join(map(str, self.resolutions))}; give --dataset to measure them"
            )
        index = np.searchsorted(self.resolutions, wanted)
        scale = taxels / (self.rows * self.columns)
        moments = published(
            readout,
            lcs=lambda: _moments(self.lcs_hz)[:, index] * np.ones_like(tau_s),
            nlcs=lambda: self._at_tau(_moments(self.nlcs_hz), index, tau_s),
        )()
        return TaxelRates(moments[0] * scale, moments[1] * scale)

    def _at_tau(self, moments: FloatArray, index: NDArray[np.int64], tau_s: FloatArray) -> FloatArray:
        """Return sums of rates interpolated to time constants, shape (2, *index.shape)."""
        order = np.argsort(self.taus_s)
        known = np.asarray(self.taus_s)[order]
        outside = (tau_s < known[0] * (1 - 1e-9)) | (tau_s > known[-1] * (1 + 1e-9))
        if outside.any():
            raise InputError(
                f"there are no measured event rates at tau {np.asarray(tau_s)[outside].flat[0]:g} s, only from "
                f"{known[0]:g} to {known[-1]:g} s; give --dataset to measure them"
            )
        if len(known) == 1:
            return moments[:, 0][:, index]
        left = np.clip(np.searchsorted(known, tau_s, side="right") - 1, 0, len(known) - 2)
        part = np.log(tau_s / known[left]) / np.log(known[left + 1] / known[left])
        low, high = (np.maximum(moments[:, order[left + k], index], 1e-300) for k in (0, 1))
        return np.asarray(np.exp((1 - part) * np.log(low) + part * np.log(high)))

    def to_dict(self) -> dict[str, Any]:
        """Return the table as a dictionary, with rates rounded to five digits."""
        fields = {name: getattr(self, name) for name in _SCALARS} | {"bandwidth_hz": round(self.bandwidth_hz, 2)}
        lists = {"resolutions": list(self.resolutions), "taus_s": list(self.taus_s)}
        return fields | lists | {"lcs_hz": _rounded(self.lcs_hz), "nlcs_hz": _rounded(self.nlcs_hz)}

    @classmethod
    def from_dict(cls, values: Any) -> RateTable:
        """Return the table for a dictionary."""
        try:
            table = cls(
                **{name: kind(values[name]) for name, kind in _SCALARS.items()},
                bandwidth_hz=float(values["bandwidth_hz"]),
                resolutions=tuple(int(n) for n in values["resolutions"]),
                taus_s=tuple(float(t) for t in values["taus_s"]),
                lcs_hz=np.asarray(values["lcs_hz"], float),
                nlcs_hz=np.asarray(values["nlcs_hz"], float),
            )
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"a table of event rates is damaged: {error!r}; measure it again") from None
        shape = (len(table.resolutions), table.rows * table.columns)
        rates = (table.lcs_hz, table.nlcs_hz)
        if rates[0].shape != shape or rates[1].shape != (len(table.taus_s), *shape) or not table.taus_s:
            raise InputError("a table of event rates is damaged: its lists have the wrong lengths; measure it again")
        if not all(np.isfinite(r).all() and (r >= 0).all() for r in rates):
            raise InputError("a table of event rates is damaged: a rate is not a number from 0; measure it again")
        return table


_SCALARS: dict[str, type] = {"dataset": str, "preset": str, "images": int, "rows": int, "columns": int}


def _moments(rates: NDArray[np.float64]) -> FloatArray:
    """Return sum and sum of squares of rates over the taxels (last axis)."""
    return np.stack([rates.sum(-1), (rates**2).sum(-1)])


def _rounded(rates: NDArray[np.float64]) -> Any:
    if rates.ndim > 1:
        return [_rounded(row) for row in rates]
    return [int(value) if value.is_integer() else value for value in (float(f"{rate:.{_DIGITS}g}") for rate in rates)]


def load_tables(path: Path = STORED) -> tuple[RateTable, ...]:
    """Return the rate tables from a file."""
    remedy = "write one with python -m studies.event_rates"
    try:
        values = read_json(path, "the event rates")
    except InputError as error:
        raise InputError(f"{error}; {remedy}") from None
    if not isinstance(values, dict) or not isinstance(values.get("tables"), list):
        raise InputError(f"{path} holds no tables of event rates; {remedy}")
    return tuple(RateTable.from_dict(table) for table in values["tables"])


def stored_table(preset_name: str = "paper", dataset: str = "kylberg", path: Path = STORED) -> RateTable:
    """Return the rate table for a preset and dataset from a file."""
    tables = load_tables(path)
    for table in tables:
        if (table.preset, table.dataset) == (preset_name, dataset):
            return table
    found = ", ".join(f"{t.dataset} {t.preset}" for t in tables) or "nothing"
    raise InputError(f"{path} has no event rates of {dataset} {preset_name}, only of {found}")


def measure_table(
    dataset: Dataset,
    scan: Scan,
    base: ReadoutConfig | None = None,
    resolutions: Sequence[int] = RESOLUTIONS,
    taus_s: Sequence[float] = TAUS_S,
    pool: Pool | None = None,
    watch: Watch = unwatched,
) -> RateTable:
    """Return the event rates of every taxel for LCS and N-LCS, measured without contention.

    ``base``: array and sample rate; the default array by default.
    ``pool``: workers; this process by default.
    """
    base = base or ReadoutConfig()
    configs = [scan.configure(base.replace(encoding="lcs", resolution=n)) for n in resolutions]
    configs += [scan.configure(base.replace(encoding="nlcs", resolution=n), tau) for tau in taus_s for n in resolutions]
    groups: dict[float, list[int]] = {}  # by equal sample rate
    for i, config in enumerate(configs):
        groups.setdefault(config.sample_rate_hz, []).append(i)
    fine = [rate_hz for rate_hz in groups if rate_hz >= 2 * _HIGHEST_HZ]
    spectrum_rate_hz = min(fine) if fine else max(groups)

    rates, spectrum = np.zeros((len(configs), base.taxels)), np.zeros(_SPECTRUM_BINS)
    with watch("encoding textures", len(groups) * len(dataset)) as progress:
        # Images inside, sample rates outside: a scan keeps what it worked out for the last rates only.
        for rate_hz, members in groups.items():
            chosen, for_spectrum = [configs[i] for i in members], rate_hz == spectrum_rate_hz
            arguments = (scan, chosen, for_spectrum)
            for found, power in each_image(dataset, _measure, arguments, pool, progress):
                rates[members] += found
                spectrum += power
    rates /= len(dataset)
    total = np.cumsum(spectrum)
    lcs, nlcs = rates[: len(resolutions)], rates[len(resolutions) :]
    return RateTable(
        dataset=dataset.name,
        preset=scan.name,
        images=len(dataset),
        rows=base.rows,
        columns=base.columns,
        bandwidth_hz=float((np.searchsorted(total, POWER_SHARE * total[-1]) + 1) * _SPECTRUM_STEP_HZ),
        resolutions=tuple(resolutions),
        taus_s=tuple(taus_s),
        lcs_hz=lcs,
        nlcs_hz=nlcs.reshape(len(taus_s), len(resolutions), base.taxels),
    )


_SPECTRUM_BINS = 20_000
_SPECTRUM_STEP_HZ = 0.25


def _measure(
    image: Image, scan: Scan, configs: list[ReadoutConfig], want_spectrum: bool
) -> tuple[FloatArray, FloatArray | float]:
    """Return event rates and power spectrum of one image for configurations of one sample rate."""
    found = scan_image(image, scan, configs)
    power = _spectrum(found.signals, configs[0].sample_rate_hz) if want_spectrum else 0.0
    return found.counts / found.seconds, power


_HIGHEST_HZ = 2500.0  # no texture has power there, and slower samples would fold it down


def _spectrum(signals: FloatArray, sample_rate_hz: float) -> FloatArray:
    """Return the power spectrum of signals minus their mean, summed over taxels (Hann window)."""
    from scipy.signal import get_window

    window = get_window("hann", len(signals))[:, None]
    power = (np.abs(np.fft.rfft((signals - signals.mean(0)) * window, axis=0)) ** 2).sum(1)
    bins = np.minimum(
        (np.fft.rfftfreq(len(signals), 1 / sample_rate_hz) / _SPECTRUM_STEP_HZ).astype(int), _SPECTRUM_BINS - 1
    )
    # A sum of squares grows with the square of the sample rate times the duration.
    return np.bincount(bins, power, _SPECTRUM_BINS) / len(signals) ** 2
