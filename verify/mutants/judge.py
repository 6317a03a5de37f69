"""Determine the verdict of a mutant: killed, equivalent, rejected by the generator, or surviving."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eskin.cocotb_tests.runner.build_cache import scratch_folder
from eskin.verify.mutants.checkout import failed_property, first_failed, mutated, run
from eskin.verify.mutants.configs import COUNT
from eskin.verify.mutants.edits import Mutant
from eskin.verify.mutants.equivalence import difference
from eskin.verify.mutants.questions import Questions

FEW = 3
"""Number of configurations of which the generator must accept at least one; otherwise the mutant is stillborn."""

MAKE_S, COMPARE_S, PROVE_S = 300, 900, 1800
"""Time limits in seconds to generate designs, to compare designs, and to prove a block."""


@dataclass(frozen=True)
class Asked:
    """Tests and proofs for all mutants of a file."""

    checkout: Path  # without a mutant
    questions: Questions
    seed: int  # of the configurations in which equivalence is proved
    designs: int = COUNT  # number of these configurations


def judge(mutant: Mutant, asked: Asked) -> dict[str, Any]:
    """Return the verdict of a mutant: stillborn, killed, equivalent or left.

    Stillborn mutants are rejected by the generator. Survivors are left for ``ask_all``.

    The cheap questions come first: the tests of ``make check``, the comparison with the original, the properties of the
    block, the other tests of the file.
    """
    tests, differs = asked.questions.tests, ""
    with mutated(asked.checkout, mutant.file, mutant.text) as place:
        if mutant.of_rtl and not _made(place, mutant.file, asked.seed, place / "few.json", FEW):
            return {"verdict": "stillborn"}
        if by := first_failed(place, tests, asked.checkout, quick=True):
            return {"verdict": "killed", "by": by, "quick": True}
        if mutant.of_rtl and not (differs := _difference(place, mutant.file, asked)):
            return {"verdict": "equivalent"}
        if by := first_failed(place, tests[:1], asked.checkout, quick=False):
            return {"verdict": "killed", "by": by}
        for block in asked.questions.proofs if mutant.of_rtl else ():
            if by := failed_property(place, block, PROVE_S):
                return {"verdict": "killed", "by": f"property {by}"}
        if by := first_failed(place, tests[1:], asked.checkout, quick=False):
            return {"verdict": "killed", "by": by}
    return {"verdict": "left", "differs": differs} if differs else {"verdict": "left"}


def ask_all(mutant: Mutant, asked: Asked) -> dict[str, Any]:
    """Return whether the last and longest tests kill the mutant."""
    with mutated(asked.checkout, mutant.file, mutant.text) as place:
        if by := first_failed(place, asked.questions.tests, asked.checkout, quick=not mutant.of_rtl):
            return {"verdict": "killed", "by": by} | ({} if mutant.of_rtl else {"quick": True})
        return {"verdict": "alive"}


def _made(checkout: Path, file: str, seed: int, out: Path, count: int) -> bool:
    """Write the designs of a checkout to a file; return True if at least one was generated."""
    said = run(checkout, ["eskin.verify.mutants.configs", file, str(seed), str(count), str(out)], MAKE_S)
    return said.code == 0 and "module" in out.read_text()


def _originals(file: str, asked: Asked) -> Path:
    """Return the designs of the original file, which all mutants of the file share."""
    kept = asked.checkout.with_name(f"{asked.checkout.name}-{file.replace('/', '.')}-{asked.seed}-{asked.designs}.json")
    if not kept.exists():
        with scratch_folder(kept.parent, "designs") as folder:
            if not _made(asked.checkout, file, asked.seed, folder / kept.name, asked.designs):
                raise RuntimeError(f"the generator rejects the original {file}")
            (folder / kept.name).replace(kept)
    return kept


def _difference(place: Path, file: str, asked: Asked) -> str:
    """Return how a mutant's modules may differ from the original; empty if all are proved equal."""
    before, after = _originals(file, asked), place / "after.json"
    if not _made(place, file, asked.seed, after, asked.designs):
        return "the generator is too slow"
    return difference(before, after, COMPARE_S)
