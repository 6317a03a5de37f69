"""What the page of the classifier's accuracy claims of networks in whole numbers, and of the RTL's spikes."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

from docs.tables.claims import claim
from docs.tables.claims.classifier import PAGE
from docs.tables.written import read

WHOLE = "docs/data/classifier/precision.json"


@cache
def networks() -> dict[str, dict[str, dict[str, Any]]]:
    """Return the points by network and variant."""
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for point in read(WHOLE)["points"]:
        found.setdefault(point["network"], {})[point["variant"]] = point
    return found


def accuracy(network: str, variant: str) -> float:
    """Return an accuracy in per cent."""
    return 100 * float(networks()[network][variant]["accuracy"])


def lost(variant: str, before: str, start: str = "") -> list[float]:
    """Return by how much a variant is behind another one, for networks whose names begin so."""
    return [accuracy(name, before) - accuracy(name, variant) for name in networks() if name.startswith(start)]


@claim(PAGE)
def eight_bits() -> Iterator[str]:
    """Eight bits against float, of networks that learned in float."""
    learned = [name for name in networks() if not name.endswith("qat4")]
    worst = {
        sizes: max(
            abs(accuracy(name, "8") - accuracy(name, "float")) for name in learned if name.split("-")[2] in sizes
        )
        for sizes in (("128", "256"), ("32", "64"))
    }
    large, small = worst.values()
    yield (
        f"with 128 and 256 neurons the difference is at most {large:.1f} points (aim: 1), with 32 and 64 at most "
        f"{small:.1f}, up or down"
    )


@claim(PAGE)
def four_bits() -> Iterator[str]:
    """128 neurons in four bits against 256 in float."""
    memory = {networks()[name]["4"]["memory_bits"] / 8000 for name in networks() if "-128" in name}
    pairs = {
        (recipe, scan): (accuracy(f"{recipe}-{scan}-128", "4"), accuracy(f"{recipe}-{scan}-256", "float"))
        for recipe in ("hardware", "paper")
        for scan in ("physical", "paper")
    }
    missed = [key for key, (four, whole) in pairs.items() if four < whole - 2]
    assert missed == [("paper", "paper")]
    first, second = pairs["hardware", "physical"], pairs["paper", "physical"]
    yield (
        f"**128 neurons and 4 bits ({memory.pop():.1f} kB) within two points of 256 in float**: met on `physical` "
        "scans "
        f"by both networks ({first[0]:.1f} against {first[1]:.1f}, {second[0]:.1f} against {second[1]:.1f} %) and on "
        "`paper` scans by the leaky one ({:.1f}, {:.1f}); missed there by the paper's network ({:.1f}, {:.1f})".format(
            *pairs["hardware", "paper"], *pairs["paper", "paper"]
        )
    )
    assert not memory
    gains = [accuracy(f"{name}-qat4", "4") - accuracy(name, "4") for name in networks() if f"{name}-qat4" in networks()]
    yield f"changes the accuracy in 4 bits by {min(gains):.1f} to +{max(gains):.1f} points"
    least = {}
    for scan in ("physical", "paper"):
        good = [
            (point["memory_bits"] / 8000, name, variant)
            for name, variants in networks().items()
            for variant, point in variants.items()
            if name.split("-")[1] == scan and "memory_bits" in point and point["accuracy"] >= 0.9
        ]
        least[scan] = min(good)
    kilobytes, name, bits = least["physical"]
    yield (
        f"is {kilobytes:.1f} kB on `physical` scans (`{name}` in {bits} bits), {least['paper'][0]:.1f} kB on `paper` "
        "scans"
    )


@claim(PAGE)
def fewer_bits() -> Iterator[str]:
    """What fewer bits cost, of weights, threshold and potential."""
    three, two = lost("3", "4"), lost("2", "4")
    yield f"**Beside 4 bits 3 cost up to {max(three):.0f} points, 2 bits {min(two):.0f} to {max(two):.0f}.**"
    yield f"A threshold of four bits costs at most {max(lost('4:t4', '4')):.0f} points with weights of 4 bits"
    assert not any(lost("4:m13", "4"))
    widths = [variants["4"]["membrane_bits"] for variants in networks().values()]
    yield f"A potential of 13 bits, in place of the {min(widths)} to {max(widths)} that can never saturate, changes no"
    worst = [max(lost("4:m11", "4", f"{recipe}-")) for recipe in ("paper", "hardware")]
    yield f"costs the paper's network up to {worst[0]:.0f} points, the leaky one at most {worst[1]:.1f}"


@claim(PAGE)
def rtl_spikes() -> Iterator[str]:
    """The RTL's spikes through a network."""
    kept = read("docs/data/classifier/rtl-predictions.json")
    check, test = kept["check"], kept["accuracy_on_test_images"]
    assert not any(check["mismatches"].values())
    yield f"({check['clocks']:,} clocks, {check['events']:,} events), against the model's"
    yield (
        f"same predictions for {check['images']} of {check['images']} images. The {test['images']} test images: "
        f"{test['correct']} right"
    )


@claim("docs/reference/classifier.md")
def memories() -> Iterator[str]:
    """The memories of the networks that come with the project."""
    bits = networks()["hardware-physical-128-qat4"]["4"]["memory_bits"]
    yield f"beside memories of {bits / 8000:.1f} kB"
