"""Check that input is refused with exactly one sentence."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from eskin.base.errors import InputError


@contextmanager
def refused(sentence: str) -> Iterator[None]:
    with pytest.raises(InputError) as error:
        yield
    assert str(error.value) == sentence
