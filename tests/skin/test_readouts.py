"""Test that every readout has a unique style in figures, with colours of one palette."""

import re

import pytest

from eskin.base.errors import InputError
from eskin.base.figures.style import PALETTE
from eskin.model.encoders import registry
from eskin.skin.figures.readouts import FRAME, LOOKS, look


def test_encoders_and_frames_have_looks_of_their_own() -> None:
    assert list(LOOKS) == [*registry.NAMES, FRAME]
    for value in ("title", "colour", "marker"):
        assert len({getattr(one, value) for one in LOOKS.values()}) == len(LOOKS)
    assert {one.colour for one in LOOKS.values()} <= set(PALETTE.values())


def test_an_unknown_readout_has_no_look() -> None:
    sentence = f"there is no encoder 'pcm'; the encoders are {', '.join(registry.NAMES)}"
    with pytest.raises(InputError, match=f"^{re.escape(sentence)}$"):
        look("pcm")
