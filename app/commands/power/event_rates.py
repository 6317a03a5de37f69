"""The command event-rates (docs/guide/power.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from eskin.app.commands.signals.options import LimitOption
from eskin.app.options import opt, out_file, with_config
from eskin.app.worker_options import Scheduler, Workers, open_pool
from eskin.base.progress import bar
from eskin.model.config import ReadoutConfig
from eskin.power.rates import measure_table, tables_text
from eskin.skin.textures.presets import preset


@with_config(fields=("rows", "columns"), file=False)
def event_rates(
    config: ReadoutConfig,
    out: Annotated[Path, out_file("FILE", "JSON file to write")],
    dataset: Annotated[
        list[str] | None, opt("DIR|embedded", "textures, repeatable [$ESKIN_DATA, data/kylberg, else embedded]")
    ] = None,
    preset_name: Annotated[str, opt("--preset", "paper|physical|both", "constants of the texture scan")] = "both",
    limit: LimitOption = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
) -> None:
    """Measure the event rate of every taxel at N = 1..10, for the power model."""
    from eskin.base.files import atomic_write
    from eskin.skin.textures.dataset import EMBEDDED, open_dataset

    presets = ("paper", "physical") if preset_name == "both" else (preset_name,)
    scans = [preset(name) for name in presets]
    tables = []
    places: list[str | None] = list(dataset or []) or [None]
    with open_pool(workers, scheduler, threads=True) as pool:
        for place in places:
            textures = open_dataset(place)
            textures = textures if limit is None else textures.limit(limit)
            for scan in scans:
                tables.append(measure_table(textures, scan, config, pool=pool, watch=bar))
                last = tables[-1]
                rate = last.population_hz("lcs", 6)
                print(
                    f"{last.dataset} {last.preset}: {last.images} images, {last.bandwidth_hz:g} Hz, "
                    f"LCS 6 b {rate:,.0f} events/s"
                )
    command = "eskin event-rates --out power/event_rates.json"
    for name in dict.fromkeys(table.dataset for table in tables):
        command += f" --dataset {name if name == EMBEDDED else f'data/{name}'}"
    with atomic_write(out) as file:
        file.write(tables_text(tables, command).encode())
