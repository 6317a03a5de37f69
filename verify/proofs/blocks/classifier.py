"""Properties of the classifier: every event added once, no overflow, every bin answered or reported.

Two checkers share the work. ``ScheduleChecker`` looks at when something is added, with any potentials; ``SumsChecker``
looks at what is added, and takes from the other how much there is of it in a bin.
"""

from collections.abc import Callable, Generator, Mapping
from typing import Any, ClassVar

from amaranth.hdl import Array, Cat, Const, Module, Mux, Signal, Value, signed
from amaranth.lib.wiring import In

from eskin.model.classifier.config import OWN_SHIFT_BITS, ClassifierConfig, Leak, highest, lowest
from eskin.rtl.classifier.core import STALL_BITS, Classifier, State
from eskin.rtl.classifier.memory import address_bits
from eskin.verify.proofs.checker import Checker, Promises, before, implies, pick

SPARE_BITS = 3
"""Additional bits of the sums in a checker, so that the checker sees an overflow of the classifier."""

MEMORIES = (
    "eskin_input_weights",
    "eskin_recurrent_weights",
    "eskin_neuron_weights",
    "eskin_neuron_parameters",
    "eskin_potentials",
)


class _ClassifierChecker(Checker[ClassifierConfig]):
    """Common checker of the classifier; the words of the memories are free in every clock.

    ``watch`` is any row of weights, for good; below ``hidden`` also the neuron of that number. ``rival`` is any class,
    for good; its lowest bits also number a word of potentials.
    """

    block = Classifier
    cut: ClassVar[tuple[str, ...]] = MEMORIES
    together = True
    assumptions: ClassVar[Mapping[str, str]] = {
        "events_fit": "at most clocks_per_bin / groups events are taken in a bin"
    }

    def constants(self, config: ClassifierConfig) -> dict[str, int]:
        return {"watch": config.hidden + config.inputs, "rival": max(config.classes, config.lane_words)}

    def inner(self, config: ClassifierConfig) -> dict[str, Any]:
        flags = [f"{memory}_read_valid" for memory in ("inputs", "recurrent", "neurons")] + ["fires"] * bool(
            config.layers
        )
        return dict.fromkeys(flags, In(1)) | {
            "inputs_read_address": In(address_bits(config.input_words)),
            "inputs_read_data": In(config.lanes * config.in_bits),
            "recurrent_read_address": In(address_bits(config.recurrent_words)),
            "recurrent_read_data": In(config.lanes * config.rec_bits),
            "lane_0_recurrent": In(1),
            "neurons_read_address": In(max((config.neuron_words - 1).bit_length(), 1)),
            "neurons_read_data": In(config.neuron_bits),
            "lane_0_add_valid": In(1),
            "held_bias": In(signed(config.bias_bits)),
            "state": In(3),
            "spikes": In(config.hidden),
            "ring": In(config.classes * config.output_bits),
        }

    def drive(self, m: Module, free: Callable[[str, int], Signal]) -> set[str]:
        most, taken = self.config.events_per_bin, self.event_valid & self.event_ready
        events = self.count_to(m, most, self.bin_end | self.scan_start, taken, name="events_of_bin")
        m.d.comb += self.event_valid.eq(free("event_valid", 1) & (events != most))
        return {"event_valid"}

    def _look(self, m: Module) -> None:
        """Define the signals that both checkers use."""
        config = self.config
        clears = config.hidden + config.classes + 2
        self.taken = self.event_valid & self.event_ready
        events = self.count_to(m, config.events_per_bin + 1, self.bin_end | self.scan_start, self.taken)
        self.suppose(m, "events_fit", events <= config.events_per_bin)
        self.left = Signal(range(clears + 1), init=clears)
        m.d.sync += self.left.eq(Mux(self.scan_start, clears, self.left - (self.left != 0)))
        self.recurrent = self.lane_0_recurrent
        self.source, self.added_word = self._row(m)
        compared = before(m, (self.state == State.NEURONS.value) & ~self.scan_start, "neuron_read")
        self.sets = before(m, compared & ~self.scan_start, "neuron_compared")
        word = self._read(m, "neurons")
        self.word, self.number = word, word[: config.neuron_row_bits]
        fires = self.fires if config.layers else self.spikes[0]
        self.spike = before(m, (self.state == State.SPIKES.value) & fires & ~self.scan_start, "spike")
        self.clears = before(m, (self.left != 0) & (self.left <= config.classes) & ~self.scan_start, "clears")
        self.output = self.output_valid | self.clears
        turns = self.spike | self.output
        self.turn = Signal(range(max(config.classes, 2)))
        self.keep(m, self.turn, self.scan_start, turns, Mux(self.turn == config.classes - 1, 0, self.turn + 1))

    def _read(self, m: Module, memory: str) -> Signal:
        """Return the address of the word that a memory gives."""
        address = getattr(self, f"{memory}_read_address")
        read = Signal.like(address, name=f"{memory}_read")
        with m.If(getattr(self, f"{memory}_read_valid")):
            m.d.sync += read.eq(address)
        return read

    def _row(self, m: Module) -> tuple[Value, Value]:
        """Return the row whose word is added, events behind the hidden neurons, and the word of potentials it changes.

        In a stack, the rows of recurrent weights follow each other, and begin at the first word that they change.
        """
        config = self.config
        event, spike = self._read(m, "inputs"), self._read(m, "recurrent")
        if not config.layers:
            read = Mux(self.recurrent, spike, event + config.recurrent_words)
            return read[config.row_bits :], read[: config.row_bits]
        rows = [
            (neuron, first + word)
            for group, (first, words) in zip(config.stack, config.spans, strict=True)
            for neuron in range(group.start, group.end)
            for word in range(words)
        ]
        sources, places = (
            pick(Array(Const(value, 8) for value in values), spike) for values in zip(*rows, strict=True)
        )
        source = Mux(self.recurrent, sources, (event >> config.row_bits) + config.hidden)
        return source, Mux(self.recurrent, places, event[: config.row_bits])

    def _exists(self, row: Value, word: Value) -> Value:
        """Return whether a row has a word for the given word of potentials."""
        config = self.config
        found = (word < config.groups) & (row < config.hidden + config.inputs)
        if not config.layers:
            return found
        found &= row >= config.hidden
        for group, (first, words) in zip(config.stack, config.spans, strict=True):
            found |= (row >= group.start) & (row < group.end) & (word >= first) & (word < first + words)
        return found

    def _added(self, m: Module, neuron: Any, name: str) -> tuple[Value, Value, Signal, Signal]:
        """Return whether a neuron gets a weight, whether it is preset, and the rows and events added in this bin."""
        config = self.config
        place = config.lanes.bit_length() - 1
        adds = self.lane_0_add_valid & (self.added_word == neuron >> place)
        sets = self.sets & (self.hidden_index == neuron)
        rows = self._count(m, adds & self.recurrent, sets, config.hidden, f"rows_added{name}")
        events = self._count(m, adds & ~self.recurrent, sets, config.events_per_bin, f"events_added{name}")
        return adds, sets, rows, events

    def _weights(self, m: Module, number: Any, name: str) -> Signal:
        """Return the number of weights that an output received in this bin."""
        own = self.turn == number
        return self._count(m, self.spike & own, self.output & own, self.config.hidden, f"weights_added{name}")

    def _count(self, m: Module, more: Value, ends: Value, most: int, name: str) -> Signal:
        """Return the number of additions in a bin, counted up to one above the limit."""
        return self.count_to(m, most + 1, ends | self.scan_start, more, name=name)


class ScheduleChecker(_ClassifierChecker):
    """Checker of addresses and timing; the potentials in the lanes are free."""

    cut = (*MEMORIES, "eskin_lane")

    def check(self, m: Module) -> Promises:
        self._look(m)
        self.compared = self.hidden_valid & (self.hidden_index == self.watch)
        yield from self._rows(m)
        yield from self._outputs(m)
        yield from self._bins(m)
        yield from self._waits(m)

    def _rows(self, m: Module) -> Promises:
        """Track how often a watched word of weights must be added to the potentials."""
        config = self.config
        word = self.rival[: config.lane_bits]
        real = self._exists(self.watch, word)
        adds = self.lane_0_add_valid & (self.source == self.watch) & (self.added_word == word) & real
        arrives = self.taken & (self.port("event_channel") + config.hidden == self.watch) & real
        owed = Signal(3)
        self.keep(m, owed, self.scan_start, 1, Mux(self.compared, self.hidden_spike & real, owed + arrives - adds))
        judged = self.hidden_valid & ((self.watch >= config.hidden) | (self.hidden_index == self.watch)) & real
        had = Signal()
        with m.If(adds | judged):
            m.d.sync += had.eq(adds)
        yield "added_when_owed", implies(adds, owed != 0), adds
        yield "none_left_out", implies(judged, owed == 0), judged & had
        _, _, rows, events = self._added(m, self.watch, "")
        fits = (rows <= config.hidden) & (events <= config.events_per_bin)
        yield "rows_fit", fits | (self.watch >= config.hidden), events == config.events_per_bin

    def _outputs(self, m: Module) -> Promises:
        """Track the output weight of a watched neuron and class, and the order of the classes."""
        config = self.config
        bits = config.neuron_row_bits
        address = Cat(Cat(self.rival, Const(0, bits))[:bits] if bits else Cat(), self.watch)
        adds = self.spike & (self.word == address) & (self.watch < config.hidden)
        shown = self.output_valid & (self.output_index == self.rival)
        owed = Signal(name="output_owed")
        read = self.watch >= config.stack[-1].start
        due = self.compared & self.hidden_spike & (self.rival < config.classes) & read
        self.keep(m, owed, self.scan_start, self.compared | adds, due)
        yield "spike_counted", implies(adds, owed) & implies(shown, ~owed), adds
        ordered = implies(self.output, self.output_index == self.turn) & implies(self.spike, self.number == self.turn)
        aligned = implies(self.class_valid, self.turn == 0)
        fits = self._weights(m, self.rival, "") <= config.hidden
        yield "outputs_in_turn", ordered & aligned & fits, self.spike & (self.turn == config.classes - 1)

    def _bins(self, m: Module) -> Promises:
        """Count unanswered bins, and the waiting time of the oldest."""
        longest = self._longest
        bins, more = Signal(3), Signal(4)
        m.d.comb += more.eq(bins + self.bin_end - (self.class_valid & (bins != 0)))
        m.d.sync += bins.eq(Mux(self.scan_start, 0, Mux(more > 7, 7, more)))
        yield "class_per_bin", implies(self.class_valid, bins != 0), self.class_valid
        age = Signal(range(longest + 2))
        m.d.sync += age.eq(Mux(self.class_valid | self.scan_start | (bins == 0), 0, age + (age <= longest)))
        late = implies(~self.overrun, (age <= longest) & (bins <= 2))
        yield "class_in_time", late, self.class_valid & ~self.overrun
        waiting = before(m, bins, "bins") - before(m, self.class_valid, "answered") - self.class_valid
        busy = before(m, self.left != 0, "clearing") | (waiting > 0)
        rises = before(m, self.bin_end, "bin_end") & busy
        begun = Signal()
        m.d.sync += begun.eq(1)
        old = before(m, self.overrun, "overrun")
        reset = before(m, self.scan_start, "scan_start")
        exact = self.overrun == (~reset & (old | rises))
        yield "overrun_exact", implies(begun, exact), rises & ~reset & ~old

    @property
    def _longest(self) -> int:
        """Largest number of clocks from the end of a bin to its class."""
        config = self.config
        hidden, classes, groups = config.hidden, config.classes, config.groups
        return groups + 1 + hidden * config.lane_words + hidden + 2 + hidden * classes + classes + 2

    def _waits(self, m: Module) -> Promises:
        """Count the clocks in which no event is taken."""
        config = self.config
        most = config.groups + 2 * self._longest + config.hidden + config.classes + 2
        waits = self.count_to(m, most + 1, self.event_ready | self.bin_end | self.scan_start, 1)
        yield "ready_in_time", waits <= most, self.event_ready & (waits > config.hidden)
        stalls = self.count_to(m, (1 << STALL_BITS) - 1, self.scan_start, self.event_valid & ~self.event_ready)
        yield "stalls_counted", self.stall_count == stalls, stalls != 0


class SumsChecker(_ClassifierChecker):
    """Checker of sums: a reference adder beside the classifier."""

    only: ClassVar[Mapping[str, Callable[[Any], Any]]] = {"sure_by_the_margin": lambda config: config.margin}

    def inner(self, config: ClassifierConfig) -> dict[str, Any]:
        found = super().inner(config) | {"most": In(signed(config.evidence_bits)), "best": In(config.class_bits)}
        if config.synapse_shift:
            bits, address = signed(config.membrane_bits), address_bits(config.hidden)
            found |= dict.fromkeys(("held_potential", "next_potential", "potentials_write_data"), In(bits))
            found |= {"potentials_read_data": In(bits), "potentials_write_valid": In(1)}
            found |= dict.fromkeys(("potentials_read_address", "potentials_write_address"), In(address))
        if config.out_synapse_shift:
            found["rest_ring"] = In(config.classes * config.output_bits)
        if config.margin:
            found["apart"] = In(1)
        if config.own_parameters:
            found |= {"held_threshold": In(config.threshold_bits), "held_leak": In(OWN_SHIFT_BITS)}
            found |= {"parameters_read_data": In(config.parameter_bits), "parameters_read_valid": In(1)}
            found["parameters_read_address"] = In(address_bits(config.parameter_words))
        return found

    def check(self, m: Module) -> Promises:
        config = self.config
        self._look(m)
        now = implies(self.output, self.output_index == self.turn) & implies(self.spike, self.number == self.turn)
        now &= implies(self.class_valid, self.turn == 0)
        added = [self._added(m, number, f"_{number}") for number in range(config.hidden)]
        weights = [self._weights(m, number, f"_{number}") for number in range(config.classes)]
        for _, _, rows, events in added:
            now &= (rows <= config.hidden) & (events <= config.events_per_bin)
        for count in weights:
            now &= count <= config.hidden
        fitted = Signal(init=1)
        self.fits = now & fitted
        m.d.sync += fitted.eq(self.fits)
        self.ended = self.count_to(m, config.delay_bins, self.scan_start, self.class_valid, name="ended")
        yield from self._neurons(m, added)
        evidence = yield from self._outputs(m, weights)
        yield from self._class(m, evidence)

    def _begun(self, m: Module, begins: Value, name: str) -> Signal:
        """Return whether a given condition has occurred since the start of the scan."""
        begun = Signal(name=f"{name}_begun")
        return self.keep(m, begun, self.scan_start, begins, 1)

    def _neurons(self, m: Module, added: list[tuple[Value, Value, Signal, Signal]]) -> Promises:
        config = self.config
        bits = config.membrane_bits
        least, most = config.hidden_range or (0, 0)
        good: Value = Const(1)
        fires: Value = Const(0)
        synapse = Leak(config.synapse_shift, config.synapse_factor)
        threshold, leak, arriving = self._parameters(config.threshold, Leak(config.leak_shift, config.leak_factor))
        rested = before(m, _leaked(self.potentials_read_data, arriving), "rested") if synapse.shift else None
        for number, (adds, sets, rows, events) in enumerate(added):
            total = Signal(signed(bits), name=f"potential_{number}")  # or the synaptic current, if there is one
            group = next(place for place, group in enumerate(config.stack) if number < group.end)
            v, enough = (total, Const(1)) if rested is None else _limited(rested + total, bits, config.saturates)
            own: Value = total
            if group:  # it rests until the first bin has come through the groups before it
                v, own = Mux(self.ended < group, 0, v), Mux(self.ended < group, 0, total)
            kept_after = Leak(0) if synapse.shift else leak  # the leak of a potential in memory follows when it is read
            held, spike, rest = self._fired(m, v, threshold, config.floor, kept_after, f"neuron_{number}")
            left = _leaked(own, synapse) if synapse.shift else rest
            of_event, of_spike = (
                word.word_select(number % config.lanes, bits_of_one).as_signed()
                for word, bits_of_one in (
                    (self.inputs_read_data, config.in_bits),
                    (self.recurrent_read_data, config.rec_bits),
                )
            )
            plus = Mux(self.recurrent, of_spike << config.rec_shift, of_event << config.in_shift)
            kept = Mux(self.hidden_valid, left, 0)
            exact = Signal(signed(bits + SPARE_BITS), name=f"sum_{number}")
            m.d.comb += exact.eq(Mux(sets, kept + (self.held_bias << config.bias_shift), total + plus))
            value, fit = _limited(exact, bits, config.saturates)
            with m.If(sets | adds):
                m.d.sync += total.eq(value)
            begun = self._begun(m, sets, f"neuron_{number}")
            shown = self.hidden_valid & (self.hidden_index == number)
            good &= implies(shown, (self.hidden_potential == held) & (self.hidden_spike == spike) & begun)
            good &= implies(sets | (adds & begun), fit)
            if synapse.shift:
                good &= implies(sets, self.potentials_write_data == Mux(self.hidden_valid, rest, 0))
                good &= implies(shown, enough)
            fires |= shown & spike
            if not config.saturates:
                coming, left = config.events_per_bin - events, config.hidden - rows
                low = coming * lowest(config.in_bits, config.in_shift) + left * lowest(
                    config.rec_bits, config.rec_shift
                )
                high = coming * highest(config.in_bits, config.in_shift)
                high += left * highest(config.rec_bits, config.rec_shift)
                good &= implies(begun, (total + low >= least) & (total + high <= most))
        if synapse.shift:
            good &= self._currents(m)
        good &= self._placed(m)
        yield "neuron_exact", implies(self.fits, good), fires

    def _parameters(self, threshold: int, leak: Leak) -> tuple[Any, Any, Any]:
        """Return the threshold and leak that are compared, and the leak that arrives from the memory."""
        if not self.config.own_parameters:
            return threshold, leak, leak
        bits = self.config.threshold_bits
        return self.held_threshold[: threshold.bit_length()], self.held_leak, self.parameters_read_data[bits:]

    def _placed(self, m: Module) -> Value:
        """Return whether each hidden neuron and output has its own bias, and its own threshold and leak."""
        config = self.config
        bias, row = self.neurons_read_data[: config.bias_bits], Const(config.classes, config.neuron_row_bits)
        of_neuron = self.held_bias.as_unsigned() == before(m, bias, "bias")
        of_neuron &= before(m, self.word, "bias_address") == Cat(row, self.hidden_index)
        of_output = self.word == Cat((row + 1)[: len(row)], self.output_index)
        biased = implies(self.sets, of_neuron) & implies(self.output, of_output)
        if not config.own_parameters:
            return biased
        read = self._read(m, "parameters")
        held = Cat(self.held_threshold, self.held_leak) == before(m, self.parameters_read_data, "parameters")
        address = Mux(self.output, Cat(1, self.output_index), Cat(0, self.hidden_index))
        own = held & (before(m, read, "parameters_address") == address)
        return biased & implies(self.sets | self.output, own)

    def _currents(self, m: Module) -> Value:
        """Return whether each neuron uses its own memory word, and whether no current grows without a bias."""
        number = before(m, before(m, self.potentials_read_address, "read"), "read_before")
        placed = (number == self.hidden_index) & (self.potentials_write_address == self.hidden_index)
        placed = implies(self.sets, placed) & (self.potentials_write_valid == self.sets)
        old, new = self.held_potential, self.next_potential
        decays = Mux(old < 0, (new >= old) & (new <= 0), (new <= old) & (new >= 0))
        return placed & implies(self.hidden_valid & (self.held_bias == 0), decays)

    def _outputs(self, m: Module, weights: list[Signal]) -> Generator[tuple[str, Any, Any], None, list[Signal]]:
        """Track the output potentials; return the evidence of each class."""
        config = self.config
        bits, fires = config.output_bits, config.readout == "spikes"
        leak = Leak(config.out_leak_shift, config.out_leak_factor)
        threshold, leak, _ = self._parameters(config.out_threshold, leak)
        threshold, floor = (threshold, config.out_floor) if fires else (None, None)
        least, most = config.output_range or (0, 0)
        bias = self.neurons_read_data[: config.bias_bits].as_signed() << config.out_bias_shift
        weight = self.neurons_read_data[: config.out_bits].as_signed() << config.out_shift
        good: Value = Const(1)
        good_evidence: Value = Const(1)
        moved: Value = Const(0)
        synapse = Leak(config.out_synapse_shift, config.out_synapse_factor)
        found = []
        passed = Signal.like(self.turn)  # the class whose evidence is added next
        self.keep(m, passed, self.scan_start, self.output, Mux(passed == config.classes - 1, 0, passed + 1))
        for number, count in enumerate(weights):
            own = self.turn == number
            total = Signal(signed(bits), name=f"output_{number}")
            gathered: Value = Mux(self.ended < config.delay_bins, 0, total) if config.layers else total
            v = gathered
            if synapse.shift:
                rested = Signal(signed(bits), name=f"output_rest_{number}")
                v, _ = _limited(rested + gathered, bits, config.output_saturates)
            held, fired, rest = self._fired(m, v, threshold, floor, leak, f"output_{number}")
            stays: Value = rest
            if synapse.shift:
                stays = _leaked(gathered, synapse)
                self.keep(m, rested, self.scan_start, self.output & own, Mux(self.clears, 0, rest))
                rested_there = self._in_turn(self.rest_ring, bits, number, passed) == rested
            exact = Signal(signed(bits + SPARE_BITS), name=f"output_sum_{number}")
            m.d.comb += exact.eq(Mux(self.output, Mux(self.clears, 0, stays) + bias, total + weight))
            value, fit = _limited(exact, bits, config.output_saturates)
            with m.If(own & (self.output | self.spike)):
                m.d.sync += total.eq(value)
            begun = self._begun(m, self.output & own, f"output_{number}")
            shown = self.output_valid & own
            good &= implies(shown, (self.output_potential == held) & begun)
            good &= implies(own & (self.output | (self.spike & begun)), fit)
            if fires:
                good &= implies(shown, self.output_spike == fired)
            good &= implies(begun, self._in_turn(self.ring, bits, number, self.turn) == total)
            if synapse.shift:
                good &= implies(begun, rested_there)
            if not config.output_saturates:
                low = (config.hidden - count) * lowest(config.out_bits, config.out_shift)
                high = (config.hidden - count) * highest(config.out_bits, config.out_shift)
                good &= implies(begun, (total + low >= least) & (total + high <= most))

            gained: Value = Cat(fired, Const(0, 1)).as_signed() if fires else held
            evidence = Signal(signed(config.evidence_bits), name=f"evidence_{number}")
            more, _ = _limited(evidence + gained, config.evidence_bits, True)
            self.keep(m, evidence, self.scan_start, shown, more)
            good_evidence &= implies(
                begun, self._in_turn(self.evidence, config.evidence_bits, number, passed) == evidence
            )
            moved |= evidence != 0
            found.append(evidence)
        yield "output_exact", implies(self.fits, good), self.output_valid & (self.output_potential != 0)
        yield "evidence_exact", implies(self.fits, good_evidence), self.class_valid & moved
        return found

    def _in_turn(self, ring: Value, bits: int, number: int, turn: Signal) -> Value:
        """Return the word of a class in a ring after a number of rotations."""
        count = self.config.classes
        words = [ring.word_select((number - turned) % count, bits) for turned in range(count)]
        return Array([*words, *words[:1] * ((1 << len(turn)) - count)])[turn].as_signed()

    def _class(self, m: Module, evidence: list[Signal]) -> Promises:
        """Check the reported class, and the class with the most evidence so far."""
        config = self.config

        def first(index: Value, most: Value, passed: Any) -> Value:
            good: Value = Const(1)
            for number, value in enumerate(evidence):
                best = Mux(number == index, value == most, Mux(number < index, value < most, value <= most))
                good &= implies(number < passed, best)
            return good & (index < passed)

        passing = self._begun(m, Const(0), "no_class")
        with m.If(self.output & ~self.scan_start):
            m.d.sync += passing.eq(self.turn != config.classes - 1)
        chosen = Array(evidence)[self.class_index]
        found = self._begun(m, self.class_valid, "class")
        held = implies(found & ~self.class_valid, self.class_index == before(m, self.class_index, "class"))
        good = implies(self.class_valid, first(self.class_index, chosen, config.classes)) & held
        good &= implies(passing, first(self.best, self.most, self.turn))
        changes = self.class_valid & (self.class_index == config.classes - 1)
        yield "first_of_most", implies(self.fits, good), changes
        if config.margin:
            yield from self._margin(m, evidence, passing)

    def _margin(self, m: Module, evidence: list[Signal], passing: Signal) -> Promises:
        """Check that an early decision comes with the first class far above all others, and stays."""

        def leads(index: Value, passed: Any) -> Value:
            most, good = Array(evidence)[index], Const(1)
            for number, value in enumerate(evidence):
                good &= (number == index) | (number >= passed) | (value + self.config.margin <= most)
            return good

        decided, sure = self.class_valid & leads(self.class_index, self.config.classes), Signal()
        self.keep(m, sure, self.scan_start, decided, 1)
        passes = implies(passing, self.apart == leads(self.best, self.turn))
        good = (self.class_sure == sure | decided) & passes
        yield "sure_by_the_margin", implies(self.fits, good), decided & ~sure

    def _fired(
        self, m: Module, v: Value, threshold: Any, floor: int | None, leak: Any, name: str
    ) -> tuple[Value, Value, Signal]:
        """Return the clipped potential, its spike, and the potential after reset and leak."""
        reset = self.config.neuron_reset
        held = Signal(v.shape(), name=f"{name}_held")
        rest = Signal(v.shape(), name=f"{name}_rest")
        m.d.comb += held.eq(v if floor is None else Mux(v < floor, floor, v))
        spike: Value = held > threshold if threshold is not None else Const(0)
        less = 0 if threshold is None else threshold
        after = {"zero": Const(0), "subtract": _leaked(held - less, leak), "delayed": _leaked(held, leak) - less}[reset]
        m.d.comb += rest.eq(Mux(spike, after, _leaked(held, leak)))
        return held, spike, rest


def _leaked(value: Value, leak: Any) -> Value:
    """Return a potential or a current after its leak: a ``Leak``, or a shift in hardware."""
    if isinstance(leak, Value):
        return value - Mux(leak == 0, 0, value >> leak)
    return value - (value * leak.factor >> leak.shift) if leak.shift else value


def _limited(value: Value, bits: int, saturates: bool) -> tuple[Value, Value]:
    """Return a signed value limited or truncated to a width, and whether it fits (always true if limited)."""
    low, high = -(1 << bits - 1), (1 << bits - 1) - 1
    if saturates:
        return Mux(value < low, low, Mux(value > high, high, value)), Const(1)
    return value[:bits].as_signed(), (value >= low) & (value <= high)
