"""Inputs of ``sim`` and ``replay``: scans of textures, or recordings of a user."""

import functools
import hashlib
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from eskin import cocotb_tests, model, skin
from eskin.base.errors import InputError
from eskin.cocotb_tests.bench.textures import large_enough
from eskin.cocotb_tests.runner.build_cache import sources
from eskin.cocotb_tests.runner.reproduce import own_options
from eskin.cocotb_tests.runner.simulator import Build
from eskin.model.config import ReadoutConfig
from eskin.skin.recordings.folder import RecordingSet
from eskin.skin.textures.dataset import EMBEDDED, Dataset, Texture


@dataclass(frozen=True)
class Textures:
    """Scans of textures as inputs."""

    data: Dataset
    place: str | None = None  # path of the dataset, as typed by the user
    preset: str = "physical"
    start_row: float = 0.0

    @property
    def name(self) -> str:
        """Name of the dataset."""
        return self.data.name

    @property
    def names(self) -> list[str]:
        """Names of all textures."""
        return [texture.name for texture in self.data]

    @property
    def repeat_options(self) -> list[str]:
        """Options of replay that select these textures."""
        place = shlex.quote(self.place or self.name)
        return [
            f"--preset {self.preset}",
            *[f"--start-row {self.start_row}"] * bool(self.start_row),
            f"--dataset {place}",
        ]

    def texture(self, name: str) -> Texture:
        """Return a texture by name."""
        return next(texture for texture in self.data if texture.name == name)

    def array(self, name: str, config: ReadoutConfig) -> NDArray[Any]:
        """Return an image; embedded images are repeated for large arrays."""
        image = self.texture(name).load()
        return large_enough(image, config) if self.name == EMBEDDED else image

    def said(self, names: Sequence[str]) -> dict[str, dict[str, Any]]:
        """Return class and label of each texture."""
        found = map(self.texture, names)
        return {texture.name: {"class": texture.class_name, "label": texture.label} for texture in found}

    def proof(self, name: str, program: Build) -> str:
        """Return the digest stored in the event file of a texture."""
        return _proof(program, self.start_row, self.texture(name).load())


@dataclass(frozen=True)
class Own:
    """Recordings of a user as inputs."""

    recordings: RecordingSet
    place: Path  # path of their folder, as typed by the user
    preset: str = ""
    start_row: float = 0.0

    @property
    def name(self) -> str:
        """Name of the folder."""
        return self.recordings.name

    @property
    def names(self) -> list[str]:
        """Names of all recordings."""
        return [source.name for source in self.recordings.sources]

    @property
    def repeat_options(self) -> list[str]:
        """Options that select these recordings."""
        place = shlex.quote(str(self.place))
        return [f"--data {place}", *own_options(self.recordings.options, self.recordings.scale)]

    def one_class_after_the_other(self, count: int) -> list[str]:
        """Return the names of recordings in an order that alternates between classes."""
        rank: dict[str | None, int] = {}
        order = []
        for source in self.recordings.sources:
            rank[source.class_name] = rank.get(source.class_name, -1) + 1
            order.append((rank[source.class_name], source.name))
        return [name for _, name in sorted(order)[:count]]

    def array(self, name: str, config: ReadoutConfig) -> NDArray[Any]:
        """Return the codes of a recording."""
        return self.recordings.codes[self.names.index(name)]

    def said(self, names: Sequence[str]) -> dict[str, dict[str, Any]]:
        """Return class and preparation of each recording."""
        by_name = {source.name: source for source in self.recordings.sources}
        return {name: self.recordings.said_of(by_name[name]) for name in names}

    def proof(self, name: str, program: Build) -> str:
        """Return the digest stored in the event file of a recording."""
        return _proof(program, self.start_row, self.recordings.codes[self.names.index(name)])


Inputs = Textures | Own


# -- what of it is played ----------------------------------------------------------------------------


def named(material: Inputs, name: str) -> str:
    """Return a name after checking that the inputs contain it."""
    if name not in material.names:
        whose, what = (f"dataset {material.name}", "texture") if material.preset else (material.name, "recording")
        raise InputError(f"{whose} has no {what} {name!r}; one of them is {material.names[0]}")
    return name


def chosen(
    material: Inputs, limit: int | None = None, only: str | None = None, names: list[str] | None = None
) -> list[str]:
    """Return ``limit`` of the names, evenly spread, or the name ``only``, or all names.

    ``names`` are by default those of all items.
    """
    if only is not None:
        return [named(material, only)]
    names = material.names if names is None else names
    if limit is not None and limit < 1:
        raise InputError(
            f"the number of {'images' if material.preset else 'recordings'} must be at least 1, not {limit}"
        )
    if limit is None or limit >= len(names):
        return names
    return [names[k * len(names) // limit] for k in range(limit)]


# -- proofs ------------------------------------------------------------------------------------------

SOURCES = ((model, "**/*.py"), (skin, "textures/*.py"), (cocotb_tests, "bench/*.py"))
"""Sources of samples, stimulus, expected events, and of the bench that compares them."""


def _proof(program: Build, start_row: float, array: NDArray[Any]) -> str:
    """Return a digest of simulation program, sources, and image or samples."""
    digest = hashlib.sha256(f"{program.folder.name} {start_row} {_sources()}".encode())
    digest.update(array.tobytes())
    return digest.hexdigest()


@functools.cache
def _sources() -> str:
    return sources(SOURCES)
