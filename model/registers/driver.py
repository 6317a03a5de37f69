"""Register access from Python to a chip through any SPI adapter."""

from collections.abc import Callable, Collection, Iterator

from eskin.base.errors import InputError
from eskin.model.config import ReadoutConfig
from eskin.model.encoders.fields import CHOICES, SETTABLE
from eskin.model.registers.description import WORD_BITS, WORD_BYTES, Register, registers
from eskin.model.registers.spi import COMMAND_BITS, command


class Registers:
    """Read and write registers by their names in the description.

    ``config`` is the configuration of the chip, with ``registers="spi"``. ``exchange`` makes one transfer with CS low:
    it takes the bytes to send, and returns the received bytes.

    Examples
    --------
    >>> from eskin.model.registers.driver import Registers                       # doctest: +SKIP
    >>> chip = Registers(config, adapter.exchange)                         # doctest: +SKIP
    >>> chip.write("test", mode=2, on=1, interval=10)                      # doctest: +SKIP
    >>> chip.read("events")["count"]                                       # doctest: +SKIP
    118
    """

    def __init__(self, config: ReadoutConfig, exchange: Callable[[bytes], bytes]) -> None:
        if config.registers != "spi":
            raise InputError("the configuration has no registers; build it with registers=spi")
        self.config, self.exchange = config, exchange
        self.named = {register.key: register for register in registers(config)}

    def register(self, name: str) -> Register:
        """Return the register of a name; an array name has an index: ``mask[3]``."""
        if name not in self.named:
            raise InputError(f"there is no register {name!r}; the registers are {', '.join(self.named)}")
        return self.named[name]

    def read_word(self, name: str) -> int:
        """Read a register and return its word."""
        sent = command(self.register(name).address, False).to_bytes(COMMAND_BITS // 8, "big") + bytes(WORD_BYTES)
        return int.from_bytes(self.exchange(sent)[-WORD_BYTES:], "big")

    def read(self, name: str) -> dict[str, int]:
        """Read a register and return its fields."""
        word = self.read_word(name)
        return {field.name: field.of(word) for field in self.register(name).fields}

    def write_word(self, name: str, word: int) -> None:
        """Write a word to a register; raise InputError if the chip would refuse it."""
        register = self.register(name)
        if not register.writable:
            raise InputError(f"register {name} can only be read")
        for field in register.fields:
            if not field.allows(word):
                raise InputError(f"{name}.{field.name} must be in {field.least}..{field.most}, not {field.of(word)}")
        sent = command(register.address, True).to_bytes(COMMAND_BITS // 8, "big") + word.to_bytes(WORD_BYTES, "big")
        self.exchange(sent)

    def write(self, name: str, **values: int) -> None:
        """Write given fields of a register and leave its other fields unchanged."""
        register = self.register(name)
        known = {field.name: field for field in register.fields}
        word = self.read_word(name) if set(known) - set(values) else 0
        for field_name, value in values.items():
            if field_name not in known:
                raise InputError(f"{name} has no field {field_name!r}; it has {', '.join(known)}")
            field = known[field_name]
            if not 0 <= value < 1 << field.width:
                raise InputError(f"{name}.{field_name} must be in {field.least}..{field.most}, not {value}")
            word = word & ~((1 << field.width) - 1 << field.low) | value << field.low
        self.write_word(name, word)

    def choose(self, field: str, taxels: Collection[int]) -> None:
        """Choose the receptive field of the given taxels: own, neighbours, both or off."""
        if field not in CHOICES:
            raise InputError(f"a field must be one of {', '.join(CHOICES)}, not {field!r}")
        if self.config.receptive_fields != SETTABLE:
            raise InputError(
                f"the chip has built-in fields {self.config.receptive_fields}; "
                f"build a chip with receptive_fields={SETTABLE}"
            )
        for name, places in self._words("fields", 2):
            if mine := [place for place, taxel in enumerate(places) if taxel in taxels]:
                value = self.read(name)["taxels"]
                for place in mine:
                    value = value & ~(3 << 2 * place) | CHOICES.index(field) << 2 * place
                self.write(name, taxels=value)

    def silence(self, taxels: Collection[int]) -> None:
        """Mask the given taxels and enable all others."""
        for name, places in self._words("mask", 1):
            self.write(name, taxels=sum(1 << place for place, taxel in enumerate(places) if taxel not in taxels))

    def _words(self, name: str, bits: int) -> Iterator[tuple[str, range]]:
        """Yield name and taxels of every register in an array with ``bits`` for each taxel."""
        per_word = WORD_BITS // bits
        for first in range(0, self.config.taxels, per_word):
            places = range(first, min(first + per_word, self.config.taxels))
            yield f"{name}[{first // per_word}]" if len(places) == per_word else f"{name}_rest", places
