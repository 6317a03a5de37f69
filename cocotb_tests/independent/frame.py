"""Frame readout: multiplexer, ADC and packer."""

from dataclasses import dataclass


@dataclass
class FrameReadout:
    """Frame readout that scans the taxels and packs codes into words.

    In each clock look at `outputs`, then call `clock` with the inputs of the same clock.
    """

    rows: int
    columns: int
    resolution: int  # N, bits of a code
    word_bits: int = 16
    settle_clocks: int = 1  # S, from a new multiplexer setting to the start of the conversion

    def __post_init__(self) -> None:
        self.words: list[tuple[int, int]] = []
        self.reset()

    def reset(self) -> None:
        """Reset the readout."""
        self.taxel: int | None = None  # the taxel at the multiplexer
        self.settled = 0  # clocks that it has stood there
        self.converting = False
        self.code: tuple[int, bool] | None = None  # a code on its way to the packer: (value, last of its frame)
        self.bits: list[int] = []  # bits that fill no word yet, the lowest first
        self.flush = False  # the bits behind the last code are filled up
        self.begins = True  # the next word is the first of a frame
        self.word: tuple[int, int] | None = None  # (data, sync) that is offered
        self.shown = (0, 0)  # data and sync change only with a new word
        self.overrun = False

    def starts(self) -> bool:
        """Return whether `adc_start` is high in this clock."""
        return (
            self.taxel is not None and not self.converting and self.settled >= self.settle_clocks and self.code is None
        )

    def outputs(self) -> dict[str, int]:
        """Return the outputs in this clock by port name."""
        row, column = (0, 0) if self.taxel is None else (1 << place for place in divmod(self.taxel, self.columns))
        return {
            "row_select": row,
            "column_select": column,
            "adc_start": self.starts(),
            "word_valid": self.word is not None,
            "word_data": self.shown[0],
            "word_sync": self.shown[1],
            "frame_overrun": self.overrun,
        }

    def clock(
        self,
        *,
        frame_start: bool = False,
        adc_done: bool = False,
        adc_code: int = 0,
        word_ready: bool = True,
        rst: bool = False,
    ) -> None:
        """Apply a rising edge with the inputs of this clock."""
        if rst:
            self.reset()
            return
        code_leaves = self._clock_packer(word_ready)
        self._clock_scan(frame_start, adc_done, adc_code, code_leaves)

    def _clock_packer(self, word_ready: bool) -> bool:
        """Move codes and words; return whether the waiting code was taken."""
        if self.word is not None and word_ready:
            self.words.append(self.word)
            self.word = None
        if self.word is not None:
            return False
        if self.flush:
            self._offer(self.bits + [0] * (self.word_bits - len(self.bits)))
            self.bits = []
            self.flush = False
            self.begins = True
            return False
        if self.code is None:
            return False
        value, last = self.code
        self.bits += [(value >> i) & 1 for i in range(self.resolution)]
        if len(self.bits) >= self.word_bits:
            self._offer(self.bits[: self.word_bits])
            self.bits = self.bits[self.word_bits :]
            self.begins = last and not self.bits
        self.flush = last and bool(self.bits)
        return True

    def _offer(self, bits: list[int]) -> None:
        self.word = (sum(bit << i for i, bit in enumerate(bits)), int(self.begins))
        self.shown = self.word
        self.begins = False

    def _clock_scan(self, frame_start: bool, adc_done: bool, adc_code: int, code_leaves: bool) -> None:
        starts = self.starts()
        self.overrun = bool(frame_start and self.taxel is not None)
        if code_leaves:
            self.code = None
        if self.taxel is None:
            if frame_start:
                self.taxel = 0
                self.settled = 0
            return
        self.settled += 1
        if starts:
            self.converting = True
        elif self.converting and adc_done:
            self.converting = False
            last = self.taxel == self.rows * self.columns - 1
            self.code = (adc_code & (2**self.resolution - 1), last)
            self.taxel = None if last else self.taxel + 1
            self.settled = 0
