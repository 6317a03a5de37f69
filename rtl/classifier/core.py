"""Classifier core: address events in, a class at the end of every bin (docs/reference/classifier.md)."""

from enum import Enum
from typing import Any

from amaranth.hdl import Cat, Const, Module, Mux, Signal, Value, signed
from amaranth.lib.wiring import In, Out

from eskin.model.classifier.config import OWN_SHIFT_BITS, ClassifierConfig, Leak, highest
from eskin.rtl.block import Block, numbered
from eskin.rtl.classifier.lane import Lane
from eskin.rtl.classifier.memory import (
    InputMemory,
    NeuronMemory,
    ParameterMemory,
    PotentialMemory,
    RecurrentMemory,
    WordMemory,
    address_bits,
)
from eskin.rtl.classifier.numbers import add, fire, leak

STALL_BITS = 24


class State(Enum):
    """States of the memory address sequencer; the arithmetic follows one clock later."""

    IDLE = 0
    EVENT = 1
    RECURRENT = 2
    NEURONS = 3
    GAP = 4
    SPIKES = 5
    OUTPUTS = 6


class Classifier(Block[ClassifierConfig]):
    """The integer network as a two-stage pipeline: memory address, then arithmetic.

    The comparison of a neuron takes another clock, so that no path contains both the choice of a potential and the
    comparison.

    An event is a row of weights, read in ``groups`` clocks. At a bin's end: the rows of the neurons that fired in the
    bin before, every hidden neuron, the output weights of those that fire now, every output. Spikes, output
    potentials and evidence are in rings that turn while the work passes through their numbers.

    For neurons with a synaptic current, the lanes or the ring of the outputs hold the current. A memory or a second
    ring holds their potentials, which change only when a neuron is compared.

    ``CLASSIFIER_PORTS`` in ``rtl/delivery.py`` describes every port.
    """

    module_name = "eskin_classifier"

    def __init__(self, config: ClassifierConfig) -> None:
        words = max(config.weight_words, config.neuron_words)
        bits = max(config.lanes * config.weight_bits, config.neuron_bits)
        super().__init__(
            config,
            {
                "load_valid": In(1),
                "load_neurons": In(1),
                "load_address": In(address_bits(words)),
                "load_data": In(bits),
                "event_valid": In(1),
                "event_ready": Out(1),
                "event_channel": In(config.channel_bits) if config.channel_bits else None,
                "bin_end": In(1),
                "scan_start": In(1),
                "class_valid": Out(1),
                "class_index": Out(config.class_bits),
                "class_sure": Out(1) if config.margin else None,
                "evidence": Out(config.classes * config.evidence_bits),
                "overrun": Out(1),
                "stall_count": Out(STALL_BITS),
                "hidden_valid": Out(1),
                "hidden_index": Out(max((config.hidden - 1).bit_length(), 1)),
                "hidden_potential": Out(signed(config.membrane_bits)),
                "hidden_spike": Out(1),
                "output_valid": Out(1),
                "output_index": Out(config.class_bits),
                "output_potential": Out(signed(config.output_bits)),
                "output_spike": Out(1) if config.readout == "spikes" else None,
            },
        )
        self._registers()

    def _registers(self) -> None:
        config = self.config
        self.state = Signal(State, init=State.NEURONS)
        self.clearing = Signal(init=1)
        self.pending = Signal()
        self.working = Signal()
        self.index = Signal(range(max(config.hidden, config.inputs, config.classes, 2)))
        self.step = Signal(range(max(config.lane_words, config.classes, 2)))
        self.fires = Signal()
        self.spikes = Signal(config.hidden)
        # One clock later:
        self.now_adds, self.now_recurrent = Signal(), Signal()
        self.now_neuron, self.now_spike, self.now_output = Signal(), Signal(), Signal()
        self.now_clears, self.now_last = Signal(), Signal()
        self.held_neuron, self.held_clears = Signal(), Signal()
        self.held_index = Signal(range(max(config.hidden, 2)))
        self.held_potential = Signal(signed(config.membrane_bits))
        self.held_bias = Signal(signed(config.bias_bits))
        self.next_potential = Signal(signed(config.membrane_bits))
        self.now_index = Signal(range(max(config.hidden, config.classes, 2)))
        self.now_step = Signal(range(max(config.lane_words, 2)))
        self.class_found, self.class_ready = Signal(config.class_bits), Signal()
        self.ring = Signal(config.classes * config.output_bits)
        self.evidence_ring = Signal(config.classes * config.evidence_bits)
        if config.layers:
            self.group, self.passes = Signal(range(len(config.layers))), Signal()
            self.ended = Signal(range(len(config.layers)))
            self.row = Signal(address_bits(config.recurrent_words))
            self.now_waits = Signal()
        if config.own_parameters:
            self.held_threshold = Signal(config.threshold_bits)
            self.held_leak = Signal(OWN_SHIFT_BITS)
        if config.synapse_shift:
            self.held_rest = Signal(signed(config.membrane_bits))
        if config.out_synapse_shift:
            self.rest_ring = Signal(config.classes * config.output_bits)

    def elaborate(self, platform: Any) -> Module:
        m = Module()
        config = self.config
        inputs, recurrent, neurons = InputMemory(config), RecurrentMemory(config), NeuronMemory(config)
        inputs.place(m, "inputs", platform)
        recurrent.place(m, "recurrent", platform)
        neurons.place(m, "neurons", platform)
        behind = self.load_address >= config.recurrent_words
        address = (self.load_address - config.recurrent_words)[: len(self.load_address)]
        self._load(m, inputs, ~self.load_neurons & behind, address, self._weights(self.load_data, config.in_bits))
        self._load(
            m,
            recurrent,
            ~self.load_neurons & ~behind,
            self.load_address,
            self._weights(self.load_data, config.rec_bits),
        )
        self._load(m, neurons, self.load_neurons, self.load_address, self.load_data)
        own = self._parameters(m, platform) if config.own_parameters else None
        word = Mux(self.state == State.NEURONS, config.classes, self.step)
        word = Mux(self.state == State.OUTPUTS, config.classes + 1, word)
        row = Cat(self.step[: config.row_bits], self.index)
        self._fires(m)
        m.d.comb += [
            inputs.read_address.eq(row[: len(inputs.read_address)]),
            recurrent.read_address.eq(self.row if config.layers else row[: len(recurrent.read_address)]),
            neurons.read_address.eq(Cat(word[: config.neuron_row_bits], self.index)),
            inputs.read_valid.eq(self.state == State.EVENT),
            recurrent.read_valid.eq((self.state == State.RECURRENT) & self.fires),
            neurons.read_valid.eq(
                (self.state == State.NEURONS)
                | (self.state == State.OUTPUTS)
                | ((self.state == State.SPIKES) & self.fires)
            ),
        ]
        self._awake(m)
        self._control(m)
        potential = self._lanes(m, inputs.read_data, recurrent.read_data, platform)
        self._hidden(m, potential, neurons.read_data, own, platform)
        self._outputs(m, neurons.read_data)
        return m

    def _parameters(self, m: Module, platform: Any) -> Value:
        """Place the memory of thresholds and leaks, and return the leak that arrives.

        The host writes a word together with the bias: the upper bits of the words behind the output weights. The word
        of an output is read one clock before its turn, so that its parameters come from a register.
        """
        config = self.config
        parameters = ParameterMemory(config)
        parameters.place(m, "parameters", platform)
        word, neuron = self.load_address[: config.neuron_row_bits], self.load_address[config.neuron_row_bits :]
        of_output = word == config.classes + 1
        chosen = self.load_neurons & ((word == config.classes) | of_output)
        self._load(m, parameters, chosen, Cat(of_output, neuron), self.load_data[config.neuron_weight_bits :])
        compares, gives = self.state == State.NEURONS, self.state == State.OUTPUTS
        following = Mux(gives, self.index + 1, 0)[: config.class_bits]
        row = Mux(compares, Cat(0, self.index), Cat(1, following))
        m.d.comb += [
            parameters.read_address.eq(row[: len(parameters.read_address)]),
            parameters.read_valid.eq(compares | gives | (self.state == State.GAP)),
        ]
        bits, read = config.threshold_bits, parameters.read_data
        with m.If(self.now_neuron | gives):
            m.d.sync += [self.held_threshold.eq(read[:bits]), self.held_leak.eq(read[bits:])]
        return read[bits:]

    def _fires(self, m: Module) -> None:
        """Define whether a neuron fired whose spike adds weights; in a stack, find group, row and begin of each neuron.

        The outputs read the last group alone, which other groups need not read. The rows of a stack follow each other,
        so that a counter passes through them. A group begins when the first bin has passed through those before it.
        """
        config = self.config
        if not config.layers:
            self.fires = self.spikes[0]
            return
        stack, spans = config.stack, config.spans
        last = self.group == len(stack) - 1
        wanted = Mux(self.state == State.SPIKES, last, 1 if spans[-1].words else ~last)
        m.d.comb += self.fires.eq(self.spikes[0] & wanted)
        steps = self._of_group(m, [span.words for span in spans], "words_of_row")
        with m.If(self.state == State.RECURRENT):
            m.d.sync += self.row.eq((self.row + Mux(self.fires, 1, steps))[: len(self.row)])
        with m.Elif(self.working):
            m.d.sync += self.row.eq(0)
        ends = self._of_group(m, [group.end - 1 for group in stack], "last_of_group")
        with m.If(self.passes & (self.index == ends)):
            m.d.sync += self.group.eq(Mux(last, 0, self.group + 1))
        done = (self.state == State.OUTPUTS) & (self.index == config.classes - 1) & ~self.clearing
        with m.If(done & (self.ended != len(stack) - 1)):
            m.d.sync += self.ended.eq(self.ended + 1)
        outputs_wait = self.ended != len(stack) - 1
        with m.If(self.working):
            m.d.sync += self.now_waits.eq(Mux(self.state == State.OUTPUTS, outputs_wait, self.ended < self.group))
        with m.If(self.scan_start):
            m.d.sync += [self.group.eq(0), self.ended.eq(0)]

    def _of_group(self, m: Module, values: list[int], name: str) -> Value:
        """Return the constant of the group of the current neuron."""
        found = Signal(range(max(*values, 1) + 1), name=name)
        with m.Switch(self.group):
            for number, value in enumerate(values[:-1]):
                with m.Case(number):
                    m.d.comb += found.eq(value)
            with m.Default():
                m.d.comb += found.eq(values[-1])
        return found

    def _awake(self, m: Module) -> None:
        """Add the signal ``awake``, which is low in clocks without a register change, so that the clock may stop.

        Outside IDLE every clock changes a register. In IDLE an event, the end of a bin, a scan_start or a load does,
        and the arithmetic that follows the last clock of work.
        """
        arrives = [self.event_valid, self.bin_end, self.scan_start, self.load_valid, self.pending]
        follows = [self.now_adds, self.now_neuron, self.now_spike, self.now_output, self.held_neuron, self.class_ready]
        follows += [self.clearing, self.now_clears]
        # No logic in this block uses the signal; a clock gate or a simulation may.
        awake = Signal(attrs={"keep": 1})
        m.d.comb += [
            self.working.eq(self.state != State.IDLE),
            awake.eq(self.working | Cat(arrives).any() | Cat(follows).any()),
        ]

    def _load(self, m: Module, memory: WordMemory, chosen: Value, address: Value, data: Value) -> None:
        """Connect the write port of a memory to the host."""
        m.d.comb += [
            memory.write_valid.eq(self.load_valid & chosen),
            memory.write_address.eq(address[: len(memory.write_address)]),
            memory.write_data.eq(data[: len(memory.write_data)]),
        ]

    def _weights(self, word: Value, bits: int) -> Value:
        """Return a loaded word with each weight cut to a bit width."""
        return Cat(word[lane * self.config.weight_bits :][:bits] for lane in range(self.config.lanes))

    # -- which address in which clock ------------------------------------------------------------

    def _control(self, m: Module) -> None:
        config = self.config
        fired = self.fires
        row_ends: Value = self.step == config.groups - 1
        if config.layers:
            ends = self._of_group(m, [max(span.words - 1, 0) for span in config.spans], "last_of_row")
            row_ends = self.step == Mux(self.state == State.RECURRENT, ends, config.groups - 1)
        spike_ends = self.step == config.classes - 1
        last_neuron = self.index == config.hidden - 1
        ending = Signal()
        free = Signal()
        advance = Signal()
        m.d.comb += [
            ending.eq((self.state != State.IDLE) & (self.state != State.EVENT)),
            free.eq((self.state == State.IDLE) | ((self.state == State.EVENT) & row_ends)),
            self.event_ready.eq(free & ~self.pending),
        ]
        with m.If(self.working):
            m.d.sync += self.step.eq((self.step + 1)[: len(self.step)])
        with m.If(self.bin_end):
            m.d.sync += self.pending.eq(1)
        with m.Switch(self.state):
            with m.Case(State.IDLE, State.EVENT), m.If(free):
                with m.If(self.working):
                    m.d.sync += [self.step.eq(0), self.state.eq(State.IDLE)]
                with m.If(self.pending):
                    m.d.sync += [self.pending.eq(self.bin_end), self.state.eq(State.RECURRENT), self.index.eq(0)]
                with m.Elif(self.event_valid):
                    channel = self.event_channel if config.channel_bits else 0
                    m.d.sync += [self.state.eq(State.EVENT), self.index.eq(channel)]
            with m.Case(State.RECURRENT):
                m.d.comb += advance.eq(~fired | row_ends)
                with m.If(advance):
                    self._next(m, last_neuron, State.NEURONS)
            with m.Case(State.NEURONS):
                self._next(m, last_neuron, State.GAP)
            with m.Case(State.GAP), m.If(self.step[0]):  # the spike of the last neuron is known after two clocks
                m.d.sync += [self.step.eq(0), self.state.eq(Mux(self.clearing, State.OUTPUTS, State.SPIKES))]
            with m.Case(State.SPIKES):
                m.d.comb += advance.eq(~fired | spike_ends)
                with m.If(advance):
                    self._next(m, last_neuron, State.OUTPUTS)
            with m.Default():  # OUTPUTS, and an unused state code, which ends as well
                self._next(m, self.index == config.classes - 1, State.IDLE)
        self._ring(m, advance)
        self._execute(m, fired)
        with m.If((self.state == State.OUTPUTS) & (self.index == config.classes - 1)):
            m.d.sync += self.clearing.eq(0)

        with m.If(self.bin_end & (self.pending | ending)):
            m.d.sync += self.overrun.eq(1)
        stalls = Signal(STALL_BITS + 1)
        m.d.comb += stalls.eq(self.stall_count + 1)
        with m.If(self.event_valid & ~self.event_ready & ~stalls[-1]):
            m.d.sync += self.stall_count.eq(stalls[:-1])
        with m.If(self.scan_start):
            m.d.sync += [self.state.eq(State.NEURONS), self.clearing.eq(1), self.index.eq(0), self.step.eq(0)]
            m.d.sync += [self.pending.eq(0), self.overrun.eq(0), self.stall_count.eq(0)]

    def _next(self, m: Module, last: Value, state: State) -> None:
        """Advance to the next number, or from the last number to the next state."""
        if self.config.layers and state != State.IDLE:  # outputs belong to no group
            m.d.comb += self.passes.eq(1)
        m.d.sync += [self.index.eq((self.index + 1)[: len(self.index)]), self.step.eq(0)]
        with m.If(last):
            m.d.sync += [self.index.eq(0), self.state.eq(state)]

    def _ring(self, m: Module, advance: Value) -> None:
        """Rotate the ring of spikes, and insert new spikes while the neurons are processed."""
        with m.If(advance):
            m.d.sync += self.spikes.eq(Cat(self.spikes[1:], self.spikes[0]))
        with m.Elif(self.held_neuron):
            m.d.sync += self.spikes.eq(Cat(self.spikes[1:], self.hidden_spike))

    def _execute(self, m: Module, fired: Value) -> None:
        """Register the operation for the memory words that arrive in the next clock."""
        config, goes_on = self.config, ~self.scan_start
        place = config.lanes.bit_length() - 1
        recurrent = (self.state == State.RECURRENT) & fired
        m.d.sync += [
            self.now_adds.eq(((self.state == State.EVENT) | recurrent) & goes_on),
            self.now_neuron.eq((self.state == State.NEURONS) & goes_on),
            self.now_spike.eq((self.state == State.SPIKES) & fired & goes_on),
            self.now_output.eq((self.state == State.OUTPUTS) & goes_on),
            self.now_clears.eq(self.clearing),
        ]
        with m.If(self.working):
            number = Mux(self.state == State.NEURONS, self.index >> place, self._word(m))
            m.d.sync += [
                self.now_recurrent.eq(recurrent),
                self.now_last.eq(self.index == config.classes - 1),
                self.now_index.eq(self.index[: len(self.now_index)]),
                self.now_step.eq(number[: len(self.now_step)]),
            ]

    def _word(self, m: Module) -> Value:
        """Return the number of the potentials in the lanes that a word of a row changes."""
        if not self.config.layers:
            return self.step
        first = self._of_group(m, [span.first for span in self.config.spans], "first_of_row")
        return self.step + Mux(self.state == State.RECURRENT, first, 0)

    # -- what is done with the words ---------------------------------------------------------------

    def _lanes(self, m: Module, inputs: Value, recurrent: Value, platform: Any) -> Value:
        """Add the weights of a word to the potentials of a group; return the potential of the current neuron.

        No multiplexer selects the neuron: in every clock of a comparison each lane takes the potential of the next
        lane, so the current neuron is in lane 0. Its potential after the reset is known one clock later and enters in
        the last lane but one. It reaches its own lane when the last neuron of the group is compared. The potential of
        the last neuron itself is written into the last lane one clock later, during the next group's first shift.
        """
        config = self.config
        place = config.lanes.bit_length() - 1
        lanes = [Lane(config) for _ in range(config.lanes)]
        # By the last lane of a full group, and of a shorter last group: is the group current, is its last neuron held?
        ends: dict[int, tuple[Value, Value]] = {}
        if config.hidden >= config.lanes:
            ends[config.lanes - 1] = Const(1), self.held_index[:place].all() if place else Const(1)
        if fewer := config.hidden % config.lanes:
            ends[fewer - 1] = self.now_step == config.lane_words - 1, self.held_index == config.hidden - 1
        for number, lane in enumerate(lanes):
            lane.place(m, numbered("lane", number, config.lanes), platform)
            shifts: Value = self.now_neuron
            value = lanes[number + 1].potential if number + 1 < config.lanes else self.next_potential
            group: Value = self.now_step
            if number + 1 in ends:
                in_turn, _ = ends[number + 1]
                value = Mux(in_turn & self.now_index[:place].any(), self.next_potential, value)
            if number in ends:
                _, last = ends[number]
                written = self.held_neuron & last
                if number + 1 < config.lanes:
                    shifts, value = shifts | written, Mux(written, self.next_potential, value)
                else:
                    shifts = written
                group = Mux(written, self.held_index >> place, group)
            m.d.comb += [
                lane.add_valid.eq(self.now_adds),
                lane.input_weight.eq(inputs.word_select(number, config.in_bits)),
                lane.recurrent_weight.eq(recurrent.word_select(number, config.rec_bits)),
                lane.recurrent.eq(self.now_recurrent),
                lane.set_valid.eq(shifts),
                lane.set_value.eq(value),
            ]
            if config.lane_bits:
                m.d.comb += [
                    lane.group.eq(self.now_step[: config.lane_bits]),
                    lane.set_group.eq(group[: config.lane_bits]),
                ]
        return lanes[0].potential

    def _hidden(self, m: Module, potential: Value, word: Value, own: Value | None, platform: Any) -> None:
        """Compare a neuron; ``own`` is the leak that arrives with ``potential``, if the neurons have their own."""
        config = self.config
        m.d.sync += self.held_neuron.eq(self.now_neuron & ~self.scan_start)
        with m.If(self.now_neuron):
            m.d.sync += [
                self.held_potential.eq(potential),
                self.held_bias.eq(word[: config.bias_bits]),
                self.held_index.eq(self.now_index[: len(self.held_index)]),
                self.held_clears.eq(self.now_clears),
            ]
        with m.If(self._rests):
            m.d.sync += self.held_potential.eq(0)
        v, bias = self.held_potential, self.held_bias << config.bias_shift
        threshold: int | Value = config.threshold
        leaks: Leak | Value = Leak(config.leak_shift, config.leak_factor)
        if own is not None:
            threshold, leaks = self.held_threshold[: config.threshold.bit_length()], self.held_leak
        if config.synapse_shift:
            v, leaks = add(m, self.held_rest, v, config.membrane_bits, config.saturates), Leak(0)
        held, spike, rest = fire(m, v, threshold, config.floor, config.neuron_reset, leaks)
        if config.synapse_shift:
            self._potentials(m, rest, Leak(config.leak_shift, config.leak_factor) if own is None else own, platform)
            rest = leak(m, self.held_potential, Leak(config.synapse_shift, config.synapse_factor))
        m.d.comb += [
            self.next_potential.eq(add(m, rest, bias, config.membrane_bits, config.saturates)),
            self.hidden_valid.eq(self.held_neuron & ~self.held_clears),
            self.hidden_index.eq(self.held_index),
            self.hidden_potential.eq(held),
            self.hidden_spike.eq(spike),
        ]

    @property
    def _rests(self) -> Value:
        """Condition under which the current neuron stays as at the start of a scan."""
        return self.now_clears | (self.now_waits & self.now_neuron) if self.config.layers else self.now_clears

    def _potentials(self, m: Module, rest: Value, leaks: Leak | Value, platform: Any) -> None:
        """Write back a potential after reset; read and leak the potential two neurons ahead."""
        config = self.config
        potentials = PotentialMemory(config)
        potentials.place(m, "potentials", platform)
        m.d.comb += [
            potentials.read_valid.eq(self.state == State.NEURONS),
            potentials.read_address.eq(self.index[: len(potentials.read_address)]),
            potentials.write_valid.eq(self.held_neuron),
            potentials.write_address.eq(self.held_index),
            potentials.write_data.eq(rest),
        ]
        kept = leak(m, potentials.read_data, leaks)
        with m.If(self.now_neuron):
            m.d.sync += self.held_rest.eq(kept)
        with m.If(self._rests):
            m.d.sync += self.held_rest.eq(0)

    def _outputs(self, m: Module, word: Value) -> None:
        config = self.config
        bits = config.output_bits
        own: Value = self.ring[:bits].as_signed()
        if config.layers:
            own = Mux(self.now_output & self.now_waits, 0, own)
        v: Value = own
        threshold: int | Value = config.out_threshold
        leaks: Leak | Value = Leak(config.out_leak_shift, config.out_leak_factor)
        if config.own_parameters:
            threshold, leaks = self.held_threshold[: config.out_threshold.bit_length()], self.held_leak
        if config.out_synapse_shift:
            v = add(m, self.rest_ring[:bits].as_signed(), own, bits, config.output_saturates)
        if config.readout == "spikes":
            held, spike, rest = fire(m, v, threshold, config.out_floor, config.neuron_reset, leaks)
            m.d.comb += self.output_spike.eq(spike)
            full = self.evidence_ring[: config.evidence_bits] == highest(config.evidence_bits)
            gained: Value = Cat(spike & ~full, 0).as_signed()
        else:
            held, rest, gained = v, leak(m, v, leaks), v
        if config.out_synapse_shift:
            with m.If(self.now_output):
                rested = Signal(signed(bits))
                m.d.comb += rested.eq(rest)
                m.d.sync += self.rest_ring.eq(Cat(self.rest_ring[bits:], rested))
            with m.If(self.scan_start):
                m.d.sync += self.rest_ring.eq(0)
            rest = leak(m, own, Leak(config.out_synapse_shift, config.out_synapse_factor))
        weight = word[: config.out_bits].as_signed() << config.out_shift
        bias = word[: config.bias_bits].as_signed() << config.out_bias_shift
        left = Signal(signed(bits))
        right = Signal(signed(max(len(weight), len(bias))))
        m.d.comb += [
            left.eq(Mux(self.now_output, rest, own)),
            right.eq(Mux(self.now_output, bias, weight)),
            self.output_valid.eq(self.now_output & ~self.now_clears),
            self.output_index.eq(self.now_index[: config.class_bits]),
            self.output_potential.eq(held),
        ]
        total = add(m, left, right, bits, config.output_saturates)
        with m.If(self.now_output | self.now_spike):
            m.d.sync += self.ring.eq(Cat(self.ring[bits:], total))
        with m.If(self.scan_start):
            m.d.sync += self.ring.eq(0)
        self._evidence(m, gained)

    def _evidence(self, m: Module, gained: Value) -> None:
        """Accumulate the evidence, and store the first class with the most evidence."""
        config = self.config
        bits = config.evidence_bits
        most = Signal(signed(bits))
        best = Signal(config.class_bits)
        better = Signal()
        evidence = Signal(signed(bits))
        m.d.comb += [
            evidence.eq(add(m, self.evidence_ring[:bits].as_signed(), gained, bits, config.readout == "membrane")),
            better.eq((self.now_index == 0) | (evidence > most)),
            self.evidence.eq(self.evidence_ring),
            self.class_index.eq(self.class_found),
            self.class_valid.eq(self.class_ready),
        ]
        if config.margin:
            self._margin(m, evidence, most, better)
        m.d.sync += self.class_ready.eq(self.now_output & self.now_last & ~self.now_clears & ~self.scan_start)
        with m.If(self.now_output):
            m.d.sync += self.evidence_ring.eq(Cat(self.evidence_ring[bits:], evidence))
            with m.If(better):
                m.d.sync += [most.eq(evidence), best.eq(self.now_index[: config.class_bits])]
            with m.If(self.now_last):
                m.d.sync += self.class_found.eq(Mux(better, self.now_index[: config.class_bits], best))
        with m.If(self.scan_start):
            m.d.sync += self.evidence_ring.eq(0)

    def _margin(self, m: Module, evidence: Value, most: Value, better: Value) -> None:
        """Raise ``class_sure`` when the most evidence exceeds all others by the margin.

        A class with more evidence than those before needs the margin to the largest of them. A class with less needs
        the margin too, and so must all since the largest.
        """
        bits = self.config.evidence_bits
        apart = Signal()
        leads = Signal()
        far = Signal()
        ahead = Signal(signed(bits + 1))
        m.d.comb += [
            ahead.eq(evidence - most),
            far.eq(Mux(ahead[-1], ahead <= -self.config.margin, ahead >= self.config.margin)),
            leads.eq((self.now_index == 0) | (far & (better | apart))),
        ]
        with m.If(self.now_output):
            m.d.sync += apart.eq(leads)
            with m.If(self.now_last & leads & ~self.now_clears):
                m.d.sync += self.class_sure.eq(1)
        with m.If(self.scan_start):
            m.d.sync += self.class_sure.eq(0)
