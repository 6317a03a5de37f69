"""Build the power model from command-line options."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from eskin.base.errors import InputError
from eskin.power.parameters import PowerParameters
from eskin.skin.textures.rates import Watch, unwatched

if TYPE_CHECKING:
    from eskin.power.equations import PowerModel, RateSource
    from eskin.power.rates import RateTable


MEASURED = frozenset({"event_rates", "bandwidth"})
"""Corrections that need measured event rates."""


def chosen_corrections(mode: str | None, correct: str | None, without: str | None) -> frozenset[str]:
    """Return the corrections that the options choose.

    Without a list, mode ``consistent`` has all corrections, and mode ``paper`` has none.
    """
    from eskin.power.equations import CORRECTIONS, PowerMode, check_corrections

    if mode is not None and mode not in get_args(PowerMode):
        raise InputError(f"mode must be one of {', '.join(get_args(PowerMode))}, not {mode!r}")
    if correct is not None and without is not None:
        raise InputError(
            "--correct lists the corrections to make, --without the corrections to leave out; give only one of the two"
        )
    if correct is None and without is None:
        return frozenset(CORRECTIONS if mode == "consistent" else ())
    if mode == "paper":
        raise InputError("mode paper has no corrections; leave out --mode or --correct and --without")
    if correct is not None and mode is not None:
        raise InputError(f"--correct lists all corrections to make, so that --mode {mode} has no effect; leave it out")
    named = check_corrections(name.strip() for name in (correct or without or "").split(",") if name.strip())
    return named if correct is not None else frozenset(CORRECTIONS) - named


def rate_table(
    dataset: str | None,
    preset_name: str,
    rates: Path | None,
    resolutions: Sequence[int],
    taus_s: Sequence[float],
    array: tuple[int, int] = (8, 8),
    watch: Watch = unwatched,
) -> RateTable:
    """Return event rates measured on a dataset, read from a file, or stored in the project."""
    from eskin.power.rates import STORED, load_tables, measure_table, stored_table
    from eskin.skin.textures.presets import preset

    scan = preset(preset_name)
    if dataset is not None and rates is not None:
        raise InputError("--dataset measures event rates, --rates reads them from a file; give one of them")
    if dataset is not None:
        from eskin.model.config import ReadoutConfig
        from eskin.skin.textures.dataset import open_dataset

        base = ReadoutConfig(rows=array[0], columns=array[1])
        return measure_table(open_dataset(dataset), scan, base, resolutions, taus_s, watch=watch)
    if rates is None:
        return stored_table(scan.name, path=STORED)
    tables = [table for table in load_tables(rates) if table.preset == scan.name]
    if not tables:
        raise InputError(f"{rates} has no event rates of preset {scan.name}; measure them or choose another --preset")
    return tables[0]


def build_model(
    corrections: frozenset[str],
    settings: Sequence[str] | None,
    synthesis: Sequence[Path] | None,
    source: Callable[[], RateSource],
    sensor: PowerParameters | None = None,
) -> PowerModel:
    """Return the power model for given corrections and settings.

    ``settings``: ``NAME=NUMBER`` each.
    ``synthesis``: reports of the digital parts.
    ``source``: returns the event rates; called only if a correction needs them.
    ``sensor``: another sensor than the published one; its bandwidth is that of the rates, unless a setting gives it.
    """
    from eskin.power.equations import PowerModel
    from eskin.power.rates import RateTable
    from eskin.power.synthesis import load_reports

    settings = settings or []
    parameters = (sensor or PowerParameters()).with_settings(settings)
    if synthesis and "digital" not in corrections:
        raise InputError("--synthesis needs the correction digital; add --mode consistent or --correct digital")
    gates = load_reports(list(synthesis or []))
    measured = None
    if corrections & MEASURED:
        measured = source()
        if isinstance(measured, RateTable):
            published = sensor is None and (measured.dataset, measured.preset) == ("kylberg", "paper")
            if not published and not any(setting.startswith("signal_bandwidth_hz=") for setting in settings):
                parameters = parameters.replace(signal_bandwidth_hz=measured.bandwidth_hz)
    return PowerModel(parameters=parameters, corrections=corrections, measured=measured, gates=gates)
