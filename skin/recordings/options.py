"""Options for reading and scaling recordings."""

import dataclasses
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from eskin.base.configuration import Configuration, option_of, parameter
from eskin.base.errors import InputError

Decimal = Literal["auto", "point", "comma"]
TimeUnit = Literal["auto", "s", "ms", "us", "ns"]
LabelOf = Literal["last", "most"]
Baseline = Literal["none", "fixed", "first", "median", "highpass"]
GUIDE = "docs/guide/recordings.md"
PER_TAXEL = "per-taxel"  # text of ``Preparation.scale`` that maps the largest magnitude of each taxel to full scale

Scale = float | tuple[float, ...]
"""Factor from the unit of the files to full scale, common to all taxels or one for each taxel."""

MAX_LINES, MAX_WINDOW_S = 10**6, 1e6

FINGER = Path(__file__).parent / "finger"
"""Recordings that come with the project: a robot finger slides over four fabrics."""


@dataclass(frozen=True, kw_only=True)
class Preparation(Configuration):
    """Options for all steps from sensor files to codes; numbers of columns count from 1."""

    taxel_columns: str = parameter("", "", GUIDE, "taxel columns of the file, such as 2-17 or s1,s2 [all]")
    delimiter: str = parameter("", "", GUIDE, "delimiter of a text: a character, tab or space [detected]")
    decimal: Decimal = parameter("auto", "", GUIDE, "decimal point or comma of a text")
    skip_lines: int = parameter(0, "", GUIDE, "lines of a text before the table")
    frame_lines: int = parameter(0, "", GUIDE, "lines of a text for each sample [detected]")
    topic: str = parameter("", "", GUIDE, "topic of a ROS bag or MCAP file")
    field: str = parameter("", "", GUIDE, "array, variable, sheet or message field with the samples")
    label_column: str = parameter("", "", GUIDE, "column with the class of each sample, by name or number")
    group_column: str = parameter("", "", GUIDE, "column with the group of each sample, such as a subject")
    group_name: str = parameter(
        "", "", GUIDE, "regular expression; recordings with the same match in the name are a group"
    )
    window_s: float = parameter(0.0, "s", GUIDE, "length of windows that each get a class from --label-column")
    hop_s: float = parameter(0.0, "s", GUIDE, "time from a window to the next [half a window]")
    guard_s: float = parameter(0.0, "s", GUIDE, "windows that end this close to a change of the label are left out")
    label_of: LabelOf = parameter("last", "", GUIDE, "class of a window: of its last sample, or of most samples")
    time_column: str = parameter("", "", GUIDE, "column of time stamps, by name or number, or none [detected]")
    time_unit: TimeUnit = parameter("auto", "", GUIDE, "unit of the time stamps")
    baseline: Baseline = parameter("none", "", GUIDE, "value subtracted from every taxel")
    """A constant for each taxel (``offsets``), the first value, the median, or everything below ``highpass_hz``."""
    highpass_hz: float = parameter(0.1, "Hz", GUIDE, "corner of --baseline highpass")
    strict: bool = parameter(False, "", GUIDE, "refuse broken links, FIFOs and folders among the recordings")
    offsets: tuple[float, ...] = ()
    """The constants of the baseline ``fixed``; empty: ``prepare`` learns them from the recordings."""
    gains: tuple[float, ...] = ()
    """A training also uses each recording at these gains, as a lighter or firmer touch gives it (``at_gain``)."""
    names: tuple[str, ...] = ()
    """Names of the taxels' columns in the order of the array; files that have names are brought into this order."""
    scale: str = parameter("max", "", GUIDE, "factor to full scale, max, per-taxel, or a percentile such as p99.9")
    """One factor, or one for each taxel as ``0.5,2``. A percentile is that of the magnitudes of all recordings."""

    def __post_init__(self) -> None:
        self._check_types(but=("names", "offsets", "gains"))
        for name in ("skip_lines", "frame_lines"):
            self._check_range(name, 0, MAX_LINES)
        if len(self.delimiter) > 1 and self.delimiter not in ("tab", "space"):
            raise InputError(f"--delimiter is one character, tab or space, not {self.delimiter!r}")
        if not (math.isfinite(self.highpass_hz) and self.highpass_hz > 0):
            raise InputError(f"--highpass must be a positive number of hertz, not {self.highpass_hz!r}")
        for name in ("window_s", "hop_s", "guard_s"):
            value, option = getattr(self, name), name.removesuffix("_s")
            if not 0 <= value <= MAX_WINDOW_S:
                raise InputError(f"--{option} must be in 0..{MAX_WINDOW_S:g} seconds, not {value:g}")
            if value and not self.window_s:
                raise InputError(f"--{option} needs windows; add --window SECONDS")
        if self.window_s and not self.hop_s:
            object.__setattr__(self, "hop_s", self.window_s / 2)
        self.percentile()
        try:
            re.compile(self.group_name)
        except re.error as error:
            raise InputError(f"--group-name needs a regular expression, not {self.group_name!r}: {error}") from None
        if not all(isinstance(name, str) for name in self.names):
            raise InputError(f"the names of columns must be texts, not {self.names!r}")
        object.__setattr__(self, "names", tuple(self.names))
        if not all(isinstance(offset, int | float) and math.isfinite(offset) for offset in self.offsets):
            raise InputError(f"the offsets of the taxels must be finite numbers, not {self.offsets!r}")
        object.__setattr__(self, "offsets", tuple(map(float, self.offsets)))
        if not all(isinstance(gain, int | float) and 0 < gain < math.inf for gain in self.gains):
            raise InputError(f"--gains needs positive numbers such as 0.7,1.4, not {self.gains!r}")
        object.__setattr__(self, "gains", tuple(map(float, self.gains)))

    def _label(self, name: str) -> str:
        return option_of(type(self).__dataclass_fields__[name])

    def chosen(self) -> dict[str, Any]:
        """Return the fields with non-default values, except the scale."""
        return {
            field.name: getattr(self, field.name)
            for field in dataclasses.fields(self)
            if field.name not in ("scale", "strict") and getattr(self, field.name) != field.default
        }

    @property
    def splits(self) -> bool:
        """Whether a file becomes several recordings."""
        return bool(self.label_column or self.group_column or self.window_s)

    def percentile(self) -> float | None:
        """Return the percentile of the magnitudes that maps to full scale; None for fixed factors."""
        if self.scale in ("max", PER_TAXEL):
            return 100.0
        text = self.scale.removeprefix("p")
        if text != self.scale:
            number = _number(text)
            if not 0 < number <= 100:
                raise InputError(
                    f"--scale needs a percentile such as p99.9, above p0 and up to p100, not {self.scale!r}"
                )
            return number
        if not all(math.isfinite(number) and number != 0 for number in map(_number, text.split(","))):
            raise InputError(
                f"--scale needs a number other than 0, a number for each taxel such as 0.5,2, max, {PER_TAXEL}, or a "
                f"percentile such as p99.9, not {self.scale!r}"
            )
        return None

    def factors(self) -> Scale:
        """Return the fixed factors to full scale; only valid if ``percentile`` is None."""
        numbers = tuple(map(float, self.scale.split(",")))
        return numbers if len(numbers) > 1 else numbers[0]


def scale_option(scale: Scale) -> str:
    """Return the text of ``Preparation.scale`` for fixed factors."""
    return ",".join(map(repr, scale)) if isinstance(scale, tuple) else repr(scale)


def _number(text: str) -> float:
    """Return the number in a text, or NaN."""
    try:
        return float(text)
    except ValueError:
        return math.nan
