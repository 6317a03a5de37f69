"""Write docs/reference/registers.md from the description of the registers: ``python docs/registers.py``."""

from __future__ import annotations

from pathlib import Path

from model.config import ReadoutConfig
from model.registers.export import page_of_all

PAGE = Path(__file__).parent / "reference" / "registers.md"


def page() -> str:
    """Return the text of the page: every register that some encoder has, the values those of the default array."""
    return page_of_all(ReadoutConfig(registers="spi"))


if __name__ == "__main__":
    PAGE.write_text(page())
