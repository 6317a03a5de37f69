"""Complete definition of a training run: textures, readout, time steps, network and training."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, get_args, get_type_hints

from eskin.base.configuration import refuse_unknown
from eskin.base.errors import InputError
from eskin.base.files import plain
from eskin.model.config import ReadoutConfig
from eskin.skin.textures.dataset import open_dataset
from eskin.skin.textures.physical import PhysicalScan
from eskin.skin.textures.presets import PRESETS, Scan, preset
from eskin.skin.textures.rates import PAPER_TAU_S
from eskin.snn.data.bins import BinConfig
from eskin.snn.data.cache import kept, key_of
from eskin.snn.data.disturb import disturbed_dataset
from eskin.snn.data.frame_steps import FrameSteps
from eskin.snn.data.frames import frame_dataset, frames_of_recordings
from eskin.snn.data.gains import with_gains
from eskin.snn.data.record import Tick, Variant, record_dataset
from eskin.snn.data.recordings import event_files, read_recordings
from eskin.snn.data.scans import ScanData, load_recordings
from eskin.snn.network_config import FIELDS, NetworkConfig
from eskin.snn.training import TrainConfig, parted


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """All parameters that determine a result, except fold and seed."""

    dataset: str | None = None
    """Path as for ``eskin.skin.textures.dataset.open_dataset``."""
    events: str | None = None
    """Folder of event files (an RTL replay) instead of the model."""
    preset: str | None = "physical"
    """``physical`` or ``paper``; None for event files without texture scans."""
    readout: ReadoutConfig = field(default_factory=lambda: ReadoutConfig(resolution=4))
    """Readout before the preset sets its fields."""
    tau_s: float | None = None
    """Time constant of a leak in seconds; the paper's 0.2 s by default, ``readout``'s with ``given_leak``."""
    given_leak: bool = False
    """True if the user set the leak of ``readout``; False for the default leak."""
    taxels: tuple[int, ...] = ()
    """Taxels of the array of ``readout`` that are read (``Scan.wired_to``), in their order; empty: all of them."""
    frames: FrameSteps | None = None
    """Frames instead of events."""
    start_rows: int = 1
    """Scans of each image, evenly spread; tests use the first."""
    disturbed: int = 0
    """Additional scans of each image, randomly disturbed (``eskin.snn.data.disturb``); tests use the clean scan."""
    variant: Variant = ""
    """Variant of the events (``eskin.snn.data.record``)."""
    bins: BinConfig = field(default_factory=BinConfig)
    network: dict[str, Any] = field(default_factory=dict)
    """Fields of NetworkConfig except inputs and classes, which follow from the data."""
    train: TrainConfig = field(default_factory=TrainConfig)
    grid: dict[str, list[Any]] | None = None
    """Values to try by name of a network or training field; inner validation chooses among all their combinations
    (``eskin.snn.experiments.crossval``)."""
    tests: tuple[str, ...] = ()
    """Patterns of image names; each pattern gives the test images of one fold. Empty: stratified folds."""

    def __post_init__(self) -> None:
        for name in ("dataset", "events", "preset"):
            if not isinstance(value := getattr(self, name), str | None):
                raise InputError(f"{name} must be text, not {value!r}")
        refuse_unknown(self.network, set(FIELDS) - {"inputs", "classes"}, "network")
        for name in ("tests", "taxels"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        self._check_fit()
        if self.taxels:
            self.scan_and_config()
        if self.variant:
            object.__setattr__(self, "bins", dataclasses.replace(self.bins, polarity=False))
        self._network(1, 1)
        self._settle_leak()
        if self.grid is not None:
            self.settings()

    def _check_fit(self) -> None:
        frames, recorded = self.frames is not None, self.events is not None
        if frames and self.train.speed_spread:
            raise InputError("speed_spread moves events in time and cannot be used for frames; set it to 0")
        if self.taxels and (recorded or self.disturbed):
            raise InputError("chosen taxels need undisturbed scans of textures; leave taxels out")
        if self.disturbed and (frames or recorded or self.preset != "physical"):
            raise InputError("disturbed scans need events and the physical preset; leave disturbed out")
        if self.disturbed < 0 or (self.disturbed and self.start_rows != 1):
            raise InputError("disturbed must be at least 1 with start-rows 1, because it draws the heights itself")
        if self.variant not in get_args(Variant):
            raise InputError(f"variant must be on, not {self.variant!r}")
        if self.variant and (frames or recorded or self.disturbed):
            raise InputError("variants need events of the model without disturbances")
        if self.variant and not self.readout.has_polarity:
            raise InputError(f"{self.readout.encoding} has only ON events; leave the variant out")

    def _settle_leak(self) -> None:
        """Raise an error for a readout's own leak if neither ``tau_s`` nor ``given_leak`` is set.

        If ``tau_s`` is set or the leak is the default, a set ``given_leak`` is cleared and ``tau_s`` holds
        the leak.
        """
        if self.tau_s is None and _has_own_leak(self.readout):
            if not self.given_leak:
                raise InputError("the readout has its own leak; set given_leak to use it, or give tau_s")
        elif self.given_leak:
            object.__setattr__(self, "tau_s", self.readout.tau_s if self.tau_s is None else self.tau_s)
            object.__setattr__(self, "given_leak", False)

    def settings(self) -> list[tuple[dict[str, Any], Experiment]]:
        """Return every parameter combination of the grid with its experiment.

        Raise InputError if a field is unknown or a value out of range.
        """
        grid, found = self.grid or {}, []
        for values in itertools.product(*grid.values()):
            setting = dict(zip(grid, values, strict=True))
            network, training = parted(setting)
            train = TrainConfig.from_dict(self.train.to_dict() | training)
            made = dataclasses.replace(self, network=self.network | network, train=train, grid=None)
            found.append((setting, made if grid else self))
        return found

    def data(self, progress: Tick | None = None) -> ScanData:
        """Return the scans, recorded by the model or read from the cache."""
        if self.events is not None and self.frames is not None:
            made = frames_of_recordings(Path(self.events), self.frames)
            return dataclasses.replace(made, source=f"frames {self.frames.name} of the recordings in {self.events}")
        if self.events is not None:
            recordings = with_gains(load_recordings(Path(self.events), self.bins), Path(self.events), self.bins)
            return dataclasses.replace(recordings, source=f"recordings in {self.events}")
        scan, config = self.scan_and_config()
        textures = open_dataset(self.dataset)
        rows = [0.0]
        if self.start_rows != 1:
            if not isinstance(scan, PhysicalScan):
                raise InputError("the paper preset has one start row; use the physical preset for more")
            rows = scan.start_rows(config, textures[0].load().shape, self.start_rows)

        def make() -> ScanData:
            if self.disturbed:
                assert isinstance(scan, PhysicalScan)
                return disturbed_dataset(textures, scan, config, self.bins, self.disturbed, progress)
            if self.frames is not None:
                return frame_dataset(textures, scan, config, self.frames, rows, progress)
            return record_dataset(textures, scan, config, self.bins, rows, progress, self.variant)

        key = key_of(textures, scan, config, self.frames or self.bins, rows)
        key += f"-disturbed-{self.disturbed}" if self.disturbed else ""
        data = kept(f"{key}-{self.variant}" if self.variant else key, make)
        kind = f"{self.variant} events of {config.encoding} with {config.resolution} bits".lstrip()
        if self.frames is not None:
            kind = f"frames {self.frames.name}"
        return dataclasses.replace(data, source=f"{kind} from {textures.name} textures, {scan.name} scan")

    def with_readout_of_events(self) -> Experiment:
        """Return the experiment with readout and preset read from its event files.

        Raise InputError if there are no event files.
        """
        assert self.events is not None
        first = read_recordings(event_files([Path(self.events)])[:1])[0]
        found = first.metadata.get("preset")
        return dataclasses.replace(
            self, readout=first.config, given_leak=True, preset=found if found in PRESETS else None
        )

    def scan_and_config(self) -> tuple[Scan, ReadoutConfig]:
        """Return the scan preset and the readout configured for it."""
        scan, tau_s = preset(str(self.preset)), None
        if self.readout.encoder.leaks:
            tau_s = PAPER_TAU_S if self.tau_s is None and not self.given_leak else self.tau_s
        config = scan.configure(self.readout, tau_s)
        return scan.wired_to(config, self.taxels) if self.taxels else (scan, config)

    @property
    def kind(self) -> str:
        """Name of the encoder, or ``frame``."""
        return self.readout.encoding if self.frames is None else "frame"

    @property
    def bits(self) -> int:
        """Resolution N of the encoder, or bits of a frame sample."""
        return self.readout.resolution if self.frames is None else self.frames.bits

    @property
    def bits_per_event(self) -> int:
        """Address and polarity bits of an event, or bits of a frame sample."""
        if self.frames is not None:
            return self.frames.bits
        readout = self.scan_and_config()[1] if self.taxels else self.readout
        return readout.event_bits - (self.variant == "on")  # ON events alone need no bit for the polarity

    def network_config(self, data: ScanData) -> NetworkConfig:
        """Return the network configuration for given scans; raise an error for scans of one class only."""
        if len(data.class_names) < 2:
            raise InputError(f"{data.source} has one class, {data.class_names[0]}; a classifier needs two at least")
        return self._network(data.channels, len(data.class_names))

    def _network(self, inputs: int, classes: int) -> NetworkConfig:
        return NetworkConfig.from_dict({"inputs": inputs, "classes": classes} | self.network)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields for ``from_dict`` as plain values; for events, preset and readout are None."""
        fields = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "given_leak"}
        if not self.disturbed:  # experiments without disturbed scans keep their files and cells
            del fields["disturbed"]
        for name in ("variant", "taxels", "tests"):
            if not fields[name]:
                del fields[name]
        for name in ("readout", "train"):
            fields[name] = fields[name].to_dict()
        for name in ("bins", "frames"):
            fields[name] = None if fields[name] is None else dataclasses.asdict(fields[name])
        found: dict[str, Any] = plain(fields)
        return found if self.events is None else found | {"preset": None, "readout": None}

    @classmethod
    def from_dict(cls, fields: dict[str, Any]) -> Experiment:
        """Return the experiment for a dictionary written by ``to_dict``.

        Raise InputError, KeyError or TypeError if fields are missing or unknown.
        """
        made: dict[str, Any] = {
            "frames": None if fields["frames"] is None else FrameSteps(**fields["frames"]),
            "bins": BinConfig(**fields["bins"]),
            "network": {name: _number(name, value) for name, value in fields["network"].items()},
            "train": TrainConfig.from_dict(fields["train"]),
        }
        kept = {name: value for name, value in fields.items() if name not in ("preset", "readout")}
        if fields["events"] is None:
            readout = ReadoutConfig.from_dict(fields["readout"])
            made |= {"preset": fields["preset"], "readout": readout}
            made["given_leak"] = fields["tau_s"] is None and _has_own_leak(readout)
        else:
            made["preset"] = None
        return cls(**(kept | made))


def _number(name: str, value: Any) -> Any:
    """Convert a JSON value to float for float fields, including texts of infinities."""
    return float(value) if get_type_hints(NetworkConfig).get(name) is float and isinstance(value, (int, str)) else value


def _has_own_leak(readout: ReadoutConfig) -> bool:
    """Return True if the leak of a readout differs from the default."""
    default = ReadoutConfig()
    own = (readout.leak_shift, readout.leak_period) != (default.leak_shift, default.leak_period)
    return readout.encoder.leaks and own
