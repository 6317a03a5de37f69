"""Designs for fault injection, with limits on the effects of bit flips in each block."""

from dataclasses import dataclass

from eskin.model.cases import AXES, LISTED, axes, cases, singles
from eskin.model.classifier.config import ClassifierConfig
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import KINDS
from eskin.model.frame_config import FrameConfig
from eskin.model.tiles.config import TilesConfig

FEW = ReadoutConfig(rows=2, columns=2, sample_bits=6, resolution=2, leak_period=3, leak_shift=3, fraction_bits=3)
FEW = FEW.replace(window_period=3)
"""Few bits, so that the ends of the scale and of every counter are near."""
FIELDS = FEW.replace(receptive_fields="both")
"""A readout with receptive fields."""

LEFT_OUT = {
    ("receptive_fields", LISTED): "a trial ends with a swing that every taxel answers; a list may switch taxels off"
}
"""Values without a trial, and the reason."""

Config = ReadoutConfig | FrameConfig | ClassifierConfig
"""A ``TilesConfig``, which is a ``ReadoutConfig`` too, means the merge, or a relay station if it has one."""


@dataclass(frozen=True)
class Trial:
    """A design whose flops are flipped, one per run."""

    config: Config
    calm: bool = True  # low load, see ``eskin.verify.faults.scenario``; for readouts without registers
    slow: int = 0  # clocks that the receiver of a four-phase link takes for an edge of ACK
    stride: int = 1  # clocks from one upset of a flop to the next
    mode: int = 0  # of the test pattern, where there are registers

    @property
    def name(self) -> str:
        """Name of the trial for tables."""
        c = self.config
        if isinstance(c, FrameConfig):
            return f"{c.rows} x {c.columns}, frames, {c.resolution} in {c.word_bits} bits, calm"
        if isinstance(c, ClassifierConfig):
            words = [f"{c.inputs} inputs", f"{c.hidden} hidden", f"{c.classes} classes", c.readout]
            words += ["own parameters"] * c.own_parameters + [f"{len(c.layers)} layers"] * (len(c.layers) > 1)
            return ", ".join([*words, "scans"])
        if isinstance(c, TilesConfig):
            return "a tile's relay station, loaded" if c.relays else f"{c.tile_rows} x {c.tile_columns} tiles, loaded"
        words = [f"{c.rows} x {c.columns}", c.encoding, c.link, c.frontend, f"{c.sample_bits} bits"]
        words += [f"fields {c.receptive_fields}"] * (c.receptive_fields != "own")
        words += ["by the tick"] * (c.decide_every == "sample") + [f"ACK after {self.slow}"] * bool(self.slow)
        if c.registers != "none":
            return ", ".join([*words, "registers", ("host", "pattern of one", "pattern of all")[self.mode]])
        return ", ".join([*words, "calm" if self.calm else "loaded"])


def trials(small: bool = False) -> list[Trial]:
    """Return all trials, or a small selection."""
    handshakes = [c for c in cases(FEW, **axes("link")) if c.protocol.asynchronous]
    every = list(cases(FEW, **axes("encoding")))
    first, *others = hosts()
    if small:
        found = [Trial(config, True, stride=19 if config.encoder.late else 7) for config in every]
        found += [Trial(config, False, stride=13) for config in handshakes]
        found += [Trial(frames()[0], stride=5), Trial(tiles()[1], stride=5)]
        found += [Trial(first, stride=67), Trial(others[-1], stride=67), Trial(first, stride=67, mode=2)]
        return [*found, Trial(classifiers()[0], stride=13)]
    sides = {"rows": 3, "columns": 3}
    shapes = AXES | {"registers": ("none",), "frontend": ("digital",), "receptive_fields": KINDS}
    stream = [
        *(config.replace(**sides) for config in every),
        *(
            c
            for c in cases(FEW, **axes("encoding"), frontend=("analog",), decide_every=("clock", "sample"))
            if c.encoder.late == (c.decide_every == "sample")
        ),
        *singles(FEW, **shapes),
        FEW.replace(sample_bits=12, resolution=6),
        FIELDS,
    ]
    found = [Trial(config, calm) for config in stream for calm in (True, False)]
    for calm in (True, False):
        for config in handshakes:
            found += [
                Trial(config, calm),
                Trial(config, calm, 3, 3),
                Trial(config.replace(encoding="cw-lcs"), calm, 0, 3),
            ]
    found += [*map(Trial, frames()), *map(Trial, tiles())]
    others.append(first.replace(receptive_fields="settable"))
    found += [Trial(first, stride=3), *(Trial(config, stride=37) for config in others)]
    found += [Trial(first, stride=37, mode=mode) for mode in (1, 2)]
    return [*found, *(Trial(config, stride=2) for config in classifiers())]


def tiles() -> list[TilesConfig]:
    """Return skins with three and five tiles, and a relay station."""
    tile = ReadoutConfig(rows=8, columns=8)
    return [TilesConfig.of(tile, 1, 1, relays=1), *(TilesConfig.of(tile, 1, count) for count in (3, 5))]


def hosts() -> list[ReadoutConfig]:
    """Return readouts with registers, with three rows and columns so that unused addresses exist."""
    config = FEW.replace(rows=3, columns=3, leak_period=5, registers="spi")
    return list(cases(config, **axes("encoding")))


def classifiers() -> list[ClassifierConfig]:
    """Return classifiers with firing and non-firing outputs, with own parameters, and with layers."""
    bits = {"in_bits": 4, "rec_bits": 4, "out_bits": 4, "bias_bits": 4, "membrane_bits": 8, "output_bits": 7}
    both = {"inputs": 4, "classes": 3, "lanes": 2, "clocks_per_bin": 80, "evidence_bits": 6, **bits}
    both |= {"threshold": 12, "out_threshold": 6, "floor": -20, "out_floor": -10}
    other = {"readout": "membrane", "neuron_reset": "subtract", "leak_shift": 2, "out_leak_shift": 1, "threshold": 4}
    layers = {"layers": [[0, 2, []], [2, 5, [0, 1]]], "neuron_reset": "delayed", "leak_shift": 2}
    return [
        ClassifierConfig.from_dict(both | {"hidden": 4}),
        ClassifierConfig.from_dict(both | {"hidden": 5, "lanes": 4} | other),
        ClassifierConfig.from_dict(
            both | {"hidden": 4, "own_parameters": True, "neuron_reset": "subtract", "margin": 2}
        ),
        ClassifierConfig.from_dict(both | {"hidden": 5} | layers),
    ]


def frames() -> list[FrameConfig]:
    """Return frame readouts with different word lengths and settling times."""
    shapes = [(2, 3, 4, 1), (2, 3, 8, 3), (3, 2, 2, 1)]
    return [
        FrameConfig(
            readout=ReadoutConfig(rows=side, columns=side, sample_bits=bits + 2, resolution=bits),
            word_bits=word,
            settle_clocks=settle,
        )
        for side, bits, word, settle in shapes
    ]


def surroundings(small: bool = False) -> list[ReadoutConfig]:
    """Return the readouts to test with hostile inputs."""
    handshakes = [c for c in cases(FEW, **axes("link")) if c.protocol.asynchronous]
    if small:
        return handshakes
    return [*cases(FEW, **axes("encoding")), FEW.replace(frontend="analog"), *handshakes]


def most_changed(config: Config, block: str) -> int:
    """Return the number of events of other taxels that a bit flip may add or remove at low load.

    A taxel has none but its own. The arbiter holds a burst of one row, the link one event, and so does either place of
    the merge and of a relay station. The tick and the counter of the leak are common to all taxels: each may answer by
    an event more or less. Of frames two at most are wrong.
    """
    if isinstance(config, FrameConfig):
        return 2
    taxels = config.taxels if isinstance(config, ReadoutConfig) else 0
    return {"taxel": 0, "window": 0, "arbiter": getattr(config, "columns", 0), "link": 1, "merge": 1, "relay": 1}.get(
        block, taxels
    )


def most_off(config: ReadoutConfig, block: str) -> int:
    """Return the number of steps by which a bit flip may shift the reconstructed signals of other taxels.

    The array may lose a burst of the arbiter and add another one, or lose an event of the link and add another one. An
    upset anywhere else changes when events leave, and how a signal is followed, but not where it ends.
    """
    return 2 * {"arbiter": config.columns, "link": 1}.get(block, 0)


def most_ticks(block: str) -> int | None:
    """Return the number of sample ticks until all other taxels respond normally, or None if unlimited.

    What an upset of arbiter or link changes leaves before the next tick, or just behind it; of a frame readout it is in
    the frame under way or in the next.
    """
    return 1 if block in ("arbiter", "link", "frame_readout") else None
