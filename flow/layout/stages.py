"""Cache the stages of a long run, each in a folder that is valid until its inputs change."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

from eskin.base.cache import is_private
from eskin.base.files import digest, make_folder
from eskin.base.progress import processor_s


class Stages:
    """Folders of the stages of a run; ``seconds`` has the processor time of each stage, also of cached stages."""

    def __init__(self, folder: Path, on_stage: Callable[[str], None]) -> None:
        self.folder = folder
        self.on_stage = on_stage
        self.seconds: dict[str, float] = {}

    def made(self, stage: str, inputs: tuple[str, ...], make: Callable[[Path], None]) -> Path:
        """Return the folder of a stage; call ``make`` unless the folder is cached for these inputs.

        The folder gets its name when complete: an interrupted stage begins anew. Folders of other inputs are removed.
        """
        whole = self.folder / f"{stage}-{digest(inputs)}"
        time_file = whole / "seconds.json"
        if is_private(whole) and time_file.is_file():  # it holds programs and decks, which are run
            self.on_stage(f"{stage}: kept from an earlier run")
        else:
            self.on_stage(stage)
            part = make_folder(self.folder, f".{stage}.part", empty=True)
            start = processor_s()
            make(part)
            (part / time_file.name).write_text(json.dumps(round(processor_s() - start, 1)))
            for old in self.folder.glob(f"{stage}-*"):
                shutil.rmtree(old)
            part.chmod(0o700)
            part.rename(whole)
        self.seconds[stage] = json.loads(time_file.read_text())
        return whole
