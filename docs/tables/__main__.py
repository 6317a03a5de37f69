"""``python -m docs.tables``: write every table anew, and the numbers of every claim."""

from __future__ import annotations

from importlib import import_module
from pkgutil import walk_packages

import docs.tables
from docs.tables.claims import mended
from docs.tables.written import PAGES, ROOT, filled

for module in walk_packages(docs.tables.__path__, "docs.tables."):
    if not module.name.endswith("__main__"):
        import_module(module.name)  # registers its tables and claims

if __name__ == "__main__":
    for page in PAGES:
        text = page.read_text()
        if (new := mended(str(page.relative_to(ROOT)), filled(text))) != text:
            page.write_text(new)
            print(page.relative_to(ROOT))
