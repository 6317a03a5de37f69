"""The register page from the register description, and the fields of the classifier."""

import dataclasses

from docs.tables.write import Rows
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.registers.export import page_of_all


def registers() -> None:
    """Print every register that any encoder has, with the values for the default array."""
    print(f"\n{page_of_all(ReadoutConfig(registers='spi'))}")


def classifier_fields() -> Rows:
    """Yield every field of the classifier's configuration."""
    for field in dataclasses.fields(ClassifierConfig):
        unit = f" ({field.metadata['unit']})" if field.metadata["unit"] else ""
        default = "none" if field.default is None else str(field.default)
        yield [f"`{field.name}`", default, field.metadata["meaning"] + unit]
