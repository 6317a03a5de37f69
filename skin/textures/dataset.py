"""Texture images with their classes, from class folders or embedded in scikit-image.

``open_dataset`` finds the images. A directory has one folder of 8-bit gray PNG files per class, as the Kylberg textures
do, and is checked if it has a SHA256SUMS file. Without a directory, the CC0 photographs of brick, grass and gravel in
scikit-image are cut into patches.
"""

from __future__ import annotations

import hashlib
import os
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.inputs import not_a_file
from eskin.skin.samples import content_of

EMBEDDED = "embedded"  # the name that stands for the embedded default, wherever a directory can be given
ENVIRONMENT_VARIABLE = "ESKIN_DATA"  # environment variable with the dataset directory, for commands without the option

SEARCHED = ("data/kylberg", "../shared/data/kylberg")
"""Directories searched last, relative to the repository root and to the working directory."""

SUMS_FILE = "SHA256SUMS"  # ``sha256sum`` output that lists every image of a directory as ``class/name.png``

EMBEDDED_SHA256 = {
    "brick": "7966caf324f6ba843118d98f7a07746d22f6a343430add0233eca5f6eaaa8fcf",
    "grass": "b6b6022426b38936c43a4ac09635cd78af074e90f42ffa8227ac8b7452d39f89",
    "gravel": "c48615b451bf1e606fbd72c0aa9f8cc0f068ab7111ef7d93bb9b0f2586440c12",
}
"""The CC0 photographs inside scikit-image, 512 x 512 pixels each, by class (see ``skimage.data.brick``)."""

PATCH_WIDTH_PX, PATCH_HEIGHT_PX = 256, 64
"""Size of an embedded patch: long enough to slide along, and two by eight of them fill a photograph."""


@dataclass(frozen=True)
class Texture:
    """One texture image with its class; pixels are loaded on demand."""

    name: str  # class and image, unique and stable, as ``brick/brick-00``
    class_name: str
    label: int  # index of the class in ``Dataset.class_names``
    path: Path  # PNG file of the image
    crop: tuple[int, int, int, int] | None = None
    """Part of the file in pixels (top, left, height, width); None for the whole image."""

    def load(self) -> NDArray[np.uint8]:
        """Return the pixels, uint8 of shape (height, width)."""
        pixels = read_gray_png(self.path)
        if self.crop is None:
            return pixels
        top, left, height, width = self.crop
        return pixels[top : top + height, left : left + width].copy()


@dataclass(frozen=True)
class Dataset(Sequence[Texture]):
    """Textures in a fixed order, sorted by class."""

    name: str  # ``embedded``, or the name of the directory
    class_names: tuple[str, ...]  # in alphabetical order; a label is an index into them
    textures: tuple[Texture, ...]

    def __len__(self) -> int:
        return len(self.textures)

    def __iter__(self) -> Iterator[Texture]:
        return iter(self.textures)

    def __getitem__(self, index):  # type: ignore[no-untyped-def]  # int or slice, as of a tuple
        return self.textures[index]

    @property
    def labels(self) -> NDArray[np.int64]:
        """Class index of every texture, shape (len(self),)."""
        return np.array([texture.label for texture in self.textures], np.int64)

    def limit(self, count: int | None) -> Dataset:
        """Return a dataset of at most ``count`` evenly spread textures, or all of them."""
        if count is not None and count < 1:
            raise InputError(f"the number of images must be at least 1, not {count}")
        if count is None or count >= len(self):
            return self
        chosen = tuple(self.textures[i * len(self) // count] for i in range(count))
        return Dataset(self.name, self.class_names, chosen)


def open_dataset(where: str | Path | None = None) -> Dataset:
    """Return the dataset at a path, or the first dataset found in the default places.

    ``where``: A directory, or ``embedded``. By default ``$ESKIN_DATA`` (a directory, or ``embedded``), else
    ``data/kylberg`` or ``../shared/data/kylberg`` if present, else the embedded default.
    Raise InputError if a directory that was named does not exist, or a directory is not a dataset.
    """
    named, what = str(where or ""), "dataset directory"
    if not named:
        named, what = os.environ.get(ENVIRONMENT_VARIABLE, ""), f"${ENVIRONMENT_VARIABLE}"
    if named == EMBEDDED:
        return embedded_dataset()
    if named:
        if not Path(named).is_dir():
            raise InputError(
                f"{what} {named} is not a directory; give a directory with a folder of PNG images per class, "
                f"or {EMBEDDED!r}"
            )
        return directory_dataset(Path(named))
    for base in (Path(__file__).resolve().parents[2], Path.cwd()):
        for place in SEARCHED:
            if (base / place).is_dir():
                return directory_dataset(base / place)
    return embedded_dataset()


def directory_dataset(root: Path) -> Dataset:
    """Return the dataset of a directory with a folder per class, checked if it has a SHA256SUMS file.

    With that file every listed image must be there with the right sum, and no class folder or image may be
    there that it does not list. Names that start with a dot are ignored.

    ``root``: directory with one folder of PNG files per class.
    """
    found: dict[str, list[str]] = {}
    for folder in sorted(path for path in root.iterdir() if path.is_dir() and not path.name.startswith(".")):
        images = [path for path in folder.iterdir() if path.suffix.lower() == ".png" and path.name[0] != "."]
        found[folder.name] = sorted(path.name for path in images)
        if odd := [f"{path} is {what}" for path in images if (what := not_a_file(path))]:
            raise InputError(f"image {min(odd)}; fetch or remove it")
    if not found:
        raise InputError(
            f"dataset directory {root} has no class folders; put the PNG images of each class into a folder"
        )
    if (root / SUMS_FILE).is_file():
        _verify(root, found)
    for class_name, names in found.items():
        if not names:
            raise InputError(f"class folder {root / class_name} has no PNG images; add some or remove it")
    textures = tuple(
        Texture(f"{class_name}/{Path(name).stem}", class_name, label, root.absolute() / class_name / name)
        for label, (class_name, names) in enumerate(found.items())
        for name in names
    )
    return Dataset(root.resolve().name, tuple(found), textures)


def _verify(root: Path, found: dict[str, list[str]]) -> None:
    listed = _read_sums(root / SUMS_FILE)
    classes = {name.split("/")[0] for name in listed}
    if unknown := [name for name in found if name not in classes]:
        raise InputError(
            f"unknown class folder {unknown[0]} in {root}: {SUMS_FILE} lists no image of this class; "
            f"remove the folder, or remove {SUMS_FILE} to use the directory unchecked"
        )
    present = {f"{class_name}/{name}" for class_name, names in found.items() for name in names}
    if extra := sorted(present - set(listed)):
        raise InputError(f"unknown image {extra[0]} in {root}: {SUMS_FILE} does not list it; remove it")
    for name, digest in listed.items():
        if name not in present:
            raise InputError(f"image {name} of {SUMS_FILE} is missing in {root}; copy the dataset again")
        if _sha256(root / name) != digest:
            raise InputError(f"image {name} in {root} has the wrong SHA-256 sum; copy the dataset again")


def _read_sums(path: Path) -> dict[str, str]:
    """Return the checksums in a SHA256SUMS file, keyed by ``class/name.png``."""
    listed = {}
    for number, line in enumerate(content_of(path, "the list").decode("utf-8", "replace").splitlines(), 1):
        if not line.strip():
            continue
        digest, _, name = line.partition(" ")
        name = name[1:]  # behind the blank or asterisk of text or binary mode
        parts = name.split("/")
        if len(digest) != 64 or len(parts) != 2 or not name.lower().endswith(".png") or parts[0] == "..":
            raise InputError(f"line {number} of {path} is not '<SHA-256 sum>  <class>/<name>.png': {line[:80]!r}")
        listed[name] = digest.lower()
    return listed


def _sha256(path: Path) -> str:
    return hashlib.sha256(content_of(path, "image")).hexdigest()


def read_gray_png(path: Path) -> NDArray[np.uint8]:
    """Return the pixels of an 8-bit gray PNG file, uint8 of shape (height, width).

    Colour, palette, 16-bit and two-channel images are refused, not converted: there are several ways to convert them,
    and the event rates depend on the choice.
    """
    from PIL import Image

    try:
        with Image.open(path, formats=("PNG",)) as image:
            image.load()
            mode, pixels = image.mode, np.asarray(image)
    except FileNotFoundError:
        raise InputError(f"image {path} does not exist; give a PNG file") from None
    except (OSError, SyntaxError, ValueError, struct.error, Image.DecompressionBombError) as error:
        raise InputError(f"image {path} is damaged or not a PNG file ({error}); copy it again") from None
    if mode != "L":
        raise InputError(f"image {path} must be 8-bit gray, not {mode}; convert it to 8-bit gray (mode L) first")
    return np.ascontiguousarray(pixels, np.uint8)


def embedded_dataset() -> Dataset:
    """Return the embedded dataset: 16 patches of scikit-image photographs for each of 3 classes.

    A patch is 256 pixels wide and 64 high; they do not overlap and are numbered row by row.
    """
    textures = []
    for label, class_name in enumerate(EMBEDDED_SHA256):
        path = _skimage_file(f"{class_name}.png", EMBEDDED_SHA256[class_name])
        height, width = read_gray_png(path).shape
        corners = [
            (top, left)
            for top in range(0, height - PATCH_HEIGHT_PX + 1, PATCH_HEIGHT_PX)
            for left in range(0, width - PATCH_WIDTH_PX + 1, PATCH_WIDTH_PX)
        ]
        for number, corner in enumerate(corners):
            name = f"{class_name}/{class_name}-{number:02d}"
            crop = (*corner, PATCH_HEIGHT_PX, PATCH_WIDTH_PX)
            textures.append(Texture(name, class_name, label, path, crop))
    return Dataset(EMBEDDED, tuple(EMBEDDED_SHA256), tuple(textures))


def _skimage_file(name: str, digest: str) -> Path:
    spec = find_spec("skimage")
    if spec is None or not spec.submodule_search_locations:
        raise InputError(
            "the embedded dataset needs scikit-image, which is not installed; install it or give --dataset DIR"
        )
    path = Path(spec.submodule_search_locations[0]) / "data" / name
    if not path.is_file() or _sha256(path) != digest:
        raise InputError(
            f"the installed scikit-image does not ship the expected data/{name}; "
            f"install the version in constraints.txt or give --dataset DIR"
        )
    return path
