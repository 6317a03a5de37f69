"""The tables of results in the documents, from the data: ``python -m docs.tables`` writes them.

A table stands between ``<!-- table NAME -->`` and ``<!-- end -->``, in any document and any number of times; NAME is
that of a function of a module here. Sentences that give results are made in ``docs.tables.claims``. Data:
``docs/data``, ``snn/figures`` and ``benchmarks/results``.
"""
