"""Which readouts are upset, and what is stated about each of their blocks."""

from __future__ import annotations

from dataclasses import dataclass

from model.config import ReadoutConfig
from model.frame_config import FrameConfig

FEW = ReadoutConfig(rows=2, columns=2, sample_bits=6, resolution=2, leak_period=3, leak_shift=3, fraction_bits=3)
"""Few bits, so that the ends of the scale and of every counter are near."""


@dataclass(frozen=True)
class Trial:
    """A readout whose flops are turned, one in each run.

    Parameters
    ----------
    config : ReadoutConfig or FrameConfig
    calm : bool
        Which course is played, see ``flow.faults.course``; of no meaning for frames.
    slow : int
        Clocks that the receiver of a four-phase link takes for an edge of ACK.
    stride : int
        Clocks from one upset of a flop to the next.
    """

    config: ReadoutConfig | FrameConfig
    calm: bool
    slow: int = 0
    stride: int = 1

    @property
    def name(self) -> str:
        """What distinguishes it, for a table."""
        c = self.config
        if isinstance(c, FrameConfig):
            return f"{c.rows} x {c.columns}, frames, {c.resolution} in {c.word_bits} bits, calm"
        words = [f"{c.rows} x {c.columns}", c.encoding, c.link, c.frontend, f"{c.sample_bits} bits"]
        words += ["by the tick"] * (c.decide_every == "sample") + [f"ACK after {self.slow}"] * bool(self.slow)
        return ", ".join([*words, "calm" if self.calm else "loaded"])


def trials(small: bool = False) -> list[Trial]:
    """Return all trials, or for the gate one of each encoder and link, every seventh clock."""
    closing = FEW.replace(encoding="cw-lcs", window_period=3)
    leaky, handshake = FEW.replace(encoding="nlcs"), FEW.replace(link="four_phase")
    if small:
        found = [Trial(FEW, True, stride=7), Trial(closing, True, stride=19), Trial(leaky, True, stride=19)]
        return [*found, Trial(handshake, False, stride=13), Trial(frames()[0], True, stride=5)]
    sides = {"rows": 3, "columns": 3}
    stream = [
        FEW.replace(**sides),
        closing.replace(**sides),
        leaky.replace(**sides),
        FEW.replace(frontend="analog"),
        closing.replace(frontend="analog", decide_every="sample"),
        leaky.replace(frontend="analog", decide_every="sample"),
        FEW.replace(sample_bits=12, resolution=6),
    ]
    found = [Trial(config, calm, stride=7 if config.rows == 3 else 5) for config in stream for calm in (True, False)]
    for calm in (True, False):
        found += [Trial(handshake, calm, 0, 11), Trial(handshake, calm, 3, 31)]
        found += [Trial(closing.replace(link="four_phase"), calm, 0, 31)]
    return [*found, *(Trial(config, True, stride=3) for config in frames())]


def frames() -> list[FrameConfig]:
    """Return frame readouts: codes that do not fit a word, with a long settling, and such as are a word."""
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
    """Return the readouts that meet hostile surroundings."""
    closing, leaky = FEW.replace(encoding="cw-lcs", window_period=3), FEW.replace(encoding="nlcs")
    found = [FEW, closing, leaky, FEW.replace(frontend="analog"), FEW.replace(link="four_phase")]
    return found[-1:] if small else found


def most_changed(config: ReadoutConfig | FrameConfig, block: str) -> int:
    """Return how many events of others an upset in a block may take away, and how many it may add, in a calm array.

    A taxel has none but its own. The arbiter holds a burst of one row, the link one event. The tick and the counter of
    the leak are common to all taxels: each may answer by an event more or less. Of frames two at most are wrong.
    """
    if isinstance(config, FrameConfig):
        return 2
    return {"taxel": 0, "window": 0, "arbiter": config.columns, "link": 1}.get(block, config.taxels)


def most_ticks(block: str) -> int | None:
    """Return after how many sample ticks all others answer as ever in a calm array, None where it may take longer.

    What an upset of arbiter or link changes leaves before the next tick, or just behind it; of a frame readout it is in
    the frame under way or in the next.
    """
    return 1 if block in ("arbiter", "link", "frame_readout") else None
