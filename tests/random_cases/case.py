"""Random cases for Hypothesis: a configuration with its stimulus."""

from __future__ import annotations

import contextlib
import json
import random
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from hypothesis import HealthCheck, Phase, find, settings
from hypothesis import strategies as st
from hypothesis.errors import NoSuchExample

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.encoders import registry
from eskin.model.encoders.fields import KINDS, most_shift
from eskin.model.events.compare import first_difference
from eskin.model.readout import ANALOG_RANGE, Stimulus, simulate
from tests.random_cases.player import Breach, Design

MOST_SIDE, MOST_BITS, MOST_CHANGES, MOST_HELD = 3, 7, 12, 12
DELAYS = [delay for delay in range(1, 60) if delay % 8]
"""Of ACK, in 1/8 clock; never at a clock edge."""


@dataclass(frozen=True)
class Case:
    """A configuration and its inputs."""

    config: dict[str, Any]  # fields of the configuration that are not the default
    # for every clock the codes of all taxels, or None where there is no sample tick
    samples: list[list[int] | None] = field(default_factory=list)
    rest: int = 0  # clocks behind these
    # taxels that are off from a clock on, all others are on
    off: list[tuple[int, list[int]]] = field(default_factory=list)
    ready: list[int] = field(default_factory=lambda: [1])  # ``event_ready``, repeated
    ack_delay: list[int] = field(default_factory=lambda: [1])  # in 1/8 clock, repeated
    # decisions of the comparators in the first clocks, 1 for above, 2 for below; if empty, those of the signal
    decisions: list[list[int]] = field(default_factory=list)

    @property
    def clocks(self) -> int:
        """Length of the run in clocks."""
        return len(self.samples) + self.rest

    def parts(self) -> tuple[ReadoutConfig, Stimulus]:
        """Return configuration and stimulus."""
        config = ReadoutConfig.from_dict(self.config)
        ticks = [clock for clock, codes in enumerate(self.samples) if codes is not None]
        masks = {0: [True] * config.taxels} | {
            clock: [taxel not in off for taxel in range(config.taxels)] for clock, off in self.off
        }
        decisions = None
        if self.decisions:
            decisions = np.zeros((self.clocks, config.taxels), np.uint8)
            given = self.decisions[: self.clocks]
            decisions[: len(given)] = np.reshape(given, (-1, config.taxels))
        stimulus = Stimulus(
            samples=np.array([self.samples[clock] for clock in ticks], np.int32).reshape(-1, config.taxels),
            sample_clock=np.array(ticks, np.int64),
            clocks=self.clocks,
            enable_clock=np.array(sorted(masks), np.int64),
            enable=np.array([masks[clock] for clock in sorted(masks)], bool),
            ready=np.array(self.ready, np.uint8),
            ack_delay=np.array(self.ack_delay, np.int64),
            decisions=decisions,
        )
        return config, stimulus

    def difference(self, design: Design | None = None) -> str | None:
        """Return the difference between RTL and model, or None; an elaborated design may be given."""
        config, stimulus = self.parts()
        try:
            found = first_difference(simulate(config, stimulus), (design or Design(config)).play(stimulus))
        except Breach as breach:
            return f"the RTL breaks the protocol of its link: {breach}"
        return None if found is None else found.describe(("model", "RTL"))

    def to_json(self) -> str:
        """Return the case as one line of JSON."""
        return json.dumps({name: value for name, value in asdict(self).items() if value not in ([], [1], 0)})

    @classmethod
    def from_json(cls, text: str) -> Case:
        """Return the case for a line of JSON."""
        try:
            case = cls(**json.loads(text))
            case.parts()[1].check(ReadoutConfig.from_dict(case.config))
        except InputError:
            raise
        except (ValueError, TypeError, IndexError, AttributeError) as wrong:
            raise InputError(f"a case is a line of JSON, as a counter-example is printed: {wrong}") from None
        return case


# -- drawn by Hypothesis: the first of its choices is the simplest, and lists become shorter ---------


@st.composite
def configs(draw: st.DrawFn, fixed: dict[str, Any]) -> dict[str, Any]:
    """Draw the fields of a small configuration, except given fields."""
    fields: dict[str, Any] = {}

    def pick(name: str, choices: st.SearchStrategy[Any]) -> Any:
        fields[name] = fixed[name] if name in fixed else draw(choices)
        return fields[name]

    pick("rows", st.integers(1, MOST_SIDE))
    pick("columns", st.integers(1, MOST_SIDE))
    encoding = pick("encoding", st.sampled_from(registry.NAMES))
    bits = pick("sample_bits", st.integers(3, MOST_BITS))
    pick("resolution", st.integers(1, bits - 2))
    pick("decide_every", st.sampled_from(["clock", "sample"]))
    two = ["four_phase_dual"] * registry.named(encoding).polarity
    pick("link", st.sampled_from(["stream", "four_phase", *two]))
    pick("frontend", st.sampled_from(["digital", "analog"]))
    pick("fields", st.sampled_from(KINDS) | _listed(fields["rows"] * fields["columns"]))
    if registry.named(encoding).windowed:
        pick("closing_shift", st.integers(0, 4))
        pick("window_period", st.integers(1, 4))
    if registry.named(encoding).leaks:
        pick("leak_shift", st.integers(1, 5))
        pick("leak_period", st.integers(1, 6))
        pick("fraction_bits", st.integers(0, 5))
    config = ReadoutConfig.from_dict(fields)
    levels = config.full_scale // config.grid
    level = draw(st.integers(config.encoder.lowest(config) // config.grid, levels - 1))
    return fields | ({"reference_reset": level * config.grid} if level else {})


def _listed(taxels: int) -> st.SearchStrategy[list[dict[str, Any]]]:
    """Draw receptive fields of few taxels; several taxels are off."""

    def field(drawn: tuple[list[int], int]) -> dict[str, Any]:
        return {"taxels": drawn[0], "shift": min(drawn[1], most_shift(len(drawn[0])))}

    some = [st.lists(st.integers(0, taxels - 1), min_size=not n, max_size=4) for n in range(taxels)]
    return st.tuples(*(st.tuples(one, st.integers(0, 2)).map(field) for one in some)).map(list)


def _taxels(one: st.SearchStrategy[int], taxels: int) -> st.SearchStrategy[list[int]]:
    """Draw a value for every taxel from few different values."""
    return st.lists(one, min_size=1, max_size=taxels).map(lambda few: [few[n % len(few)] for n in range(taxels)])


def _held(what: st.SearchStrategy[Any]) -> st.SearchStrategy[list[tuple[Any, int]]]:
    """Draw values, each with the number of additional clocks in which it stays constant."""
    return st.lists(st.tuples(what, st.integers(0, MOST_HELD)), max_size=MOST_CHANGES)


@st.composite
def cases(draw: st.DrawFn, **fixed: Any) -> Case:
    """Draw a case; fields of the configuration may be given."""
    fields = draw(configs(fixed))
    config = ReadoutConfig.from_dict(fields)
    scale = config.full_scale * (ANALOG_RANGE if config.frontend == "analog" else 1)
    code = st.integers(-config.full_scale, config.full_scale - 1)
    if config.frontend == "analog":
        code |= st.integers(-scale, scale - 1)
    samples = [codes for held in draw(_held(_taxels(code, config.taxels))) for codes in (held[0], *[None] * held[1])]
    rest = draw(st.integers(0, 4 * MOST_HELD))
    clocks = len(samples) + rest
    flags = _taxels(st.sampled_from([1, 0]), config.taxels)
    off = flags.map(lambda on: [taxel for taxel, is_on in enumerate(on) if not is_on])
    decisions: list[list[int]] = []
    if config.frontend == "analog" and draw(st.booleans()):
        row = _taxels(st.integers(0, 3 if config.has_polarity else 1), config.taxels)
        decisions = [found for held in draw(_held(row)) for found in [held[0]] * (1 + held[1])]
    delays = st.sampled_from(DELAYS)
    return Case(
        config=fields,
        samples=samples,
        rest=rest,
        off=draw(st.lists(st.tuples(st.integers(0, clocks), off), max_size=4)),
        ready=draw(st.lists(st.sampled_from([1, 0]), min_size=1, max_size=6)),
        ack_delay=draw(st.lists(delays, min_size=1, max_size=4)) if config.handshake else [1],
        decisions=decisions,
    )


@dataclass
class Search:
    """Result of a search."""

    examples: int = 0  # cases that were played, including shrinking
    case: Case | None = None  # the smallest in which RTL and model differ
    # the last configurations, elaborated: most of what a shrinking tries differs in the stimulus alone
    designs: dict[str, Design] = field(default_factory=dict)

    def differs(self, case: Case) -> bool:
        """Return True if RTL and model differ in a case."""
        self.examples += 1
        key = json.dumps(case.config, sort_keys=True)
        design = self.designs.pop(key, None) or Design(ReadoutConfig.from_dict(case.config))
        self.designs[key] = design
        if len(self.designs) > 30:
            del self.designs[next(iter(self.designs))]
        return case.difference(design) is not None

    @property
    def told(self) -> str:
        """Smallest failing case, its difference, and the command that repeats it."""
        assert self.case is not None
        case = self.case
        fields = ", ".join(f"{name} {value}" for name, value in case.config.items())
        lines = [
            f"RTL and model differ: {fields}; {case.clocks} clocks, samples {case.samples}",
            str(case.difference()),
        ]
        return "\n".join([*lines, f"reproduce: python -m tests.random_cases '{case.to_json()}'"])


def search(examples: int, seed: int, **fixed: Any) -> Search:
    """Draw cases until RTL and model differ, and shrink the failing case.

    ``fixed`` are fields of the configuration that are not drawn.
    """
    found = Search()
    rules = settings(
        max_examples=examples,
        database=None,
        deadline=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    with contextlib.suppress(NoSuchExample):
        found.case = find(cases(**fixed), found.differs, settings=rules, random=random.Random(seed))
    return found
