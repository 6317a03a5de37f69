"""A chip from samples to class: readout, classifier, and bin timer."""

from typing import Any

from amaranth.hdl import Cat, Module, Mux, Signal, Value
from amaranth.lib.wiring import In, Out

from eskin.model.classifier.chip_config import ChipConfig
from eskin.model.classifier.config import ClassifierConfig
from eskin.rtl.arbiter import event_ports
from eskin.rtl.block import Block
from eskin.rtl.classifier.core import Classifier
from eskin.rtl.readout import Readout


class BinTimer(Block[ClassifierConfig]):
    """Timer that ends a bin every ``clocks_per_bin`` clocks.

    Attributes
    ----------
    scan_start : In(1)
        The first clock of the first bin is the next one.
    bin_end : Out(1)
        This clock is the last of a bin.
    """

    module_name = "eskin_bin_timer"

    def __init__(self, config: ClassifierConfig) -> None:
        super().__init__(config, {"scan_start": In(1), "bin_end": Out(1)})

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        count = Signal(range(max(self.config.clocks_per_bin, 2)))
        m.d.comb += self.bin_end.eq(count == self.config.clocks_per_bin - 1)
        m.d.sync += count.eq(Mux(self.bin_end | self.scan_start, 0, count + 1))
        return m


class Chip(Block[ChipConfig]):
    """Top module with readout and classifier; waiting events stay in the arbiter.

    Attributes
    ----------
    event_valid, event_ready, event_channel : Out
        The events within, to be watched.
    others
        Those of ``Readout`` and ``Classifier``.
    """

    module_name = "eskin_chip"

    def __init__(self, config: ChipConfig) -> None:
        readout, classifier = Readout(config.readout), Classifier(config.classifier)
        inner = event_ports(config.readout, Out)
        self.of_readout = [name for name in readout.signature.members if name not in inner]
        watched = ("event_valid", "event_ready", "event_channel")
        self.of_classifier = [name for name in classifier.signature.members if name not in (*watched, "bin_end")]
        ports: dict[str, Any] = {name: readout.signature.members[name] for name in self.of_readout}
        for name in classifier.signature.members:
            if name in watched:
                ports[name] = Out(len(getattr(classifier, name)))
            elif name in self.of_classifier:
                ports[name] = classifier.signature.members[name]
        super().__init__(config, ports)

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        readout, classifier = Readout(self.config.readout), Classifier(self.config.classifier)
        timer = BinTimer(self.config.classifier)
        readout.place(m, "readout", platform)
        classifier.place(m, "classifier", platform)
        timer.place(m, "timer", platform)
        readout.connect_all(m, self, self.of_readout)
        classifier.connect_all(m, self, self.of_classifier)
        m.d.comb += [
            timer.scan_start.eq(self.scan_start),
            classifier.bin_end.eq(timer.bin_end),
            classifier.event_valid.eq(readout.event_valid),
            readout.event_ready.eq(classifier.event_ready),
            self.event_valid.eq(readout.event_valid),
            self.event_ready.eq(classifier.event_ready),
        ]
        if self.config.classifier.channel_bits:
            channel = self._channel(readout)
            m.d.comb += [classifier.event_channel.eq(channel), self.event_channel.eq(channel)]
        return m

    def _channel(self, readout: Readout) -> Value:
        """Return the network input channel of the current event."""
        config = self.config.readout
        column: Value = readout.event_col if config.column_bits else Cat()
        taxel = column
        if config.row_bits:
            if config.columns == 1 << config.column_bits:
                taxel = Cat(column, readout.event_row)
            else:
                taxel = readout.event_row * config.columns + column
        if not self.config.polarity:
            return taxel
        return Mux(readout.event_polarity, taxel, taxel + config.taxels)
