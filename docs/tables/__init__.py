"""Tables and sentences of results, which cog inserts into the pages.

``make docs`` writes every page anew; a test runs ``cog --check``. Data: ``docs/data``,
``benchmarks/results``. A page has the titles and formats of a table or sentence; the functions here return its rows or
values, or print whole tables whose columns depend on the data.
"""

# ruff: noqa: F403
from docs.tables.accuracy import *
from docs.tables.analog import *
from docs.tables.biotac import *
from docs.tables.claims import *
from docs.tables.energy import *
from docs.tables.finger import *
from docs.tables.frontier import *
from docs.tables.generated import *
from docs.tables.netlists import *
from docs.tables.power import *
from docs.tables.speed import *
from docs.tables.tasks import *
from docs.tables.verification import *
from docs.tables.write import *
