"""The register page from the register description, and the groups of packages."""

import re
from pathlib import Path

from docs.tables.write import Rows
from eskin.app.setup import BASE, SIZES
from eskin.base.packages import GAPS
from eskin.model.config import ReadoutConfig
from eskin.model.registers.export import page_of_all


def registers() -> None:
    """Print every register that any encoder has, with the values for the default array."""
    print(f"\n{page_of_all(ReadoutConfig(registers='spi'))}")


def package_groups() -> Rows:
    """Yield every group of packages with the comment above it in pyproject.toml, and its size."""
    text = Path("pyproject.toml").read_text()
    for group, megabytes in SIZES.items():
        name = "dependencies" if group == BASE else group
        (purpose,) = re.findall(rf"^# (.*)\n{name} = \[$", text, re.MULTILINE)
        yield [f"`{group}`", purpose, str(megabytes)]


def package_gaps() -> Rows:
    """Yield every package that has no wheel for a platform, with the remedy."""
    for gap in GAPS:
        yield [f"`{gap.package}`", gap.platform, gap.remedy]
