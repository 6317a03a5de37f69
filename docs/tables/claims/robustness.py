"""What the page of robustness claims."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from docs.tables.accuracy import sweep
from docs.tables.claims import claim
from docs.tables.robustness import disturbed
from docs.tables.written import digits
from snn.experiments.pairs import mcnemar

PAGE = "docs/guide/robustness.md"


def robust(name: str, strength: float) -> dict[str, Any]:
    """Return the point of the robust network."""
    return disturbed()[name, strength]["robust"]


def right(name: str, strength: float) -> tuple[int, int, float]:
    """Return how many images both networks have right under a disturbance, and the p of McNemar's test."""
    networks = disturbed()[name, strength]
    both = []
    for network in ("clean", "robust"):
        answers = networks[network]["answers"]
        both.append([a == b for part in answers for a, b in zip(part["labels"], part["predicted"], strict=True)])
    parted = [sum(a and not b for a, b in zip(x, y, strict=True)) for x, y in (both, both[::-1])]
    return sum(both[0]), sum(both[1]), mcnemar(*parted)


@claim(PAGE)
def targets() -> Iterator[str]:
    """The targets and how they are met."""
    noise, dead = robust("noise", 0.01), robust("dead", 0.2)
    turned = [robust("direction", angle) for angle in (90.0, 180.0, 270.0)]
    ways = [100 * one["accuracy"] for one in turned]
    clean = right("clean", 0.0)
    assert clean[0] == clean[1]
    assert noise["accuracy"] >= 0.95
    assert min(dead["accuracy"], *(way / 100 for way in ways)) >= 0.9
    images = noise["images"]
    yield (
        f"{100 * noise['accuracy']:.1f} % at 10 mV (95 wanted), {100 * dead['accuracy']:.1f} % at 20 % dead taxels "
        "(90), "
        f"{min(ways):.1f} to {max(ways):.1f} % in any direction (90), and nothing lost on clean scans ({clean[0]} of "
        f"{images} both)"
    )
    lowest = [100 * one["bootstrap_95"][0] for one in (noise, dead, min(turned, key=lambda one: one["accuracy"]))]
    yield "The lower ends of the intervals lie at {:.0f}, {:.0f} and {:.0f} %".format(*lowest)
    yield f"seed 0, {images} test images, last epoch"
    (two,) = sweep("tuned-2ms")
    yield f"LCS 3 b in 2 ms bins, {digits(two['normalised_rate'], 2)} of 640 kb/s"


@claim(PAGE)
def paired() -> Iterator[str]:
    """The networks image by image."""
    certain = [right(*which)[2] for which in (("direction", 90.0), ("direction", 270.0), ("rotation", 90.0))]
    assert max(certain) < 1e-8
    yield "90 and 270 degrees, at a texture turned by 90 degrees (each p < 1e-8)"
    back, dead, noise = right("direction", 180.0), right("dead", 0.2), right("noise", 0.01)
    yield f"180 degrees (p {digits(back[2], 1)})"
    yield f"dead taxels ({dead[0]} against {dead[1]} right, p {digits(dead[2], 1)})"
    assert noise[2] > 0.05
    yield f"At 10 mV the gain, {noise[0]} to {noise[1]}, is not certain (p {digits(noise[2], 2)})"


@claim(PAGE)
def not_cured() -> Iterator[str]:
    """What stays, and what noise costs in events."""
    yield f"20 mV of noise ({100 * robust('noise', 0.02)['accuracy']:.0f} %; it doubles the events)"
    yield f"A touch of 0.1 s out of 0.38 s gives {100 * robust('short', 0.1)['accuracy']:.0f} %"
    rates = [disturbed()[which]["clean"]["rate_hz"] for which in (("clean", 0.0), ("noise", 0.01), ("noise", 0.02))]
    yield f"at 10 mV {rates[1] / rates[0]:.2f}, at 20 mV {rates[2] / rates[0]:.2f} times as many as without"
    before, after = (100 * disturbed()["noise", 0.01][network]["accuracy"] for network in ("clean", "robust"))
    assert after > before
