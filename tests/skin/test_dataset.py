"""Test the datasets: search places, checksums, and the embedded default."""

import hashlib
import io
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from eskin.base.errors import InputError
from eskin.skin.textures import dataset as module
from eskin.skin.textures.dataset import EMBEDDED, directory_dataset, embedded_dataset, open_dataset, read_gray_png


def pixels(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (40, 50), np.uint8)


def other_image(root: Path, name: str) -> None:
    (root / name).parent.mkdir(exist_ok=True)
    Image.fromarray(pixels(9)).save(root / name)


def write_sums(root: Path) -> None:
    lines = [
        f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(root).as_posix()}\n"
        for path in sorted(root.glob("*/*.png"))
    ]
    (root / "SHA256SUMS").write_text("".join(lines))


@pytest.fixture
def textures(tmp_path: Path) -> Path:
    """Return a folder with two classes of two images, with checksums."""
    root = tmp_path / "cloth"
    for number, name in enumerate(("silk/silk-2", "silk/silk-1", "felt/felt-1", "felt/felt-2")):
        path = root / f"{name}.png"
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(pixels(number)).save(path)
    write_sums(root)
    return root


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty repository root, with an empty working directory and no variable set."""
    monkeypatch.delenv("ESKIN_DATA", raising=False)
    (tmp_path / "work" / "here").mkdir(parents=True)
    (tmp_path / "repo" / "model").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "work" / "here")
    monkeypatch.setattr(module, "__file__", str(tmp_path / "repo" / "model" / "textures" / "dataset.py"))
    return tmp_path / "repo"


def test_directory_gives_classes_and_images_in_alphabetical_order(textures):
    data = open_dataset(textures)
    assert data.name == "cloth"
    assert data.class_names == ("felt", "silk")
    assert [t.name for t in data] == ["felt/felt-1", "felt/felt-2", "silk/silk-1", "silk/silk-2"]
    assert [t.class_name for t in data] == ["felt", "felt", "silk", "silk"]
    assert data.labels.tolist() == [0, 0, 1, 1]
    image = data[3].load()
    assert image.dtype == np.uint8
    np.testing.assert_array_equal(image, pixels(0))


def test_only_listed_images_are_read_and_all_without_sums(textures):
    """Sums may be in binary mode and in capitals; hidden files do not count; without sums everything else does."""
    sums = (textures / "SHA256SUMS").read_text()
    (textures / "SHA256SUMS").write_text("\n" + sums.replace("  ", " *").upper().replace(".PNG", ".png").lower())
    (textures / ".cache").mkdir()
    (textures / "silk" / ".silk-3.png").write_bytes(b"")
    (textures / "silk" / "readme.txt").write_text("silk")
    assert len(directory_dataset(textures)) == 4
    (textures / "SHA256SUMS").unlink()
    other_image(textures, "wool/w.PNG")
    assert directory_dataset(textures).class_names == ("felt", "silk", "wool")


@pytest.mark.parametrize(
    "line", ["garbage", "0" * 64, "0" * 64 + "  ../felt.png", "0" * 63 + "  a/b.png", "0" * 64 + "  a/b/c.png"]
)
def test_sums_file_that_is_none_is_refused(textures, line):
    with (textures / "SHA256SUMS").open("a") as file:
        file.write(line + "\n")
    with pytest.raises(InputError, match=r"^line 5 of .*SHA256SUMS is not '<SHA-256 sum>  <class>/<name>\.png': '"):
        open_dataset(textures)


WRONG: dict[str, tuple[Callable[[Path], Any], str]] = {
    "no folder": (
        shutil.rmtree,
        r"dataset directory .*/cloth is not a directory; give a directory with a folder of PNG images per class, "
        r"or 'embedded'",
    ),
    "no class": (
        lambda root: [shutil.rmtree(root / name) for name in ("silk", "felt")],
        r"dataset directory .*/cloth has no class folders; put the PNG images of each class into a folder",
    ),
    "no image": (
        lambda root: [(root / "SHA256SUMS").unlink(), (root / "wool").mkdir()],
        r"class folder .*/wool has no PNG images; add some or remove it",
    ),
    "a class too many": (
        lambda root: (root / "wool").mkdir(),
        r"unknown class folder wool in .*/cloth: SHA256SUMS lists no image of this class; "
        r"remove the folder, or remove SHA256SUMS to use the directory unchecked",
    ),
    "an image too many": (
        lambda root: other_image(root, "silk/silk-9.png"),
        r"unknown image silk/silk-9\.png in .*: SHA256SUMS does not list it; remove it",
    ),
    "a class too few": (
        lambda root: shutil.rmtree(root / "felt"),
        r"image felt/felt-1\.png of SHA256SUMS is missing in .*; copy the dataset again",
    ),
    "an image too few": (
        lambda root: (root / "felt" / "felt-1.png").unlink(),
        r"image felt/felt-1\.png of SHA256SUMS is missing in .*; copy the dataset again",
    ),
    "another image": (
        lambda root: other_image(root, "felt/felt-2.png"),
        r"image felt/felt-2\.png in .* has the wrong SHA-256 sum; copy the dataset again",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_directory_that_is_no_dataset_is_refused(textures, what):
    spoil, sentence = WRONG[what]
    spoil(textures)
    with pytest.raises(InputError, match=f"^{sentence}$"):
        open_dataset(textures)


def image_of(mode: str) -> bytes:
    data = io.BytesIO()
    Image.new(mode, (20, 20)).save(data, "png")
    return data.getvalue()


NO_GRAY_PNG = {
    "empty": (b"", r"is damaged or not a PNG file \(.*\); copy it again"),
    "head only": (b"\x89PNG\r\n\x1a\n" + bytes(99), r"is damaged or not a PNG file \(.*\); copy it again"),
    "cut": (image_of("L")[:-30], r"is damaged or not a PNG file \(.*\); copy it again"),
    "missing": (None, "does not exist; give a PNG file"),
} | {
    mode: (image_of(mode), rf"must be 8-bit gray, not {mode}; convert it to 8-bit gray \(mode L\) first")
    for mode in ("RGB", "P", "I;16")
}


@pytest.mark.parametrize("what", NO_GRAY_PNG)
def test_a_file_that_is_no_gray_png_is_refused(tmp_path, what):
    content, sentence = NO_GRAY_PNG[what]
    if content is not None:
        (tmp_path / "x.png").write_bytes(content)
    with pytest.raises(InputError, match=rf"^image .*x\.png {sentence}$"):
        read_gray_png(tmp_path / "x.png")


@pytest.mark.parametrize("place", ["data/kylberg", "../shared/data/kylberg"])
@pytest.mark.parametrize("base", ["repo", "work"])
def test_data_is_found_beside_the_repository_and_the_working_directory(nowhere, textures, place, base):
    root = nowhere if base == "repo" else Path.cwd()
    shutil.copytree(textures, root / place)
    assert open_dataset().class_names == ("felt", "silk")
    assert open_dataset().name == "kylberg"


def test_order_is_argument_then_variable_then_places_then_embedded(nowhere, textures, tmp_path, monkeypatch):
    assert open_dataset().name == "embedded"
    for place in (nowhere / "data" / "kylberg", tmp_path / "variable", tmp_path / "argument"):
        shutil.copytree(textures, place)
    assert open_dataset().name == "kylberg"
    monkeypatch.setenv("ESKIN_DATA", str(tmp_path / "variable"))
    assert open_dataset().name == "variable"
    assert open_dataset(str(tmp_path / "argument")).name == "argument"
    monkeypatch.setenv("ESKIN_DATA", "")
    assert open_dataset().name == "kylberg"
    monkeypatch.setenv("ESKIN_DATA", "gone")
    with pytest.raises(InputError, match=r"^\$ESKIN_DATA gone is not a directory; give a directory with a folder"):
        open_dataset()


def test_embedded_can_be_forced(nowhere, textures, monkeypatch):
    shutil.copytree(textures, nowhere / "data" / "kylberg")
    assert open_dataset(EMBEDDED).name == "embedded"
    monkeypatch.setenv("ESKIN_DATA", EMBEDDED)
    assert open_dataset().name == "embedded"


def test_embedded_has_48_patches_of_3_classes_that_tile_their_photographs():
    data = embedded_dataset()
    assert data.class_names == ("brick", "grass", "gravel")
    assert np.bincount(data.labels).tolist() == [16, 16, 16]
    assert [t.name for t in data[15:18]] == ["brick/brick-15", "grass/grass-00", "grass/grass-01"]
    images = [texture.load() for texture in data]
    assert {(image.shape, image.dtype) for image in images} == {((64, 256), np.dtype(np.uint8))}
    assert len({image.tobytes() for image in images}) == 48
    for first in (0, 16, 32):
        photograph = np.block([images[first + 2 * row : first + 2 * row + 2] for row in range(8)])
        np.testing.assert_array_equal(photograph, read_gray_png(data[first].path))


def test_embedded_needs_neither_network_nor_the_skimage_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    loaded = sys.modules.pop("skimage", None)
    embedded_dataset()
    assert "skimage" not in sys.modules
    if loaded is not None:
        sys.modules["skimage"] = loaded


def test_embedded_needs_the_photographs_of_scikit_image(monkeypatch):
    monkeypatch.setitem(module.EMBEDDED_SHA256, "grass", "0" * 64)
    sentence = (
        r"the installed scikit-image does not ship the expected data/grass\.png; install the version in .* or give"
    )
    with pytest.raises(InputError, match=f"^{sentence} --dataset DIR$"):
        embedded_dataset()
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    sentence = "the embedded dataset needs scikit-image, which is not installed; install it or give --dataset DIR"
    with pytest.raises(InputError, match=f"^{sentence}$"):
        embedded_dataset()


@pytest.mark.parametrize(
    ("count", "classes"), [(3, [1, 1, 1]), (6, [2, 2, 2]), (47, None), (48, [16] * 3), (99, [16] * 3)]
)
def test_limit_spreads_over_the_classes(count, classes):
    data = embedded_dataset().limit(count)
    assert len(data) == min(count, 48)
    assert len({t.name for t in data}) == len(data)
    assert data.class_names == ("brick", "grass", "gravel")
    if classes:
        assert np.bincount(data.labels).tolist() == classes
    with pytest.raises(InputError, match=r"^the number of images must be at least 1, not 0$"):
        data.limit(0)


def test_kylberg_is_complete_where_it_is_there():
    data = open_dataset()
    if data.name != "kylberg":
        pytest.skip("the Kylberg images are not here")
    assert data.class_names == ("canvas1", "cushion1", "linsseeds1", "sand1", "seat2", "stone1")
    assert np.bincount(data.labels).tolist() == [40] * 6
    assert data[0].load().shape == (576, 576)
