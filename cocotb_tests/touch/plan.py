"""Run the command touch: scans on a chip, with networks that were not trained on the image."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from eskin.base.errors import InputError
from eskin.base.files import make_folder, read_arrays
from eskin.base.workers.engine import Pool, each
from eskin.cocotb_tests.bench.chip import ChipScan
from eskin.cocotb_tests.runner.chunk import retry_after_crash, store
from eskin.cocotb_tests.runner.inputs import Inputs, Own, Textures, chosen
from eskin.cocotb_tests.runner.process import play_runs
from eskin.cocotb_tests.runner.simulator import Build, build, require_programs
from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.file import IntegerWeights
from eskin.skin.recordings.options import FINGER
from eskin.skin.recordings.trained_on import RUNS, TrainingNotes, network_of, networks_of_recordings
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.presets import preset

SHIPPED = Path(__file__).parents[2] / "model" / "classifier" / "networks"
"""Networks that come with the project: a folder for each dataset, a file for each fold."""

MAX_IN_A_PART = 40


@dataclass(frozen=True)
class Network:
    """An integer network with the notes on its training."""

    path: Path
    weights: IntegerWeights
    chip: ChipConfig  # chip with the readout of the training
    notes: TrainingNotes

    @classmethod
    def load(cls, path: Path) -> Network:
        """Return the network from a file; raise an error without notes on the training."""
        weights = IntegerWeights.load(path)
        notes = TrainingNotes.of(weights, path)
        return cls(path, weights, ChipConfig(readout=notes.readout, classifier=weights.network.config), notes)


@dataclass(frozen=True)
class Part:
    """Scans or recordings for one network."""

    network: Path
    samples: dict[str, NDArray[Any]]  # codes by name
    metadata: dict[str, dict[str, Any]]  # of the results by name
    skip: list[str]  # those for which the harness may skip clocks
    repeat_command: str  # command that repeats all of them

    def runs(self, chip: ChipConfig, keep: Path) -> Iterator[ChipScan]:
        """Yield a run for each; the results go into a folder."""
        network = dataclasses.replace(IntegerWeights.load(self.network).network, config=chip.classifier)
        for name, samples in self.samples.items():
            make_folder(keep, Path(name).parent)
            repeat_command, place = f"{self.repeat_command} ONLY={name}", keep / f"{name}.npz"
            yield ChipScan(chip, network, name, samples, repeat_command, place, self.metadata[name], name in self.skip)


@dataclass(frozen=True)
class Plan:
    """The inputs to simulate, and the networks."""

    material: Inputs
    networks: dict[str, Network]  # networks by name of the image or recording
    repeat_command: str  # the command that plays it again
    out: Path

    @property
    def names(self) -> list[str]:
        """Names of all inputs."""
        return list(self.networks)

    @property
    def folder(self) -> Path:
        """Folder of the results."""
        return self.out / self.material.name

    @functools.cached_property
    def programs(self) -> dict[Path, Build]:
        """Simulation programs by network file, built if necessary."""
        return {one.path: build(one.chip, "verilator") for one in {n.path: n for n in self.networks.values()}.values()}

    def proof(self, name: str) -> str:
        """Return the digest stored with a result: RTL, harness, models, network and input."""
        network = self.networks[name]
        found = hashlib.sha256(self.material.proof(name, self.programs[network.path]).encode())
        found.update(network.path.read_bytes())
        return found.hexdigest()

    def finished(self, name: str) -> dict[str, Any] | None:
        """Return a stored result if it was made by the current RTL and network from the same input."""
        try:
            said = result_of(self.folder / f"{name}.npz")
        except InputError:
            return None
        return said if said.get("proof") == self.proof(name) else None

    def parts(self, workers: int) -> Iterator[Part]:
        """Yield the missing inputs in parts, each with one network.

        The first run plays every clock. The others skip the clocks in which the chip is not awake.
        """
        missing: dict[Path, list[str]] = {}
        for name, network in self.networks.items():
            if self.finished(name) is None:
                missing.setdefault(network.path, []).append(name)
        total = sum(map(len, missing.values()))
        size = max(1, min(MAX_IN_A_PART, -(-total // workers)))
        parts = [names[at : at + size] for names in missing.values() for at in range(0, len(names), size)]
        for names in parts:
            said = self.material.said(names)
            samples = {name: self.samples(name) for name in names}
            metadata = {name: self._metadata(name, said[name].get("class")) for name in names}
            skip = [name for name in names if name != parts[0][0]]
            yield Part(self.networks[names[0]].path.resolve(), samples, metadata, skip, self.repeat_command)

    def _metadata(self, name: str, true: Any) -> dict[str, Any]:
        network = self.networks[name]
        classes = list(network.weights.class_names)
        return {
            "name": name,
            "true": classes.index(true) if true in classes else None,
            "float": network.notes.tested.get(name),
            "classes": classes,
            "network": network.path.name,
            "proof": self.proof(name),
        }

    def image(self, name: str) -> NDArray[Any]:
        """Return the image to scan, or the codes of a recording."""
        return self.material.array(name, self.networks[name].chip.readout)

    def samples(self, name: str) -> NDArray[Any]:
        """Return the codes for an image or a recording."""
        network, array = self.networks[name], self.image(name)
        if not self.material.preset:
            return array
        scan = preset(self.material.preset, network.notes.wiring)
        return scan.samples(network.chip.readout, array, self.material.start_row)[0]


def plan(weights: Path | None, data: Path | None, dataset: str, limit: int | None, only: str | None, out: Path) -> Plan:
    """Return the plan for the options of the command."""
    require_programs("verilator")
    if data is None:
        textures = open_dataset(dataset)
        networks = _load(weights or SHIPPED / textures.name)
        if (kind := networks[0].notes.preset) is None:
            raise InputError(f"{networks[0].path} was trained on recordings; give recordings with --data")
        material: Inputs = Textures(textures, dataset, kind)
    else:
        weights = weights or _network_for(data)
        networks = _load(weights)
        material = _own(networks[0], data)
    repeat_command = [
        "make touch",
        f"DATA={data}" if data else f"DATASET={dataset}",
        *([f"WEIGHTS={weights}"] if weights else []),
    ]
    names = chosen(material, limit, only, not_learned(material, networks))
    return Plan(material, choose(material, names, networks), " ".join(repeat_command), out)


def _network_for(data: Path) -> Path:
    """Return the newest network that was trained on recordings in a folder of this name, or on any recordings."""
    if found := network_of(data):
        return found
    if data.resolve() == FINGER.resolve():
        return SHIPPED / FINGER.name
    if newest := next(iter(networks_of_recordings()), None):
        return newest
    raise InputError(
        f"no integer network in {RUNS} was trained on recordings; run eskin train --data {data}, then the command that "
        f"it prints, or give --weights"
    )


def not_learned(material: Inputs, networks: Sequence[Network]) -> list[str]:
    """Return the inputs that at least one network was not trained on; all inputs if no such input exists."""
    found = [
        name
        for name in material.names
        if any(n.notes.dataset != material.name or name in n.notes.tested for n in networks)
    ]
    return found or material.names


def _load(place: Path) -> list[Network]:
    """Return the integer networks of a file or folder."""
    paths = sorted(place.glob("*.npz")) if place.is_dir() else [place]
    if place.parent == SHIPPED and not place.exists():
        raise InputError(f"the project has no networks for {place.name}; give --weights from eskin quantise")
    if not paths:
        raise InputError(f"{place} has no integer networks; make a network with eskin quantise")
    return [Network.load(path) for path in paths]


def _own(network: Network, place: Path) -> Own:
    """Return a user's recordings, prepared as in the training; a recording need not have a class."""
    if network.notes.own is None:
        raise InputError(f"{network.path} was trained on textures; leave --data out, or train on recordings")
    return Own(network.notes.own.read(place, flat=True), place)


def choose(material: Inputs, names: Sequence[str], networks: Sequence[Network]) -> dict[str, Network]:
    """Return for each name a network that was not trained on it."""
    for network in networks:
        if network.notes.preset != (material.preset or None):
            raise InputError(
                f"{network.path} was trained on {network.notes.preset or 'recordings'}, not on "
                f"{material.preset or 'recordings'}; give matching weights"
            )
    found = {}
    for name in names:
        fit = [n for n in networks if n.notes.dataset == material.name and name in n.notes.tested]
        foreign = [n for n in networks if n.notes.dataset != material.name]
        if not (fit or foreign):
            learned = f"every network here was trained on {name}; give the weights of the fold without it"
            if isinstance(material, Own) and name.split("/")[0] not in networks[0].weights.class_names:
                learned = f"{networks[0].path} has no class {name.split('/')[0]}; train it on all classes"
            raise InputError(learned)
        found[name] = (fit or foreign)[0]
    return found


def play_part(part: Part) -> dict[str, bytes]:
    """Play a part on this machine and return its result files; restart a crashed simulation."""
    network = Network.load(part.network)
    program = build(network.chip, "verilator")

    def play(running: Path) -> dict[str, bytes]:
        keep = make_folder(running, "results")
        play_runs(program, part.runs(network.chip, keep), running)
        return {name: (keep / f"{name}.npz").read_bytes() for name in part.samples}

    return retry_after_crash("touch", play)


def play(plan: Plan, pool: Pool, on_run: Callable[[], object]) -> None:
    """Simulate the missing inputs in parallel, and store the results."""
    require_programs("verilator")
    for files in each(pool, play_part, ((part,) for part in plan.parts(pool.workers))):
        store(plan.folder, files, on_run)


def result_of(path: Path) -> dict[str, Any]:
    """Return the metadata of a result file."""
    try:
        said: dict[str, Any] = json.loads(str(read_arrays(path, "a result of touch", "run touch again")["metadata"]))
    except (KeyError, ValueError):
        raise InputError(f"{path} is not a result of touch; run touch again") from None
    return said


def summarise(plan: Plan) -> dict[str, Any]:
    """Return the totals of all results, with the predicted class of every image."""
    found = {name: plan.finished(name) for name in plan.names}
    there = [said for said in found.values() if said]
    known = [said for said in there if said["true"] is not None]
    sums = {key: sum(said[key] for said in there) for key in ("clocks", "events", "bins", "hidden_spikes", "stalls")}
    chip, names = plan.networks[plan.names[0]].chip, plan.networks[plan.names[0]].weights.class_names
    return {
        "dataset": plan.material.name,
        "preset": plan.material.preset or None,
        "images": len(there),
        "missing": len(found) - len(there),
        **sums,
        "additions": chip.classifier.additions(sums["events"], sums["hidden_spikes"], sums["bins"]),
        "chip": chip.to_dict(),
        "overruns": sum(said["overruns"] for said in there),
        "mismatches": 0,
        "labelled": len(known),
        "right": sum(said["class"] == said["true"] for said in known),
        "right_float": sum(said["float"] == said["true"] for said in known if said["float"] is not None),
        "float_known": sum(said["float"] is not None for said in known),
        "as_ideal_bins": sum(said["class"] == said["ideal"] for said in there),
        "latency_clocks": max((said["latency_clocks"] for said in there), default=0),
        **(_early(known) if chip.classifier.margin else {}),
        "answers": {
            name: {key: None if said[key] is None else names[said[key]] for key in ("true", "class", "float")}
            | (_decision(said, chip, names) if chip.classifier.margin else {})
            for name, said in found.items()
            if said
        },
    }


def _decision(said: dict[str, Any], chip: ChipConfig, names: Sequence[str]) -> dict[str, Any]:
    """Return class and seconds of the early decision of an answer, or None in both."""
    if said["early"] is None:
        return {"early": None, "early_s": None}
    bins, found = said["early"]
    return {"early": names[found], "early_s": bins * chip.classifier.bin_s}


def _early(known: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the results of early decisions, for the last bin and its class where none was made."""
    decisions = [(said, *(said["early"] or (said["bins"], said["class"]))) for said in known]
    return {
        "right_early": sum(found == said["true"] for said, _, found in decisions),
        "decided": sum(said["early"] is not None for said in known),
        "early_share": sum(at / said["bins"] for said, at, _ in decisions) / max(len(decisions), 1),
    }
