"""``python -m docs.tables``: write every table anew."""

from __future__ import annotations

from docs.tables import accuracy, classifier, merits, mutants, netlists, power, rates, speed, verification
from docs.tables.written import PAGES, ROOT, filled

MODULES = (rates, accuracy, merits, power, netlists, speed, classifier, verification, mutants)
"""Each registers its tables when it is imported."""

if __name__ == "__main__":
    for page in PAGES:
        text = page.read_text()
        if (new := filled(text)) != text:
            page.write_text(new)
            print(page.relative_to(ROOT))
