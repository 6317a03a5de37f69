"""Event rates: the rate of every taxel at N = 1..10, for the power model.

Copy the written ``taxel_rates.json`` to ``power/event_rates.json``, or give it to ``eskin power --rates``. The textures
are those of ``$ESKIN_DATA`` or ``data/kylberg``, and the embedded ones.
"""

import json
import re
from pathlib import Path

from eskin.base.files import atomic_write
from eskin.base.progress import bar
from eskin.base.workers.engine import Needs, Pool
from eskin.power.rates import measure_table
from eskin.skin.textures.dataset import EMBEDDED, open_dataset
from eskin.skin.textures.presets import PRESETS
from studies.study import Data, Result, run


def compute(pool: Pool) -> Data:
    """Return a table of rates for every dataset and preset."""
    datasets = {dataset.name: dataset for dataset in (open_dataset(None), open_dataset(EMBEDDED))}
    tables = [
        measure_table(textures, scan, pool=pool, watch=bar).to_dict()
        for textures in datasets.values()
        for scan in PRESETS.values()
    ]
    return {"unit": "events/s of every taxel, mean over the images", "tables": tables}


def write(path: Path, data: Data) -> None:
    """Write the tables as JSON, with one list of taxels per line."""
    text = json.dumps(data, indent=1)
    with atomic_write(path) as file:
        file.write((re.sub(r"\[[^][{}]+\]", lambda found: json.dumps(json.loads(found[0])), text) + "\n").encode())


RESULT = Result("taxel_rates", compute, long=True, write=write, needs=Needs(), threads=True)

if __name__ == "__main__":
    run("event_rates", RESULT)
