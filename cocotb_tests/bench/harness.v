// SPDX-License-Identifier: Apache-2.0
// Plays stimuli into the readout and records its events, all at the simulator's own speed: Python wakes once a run.
//
// A run: the testbench writes stimulus.bin, ready.bin and ack.bin into the working folder and increments `go`; the
// harness releases the reset, plays, records events.bin, resets the readout and copies `go` to `done`.
//
// stimulus.bin is a row of records {gap: 32, end: 1, valid: 1, 0: 6, enable: n, sample: n * word}, most significant
// byte first; zeros fill enable up to whole bytes. A record holds from its clock on, `valid` for one clock, and the
// next record follows `gap` clocks later. The first record is at clock 0; the end record marks where the run stops.
// A sample has S bits in a word of 16 bits, or of 32 where S is larger. S is W; with the analog front end W + 6: four
// fraction bits and four times the range, signed.
//
// events.bin has 64 bits for every event, least significant byte first: {clock: 48, address: 16}. The address is
// {polarity: 1, row: 7, column: 8}; all ones if a level in it is unknown.
//
// With SKIPS and `skipping` the harness plays only the clocks in which something can change. While the readout is not
// `awake`, every register keeps its value at the end of the clock, for any inputs (verify/proofs/clock_stop.py); no
// input moves before the next record, so the harness counts these clocks and does not play their edges. The bench sets
// `skipping` only where `event_ready` is always high. A chip rests while neither readout nor classifier is awake. Only
// its bin timer counts then: the harness adds the skipped clocks to the timer, and plays the clock that ends a bin.
//
// comparators.bin (analog) are words of 32 bits: noise, hysteresis, seed, and whether decisions.txt is written, then the
// offset of every taxel's comparator above and below; all in 1/16 code. Noise is even from -noise to +noise, drawn anew in
// every clock; a comparator that is high stays high until the signal is back by the hysteresis. decisions.txt has a line
// for every clock: what the comparators above and below found, in hexadecimal.
//
// With REGISTERS, host.bin has a byte for every clock with the levels of a host's pins: {0: 5, mosi: 1, cs_n: 1, sck: 1}.
// The host rests behind its end. miso.txt has a line for each of these clocks: {spi_miso_enable, spi_miso}.
//
// With CHIP the readout has its classifier behind it. weights.hex and neurons.hex are written into its memories while
// the reset holds. Events are in events.txt then, a line each: the clock from which the event was offered, the clock in
// which it was taken, and its channel; classes.txt has one for every bin: clock, class, class_sure (0 without the port),
// overrun, stalls, sums over all potentials and spikes of the hidden and of the output neurons (`mixed`), evidence in
// hexadecimal; spikes.txt one for every hidden spike: bin and neuron.

`timescale 1ns / 1ns

`ifndef READOUT
`define READOUT eskin_readout
`endif

module harness;
  parameter TAXELS = 64;
  parameter SAMPLE_BITS = 12;
  parameter COLUMNS = 8;
  parameter ROW_BITS = 3;
  parameter COLUMN_BITS = 3;

  parameter STEP = 16;
  parameter BEYOND = 0;  // codes from reference + half-width to the threshold above

`ifdef CHIP
  parameter CHANNEL_BITS = 7;
  parameter HIDDEN_BITS = 8;
  parameter CLASS_BITS = 3;
  parameter MEMBRANE_BITS = 16;
  parameter OUTPUT_BITS = 16;
  parameter EVIDENCE_BITS = 96;  // of all classes
  parameter ADDRESS_BITS = 13;
  parameter WORD_BITS = 64;
  parameter WEIGHT_WORDS = 6144;
  parameter NEURON_WORDS = 2048;
  parameter CLOCKS_PER_BIN = 5120;
`endif

`ifdef ANALOG
  localparam FRACTION_BITS = 4;
  localparam SIGNAL_BITS = SAMPLE_BITS + 2 + FRACTION_BITS;
`else
  localparam SIGNAL_BITS = SAMPLE_BITS;
`endif
  localparam SIGNAL_WORD = SIGNAL_BITS > 16 ? 32 : 16;
  localparam ENABLE_BYTES = (TAXELS + 7) / 8;
  localparam SAMPLE_BYTES = TAXELS * SIGNAL_WORD / 8;
  localparam RECORD_BITS = 8 * (5 + ENABLE_BYTES + SAMPLE_BYTES);
  localparam PATTERN = 65536;  // clocks after which the pattern of the sink repeats

  reg [31:0] go /* verilator public_flat_rw */ = 0;
  reg [31:0] done /* verilator public_flat_rw */ = 0;
  // Breaches of the link's protocol in the last run; all ones if a handshake did not end in reset, so that none began.
  reg [31:0] errors /* verilator public_flat_rw */ = 0;
  // Clock and rule of the first breach; the rules stand in readout.py.
  reg [63:0] breach /* verilator public_flat_rw */ = 0;

  reg skipping /* verilator public_flat_rw */ = 0;

  reg clk = 0;
`ifdef SKIPS
  // A burst of clocks passes in the delta cycles of one time step: nothing here has delays, and the simulator's own work
  // for a time step takes as long as half a clock of the readout.
  localparam BURST = 32;  // a clock takes two deltas, of the 100 that Verilator allows
  reg beat = 0;
  reg beaten = 0;
  reg [5:0] burst = 0;
  reg [31:0] skipped = 0;  // clocks that the next edge leaves behind, besides its own
  reg [31:0] still = 0;
  // In a block that is not awake, `awake` rises only with a record or with the end of a bin. Simulators differ in whether
  // it has risen here, so this clock and that one are played whatever `awake` says.
  reg moved = 0;  // first clock of a record
`ifdef CHIP
  wire awake = dut.readout.awake | dut.classifier.awake;
  reg [31:0] to_bin_end = 0;
`else
  wire awake = dut.awake;
`endif
  always #8 beat = ~beat;
  always @(beat or clk)
    if (clk) clk <= 0;
    else if (beat != beaten || burst != 0) begin
      beaten <= beat;
      burst <= burst != 0 ? burst - 1 : running ? BURST : 0;
      still = skipping && running && !moved && !event_valid && !awake ? gap - 1 : 0;
`ifdef CHIP
      to_bin_end = CLOCKS_PER_BIN - 1 - dut.timer.count;
      if (still >= to_bin_end) still = to_bin_end == 0 ? 0 : to_bin_end - 1;
      if (still != 0) dut.timer.count <= dut.timer.count + still;
`endif
      skipped <= still;
      clk <= 1;
    end
`else
  wire [31:0] skipped = 0;
  always #4 clk = ~clk;
`endif

`ifdef VERILATOR
  import "DPI-C" function void open_files();
  import "DPI-C" function void close_files();
  import "DPI-C" function int read_record(output bit [RECORD_BITS-1:0] record, input int bytes);
  import "DPI-C" function void write_event(input longint word);
`endif

`ifdef WAVES
  initial begin
`ifdef VERILATOR
    $dumpfile("waves.vcd");
`else
    $dumpfile("waves.fst");
`endif
    $dumpvars(0, harness);
  end
`endif

  // -- the readout ------------------------------------------------------------------------------------

  reg running = 0;
  reg rst = 1;
`ifdef REGISTERS
  localparam [2:0] REST = 2;
  reg [2:0] host = REST;
  reg hosted = 0;  // the host has not come to its end
  wire spi_miso, spi_miso_enable;
  integer host_file, miso_file, levels;
`endif
  reg sample_valid = 0;
  reg [TAXELS-1:0] taxel_enable = 0;
  reg [TAXELS*SIGNAL_BITS-1:0] sample = 0;

`ifdef ANALOG
  wire [TAXELS*SAMPLE_BITS-1:0] reference_code;
`ifdef REGISTERS
  localparam WIDTH_BITS = SAMPLE_BITS - 2;
`else
  localparam WIDTH_BITS = $clog2(STEP) + 1;
`endif
`ifdef CLOSES
  wire [TAXELS*WIDTH_BITS-1:0] half_width;
`else
`ifdef REGISTERS
  wire [WIDTH_BITS-1:0] step_code;
`else
  wire [WIDTH_BITS-1:0] step_code = STEP;
`endif
  wire [TAXELS*WIDTH_BITS-1:0] half_width = {TAXELS{step_code}};
`endif
`ifdef SELECTS
  wire [3*TAXELS-1:0] field_select;
`endif
  // The comparator macros of the taxels: they look at the signal that the last sample tick brought while compare is
  // high, and settle in the middle of the clock. While compare is low they answer wrongly, or hold their last answer.
  wire [TAXELS-1:0] compare;
  reg [TAXELS*SIGNAL_BITS-1:0] held = 0;
  reg [TAXELS-1:0] above = 0, above_last = 0;
  reg [TAXELS-1:0] below = 0, below_last = 0;
  reg [31:0] comparators [0:4+2*TAXELS];
  reg [31:0] dice = 1;
  integer i, code, width, signal;

  always @(posedge clk)
    if (rst) held <= 0;
    else if (sample_valid) held <= sample;

  always @(negedge clk)
    if (!running) begin
      above_last = 0;
      below_last = 0;
      above = 0;
      below = 0;
    end else begin
      if (compare !== 0)
        for (i = 0; i < TAXELS; i = i + 1) if (compare[i]) look;
      above = comparators[4] != 0 ? above_last : above_last ~^ compare;
      below = comparators[4] != 0 ? below_last : below_last ~^ compare;
    end

  task look;
    begin
      code = $signed(reference_code[i*SAMPLE_BITS+:SAMPLE_BITS]);
`ifdef SELECTS
      case (field_select[3*i+:3])
        1: signal = level(i);
        2: signal = mean(around(i), 2);
        4: signal = mean(around(i) + 4 * (level(i) >>> FRACTION_BITS), 3);
        default: signal = 0;
      endcase
`else
      signal = level(i);
`endif
      width = {1'b0, half_width[i*WIDTH_BITS+:WIDTH_BITS]};
      above_last[i] = seen(signal, 5 + i, above_last[i]) >= (code + width + BEYOND) * (1 << FRACTION_BITS);
`ifdef POLARITY
      below_last[i] = -seen(-signal, 5 + TAXELS + i, below_last[i]) < (code - width) * (1 << FRACTION_BITS);
`endif
    end
  endtask

  function automatic signed [31:0] level(input integer taxel);
    level = $signed(held[taxel*SIGNAL_BITS+:SIGNAL_BITS]);
  endfunction

`ifdef SELECTS
  // Sum of the four codes around a taxel; beyond an edge, its own code.
  function automatic signed [31:0] around(input integer taxel);
    around = (level(taxel < COLUMNS ? taxel : taxel - COLUMNS) >>> FRACTION_BITS)
        + (level(taxel + COLUMNS < TAXELS ? taxel + COLUMNS : taxel) >>> FRACTION_BITS)
        + (level(taxel % COLUMNS == 0 ? taxel : taxel - 1) >>> FRACTION_BITS)
        + (level(taxel % COLUMNS == COLUMNS - 1 ? taxel : taxel + 1) >>> FRACTION_BITS);
  endfunction

  // A sum of codes divided by a power of two, halves to the even code, as the model rounds a field.
  function automatic signed [31:0] mean(input signed [31:0] sum, input integer shift);
    mean = (sum + (1 << (shift - 1)) - 1 + ((sum >>> shift) & 1)) >>> shift << FRACTION_BITS;
  endfunction
`endif

  // What a comparator makes of a signal: offset, hysteresis and noise added.
  function automatic signed [31:0] seen(input signed [31:0] level, input integer number, input high);
    begin
      seen = level + $signed(comparators[number]);
      if (high) seen = seen + $signed(comparators[1]);
      if (comparators[0] != 0) begin
        dice = dice ^ (dice << 13);
        dice = dice ^ (dice >> 17);
        dice = dice ^ (dice << 5);
        seen = seen + $signed(dice % (2 * comparators[0] + 1)) - $signed(comparators[0]);
      end
    end
  endfunction
`endif

`ifdef FOUR_PHASE
  localparam EVENT_BITS = ROW_BITS + COLUMN_BITS
`ifdef POLARITY
      + 1
`endif
      ;
`ifdef FOUR_PHASE_DUAL
  wire aer_req_on, aer_req_off;
  wire aer_req = aer_req_on | aer_req_off;
  localparam ADDRESS_BITS = EVENT_BITS - 1;
`else
  wire aer_req;
  localparam ADDRESS_BITS = EVENT_BITS;
`endif
  reg aer_ack = 0;
`ifdef ADDRESS
  wire [ADDRESS_BITS-1:0] aer_addr;
`else
  wire aer_addr = 0;  // a single taxel needs no address
`endif
  // {polarity, row, column}, as the link with one request has it on its wires
`ifndef FOUR_PHASE_DUAL
  wire [ROW_BITS+COLUMN_BITS:0] event_word = aer_addr;
`elsif ADDRESS
  wire [ROW_BITS+COLUMN_BITS:0] event_word = {aer_req_on, aer_addr};
`else
  wire [ROW_BITS+COLUMN_BITS:0] event_word = aer_req_on;
`endif
`elsif CHIP
  wire event_valid, event_ready, class_valid, overrun;
  wire hidden_valid, hidden_spike, output_valid;
`ifdef OUTPUT_SPIKES
  wire output_spike;
`else
  wire output_spike = 0;
`endif
`ifdef MARGIN
  wire class_sure;
`else
  wire class_sure = 0;
`endif
  wire [CHANNEL_BITS-1:0] event_channel;
  wire [CLASS_BITS-1:0] class_index;
  wire [EVIDENCE_BITS-1:0] evidence;
  wire [23:0] stall_count;
  wire [HIDDEN_BITS-1:0] hidden_index;
  wire signed [MEMBRANE_BITS-1:0] hidden_potential;
  wire signed [OUTPUT_BITS-1:0] output_potential;
  reg load_valid = 0;
  reg load_neurons = 0;
  reg [ADDRESS_BITS-1:0] load_address = 0;
  reg [WORD_BITS-1:0] load_data = 0;
  reg [WORD_BITS-1:0] weights [0:WEIGHT_WORDS-1];
  reg [WORD_BITS-1:0] neurons [0:NEURON_WORDS-1];
  reg [63:0] left /* verilator public_flat_rw */ = 0;  // 1 + the clock from which an event waits when the run ends, 0 for none
  reg waiting = 0;
  reg [63:0] offered = 0;
  reg [31:0] loaded = 0;  // words of both memories that have been written since the reset began
`else
  wire event_valid;
  wire event_ready;
`ifdef ROWS
  wire [ROW_BITS-1:0] event_row;
`else
  wire event_row = 0;
`endif
`ifdef COLUMNS
  wire [COLUMN_BITS-1:0] event_col;
`else
  wire event_col = 0;
`endif
`ifdef POLARITY
  wire event_polarity;
`else
  wire event_polarity = 1;
`endif
`endif

`ifdef CHIP
  eskin_chip dut (
`else
  `READOUT dut (
`endif
      .clk(clk),
      .rst(rst),
`ifdef TEST_ENABLE
      .test_enable(1'b0),
`endif
`ifdef REGISTERS
      .spi_sck(host[0]),
      .spi_cs_n(host[1]),
      .spi_mosi(host[2]),
      .spi_miso(spi_miso),
      .spi_miso_enable(spi_miso_enable),
`ifdef ANALOG
`ifndef CLOSES
      .step_code(step_code),
`endif
`endif
`ifdef SELECTS
      .field_select(field_select),
`endif
`endif
      .sample_valid(sample_valid),
`ifdef ANALOG
      .above(above),
      .compare(compare),
      .reference_code(reference_code),
`ifdef POLARITY
      .below(below),
`endif
`ifdef CLOSES
      .half_width(half_width),
`endif
`else
      .sample(sample),
`endif
`ifdef FOUR_PHASE
`ifdef FOUR_PHASE_DUAL
      .aer_req_on(aer_req_on),
      .aer_req_off(aer_req_off),
`else
      .aer_req(aer_req),
`endif
      .aer_ack(aer_ack),
`ifdef ADDRESS
      .aer_addr(aer_addr),
`endif
`elsif CHIP
      .load_valid(load_valid),
      .load_neurons(load_neurons),
      .load_address(load_address),
      .load_data(load_data),
      .scan_start(1'b0),
      .event_valid(event_valid),
      .event_ready(event_ready),
      .event_channel(event_channel),
      .class_valid(class_valid),
      .class_index(class_index),
`ifdef MARGIN
      .class_sure(class_sure),
`endif
      .evidence(evidence),
      .overrun(overrun),
      .stall_count(stall_count),
      .hidden_valid(hidden_valid),
      .hidden_index(hidden_index),
      .hidden_potential(hidden_potential),
      .hidden_spike(hidden_spike),
      .output_valid(output_valid),
      .output_index(),
      .output_potential(output_potential),
`ifdef OUTPUT_SPIKES
      .output_spike(output_spike),
`endif
`else
      .event_valid(event_valid),
      .event_ready(event_ready),
`ifdef ROWS
      .event_row(event_row),
`endif
`ifdef COLUMNS
      .event_col(event_col),
`endif
`ifdef POLARITY
      .event_polarity(event_polarity),
`endif
`endif
      .taxel_enable(taxel_enable)
  );

  // -- the player -------------------------------------------------------------------------------------

  reg [63:0] cycle = 0;
  reg [31:0] gap = 0;
  reg [RECORD_BITS-1:0] record = 0;
  reg [7:0] ready_pattern [0:PATTERN/8-1];
  reg [15:0] ack_pattern [0:PATTERN/16-1];
  reg [2:0] hold = 0;
  reg [13:0] patience = 0;  // clocks in reset with a handshake under way; the longest delay of ACK has half of them
  reg files_open = 0;
  integer stimulus_file, pattern_file, event_file, pair_file, decision_file, class_file, spike_file, count, place;
  reg [TAXELS*SIGNAL_BITS-1:0] fresh = 0;
`ifdef FOUR_PHASE
  reg responding = 0;
  wire quiet = !responding && !aer_ack;
`else
  wire quiet = 1;
`endif

  always @(posedge clk)
    if (!running) begin
      if (files_open) begin  // behind the last clock, whose event is in them
        close_all;
        files_open <= 0;
        done <= go;
      end
      if (hold != 4) hold <= hold + 1;
`ifdef CHIP
      else if (go != done && loaded != WEIGHT_WORDS + NEURON_WORDS + 1) begin
        if (loaded == 0) begin
          $readmemh("weights.hex", weights);
          $readmemh("neurons.hex", neurons);
        end
        load_valid <= loaded != WEIGHT_WORDS + NEURON_WORDS;
        load_neurons <= loaded >= WEIGHT_WORDS;
        load_address <= loaded < WEIGHT_WORDS ? loaded : loaded - WEIGHT_WORDS;
        load_data <= loaded < WEIGHT_WORDS ? weights[loaded] : neurons[loaded-WEIGHT_WORDS];
        loaded <= loaded + 1;
      end
`endif
      else if (go != done && quiet) begin
        pattern_file = $fopen("ready.bin", "rb");
        count = $fread(ready_pattern, pattern_file);
        $fclose(pattern_file);
        pattern_file = $fopen("ack.bin", "rb");
        count = $fread(ack_pattern, pattern_file);
        $fclose(pattern_file);
`ifdef VERILATOR
        open_files();
`else
        stimulus_file = $fopen("stimulus.bin", "rb");
        event_file = $fopen("events.bin", "wb");
`endif
`ifdef CHIP
        pair_file = $fopen("events.txt", "w");
        class_file = $fopen("classes.txt", "w");
        spike_file = $fopen("spikes.txt", "w");
`endif
`ifdef ANALOG
        pattern_file = $fopen("comparators.bin", "rb");
        count = $fread(comparators, pattern_file);
        $fclose(pattern_file);
        dice = comparators[2];
        decision_file = $fopen("decisions.txt", "w");
`endif
`ifdef REGISTERS
        host_file = $fopen("host.bin", "rb");
        miso_file = $fopen("miso.txt", "w");
        next_levels;
`endif
        files_open <= 1;
        errors <= 0;
        cycle <= 0;
        running <= 1;
        rst <= 0;
        next_record;
        patience <= 0;
      end else if (go != done) begin
        patience <= patience + 1;
        if (&patience) begin
          errors <= ~0;
          done <= go;
        end
      end
    end else begin
`ifdef ANALOG
      if (comparators[3] != 0) $fwrite(decision_file, "%h %h\n", above, below);
`endif
`ifdef REGISTERS
      if (hosted) $fwrite(miso_file, "%b%b\n", spi_miso_enable, spi_miso);
      next_levels;
`endif
      cycle <= cycle + 1 + skipped;
      if (gap - skipped == 1) next_record;
      else begin
        gap <= gap - skipped - 1;
`ifdef SKIPS
        moved <= 0;
`endif
        sample_valid <= 0;
      end
    end

  task record_event(input [63:0] word);
`ifdef VERILATOR
    write_event(word);
`else
    $fwrite(event_file, "%u", ^word === 1'bx ? {word[63:16], 16'hffff} : word);
`endif
  endtask

  task close_all;
    begin
`ifdef VERILATOR
      close_files();
`else
      $fclose(stimulus_file);
      $fclose(event_file);
`endif
`ifdef ANALOG
      $fclose(decision_file);
`endif
`ifdef REGISTERS
      $fclose(host_file);
      $fclose(miso_file);
`endif
`ifdef CHIP
      $fclose(pair_file);
      $fclose(class_file);
      $fclose(spike_file);
`endif
    end
  endtask

`ifdef REGISTERS
  task next_levels;
    begin
      levels = $fgetc(host_file);
      hosted <= levels >= 0;
      host <= levels >= 0 ? levels[2:0] : REST;
    end
  endtask
`endif

  task next_record;
    begin
`ifdef VERILATOR
      count = read_record(record, RECORD_BITS / 8);
`else
      count = $fread(record, stimulus_file);
`endif
      gap <= record[RECORD_BITS-1-:32];
      sample_valid <= record[RECORD_BITS-34];
      taxel_enable <= record[8*SAMPLE_BYTES+:TAXELS];
`ifdef SKIPS
      moved <= 1;
`endif
      if (record[RECORD_BITS-34]) begin
        for (place = 0; place < TAXELS; place = place + 1)
          fresh[place*SIGNAL_BITS+:SIGNAL_BITS] = record[place*SIGNAL_WORD+:SIGNAL_BITS];
        sample <= fresh;
      end
      if (record[RECORD_BITS-33] || count == 0) begin
`ifdef CHIP
        loaded <= 0;
        left <= event_valid && !event_ready ? (waiting ? offered : cycle) + 1 : 0;
`endif
        running <= 0;
        rst <= 1;
        hold <= 0;
        sample_valid <= 0;
      end
    end
  endtask

  // -- the sink: takes events, records them, and watches the protocol ---------------------------------

  task broken(input [2:0] rule);
    begin
      if (errors == 0) breach <= {cycle[60:0], rule};
      errors <= errors + 1;
    end
  endtask

`ifdef FOUR_PHASE
  reg [11:0] edges = 0;
  wire [7:0] column = event_word & ((1 << COLUMN_BITS) - 1);
  wire [6:0] row = (event_word >> COLUMN_BITS) & ((1 << ROW_BITS) - 1);
`ifdef POLARITY
  wire [15:0] address = {event_word[ROW_BITS+COLUMN_BITS], row, column};
`else
  wire [15:0] address = {1'b1, row, column};
`endif
  reg req_before = 0;
  reg ack_before = 0;
  reg [ROW_BITS+COLUMN_BITS:0] addr_before = 0;  // one bit wider where there is no polarity

  always @(aer_req) begin
    responding = 1;
    #(ack_pattern[edges]) aer_ack = aer_req;
    edges = edges + 1;
    responding = 0;
  end
  always @(posedge running) edges = 0;

  always @(posedge clk) begin
    req_before <= aer_req & running;
    ack_before <= aer_ack;
    addr_before <= aer_addr;
    if (running) begin
      if (aer_req && !req_before) record_event({cycle[47:0] - 48'd1, address});
`ifdef FOUR_PHASE_DUAL
      if (aer_req_on && aer_req_off) broken(0);
`endif
      if ((aer_req || aer_ack) && aer_addr != addr_before) broken(1);
      if (aer_req && !req_before && ack_before) broken(2);
      if (!aer_req && req_before && !ack_before) broken(3);
    end
  end
`elsif CHIP
  reg [CHANNEL_BITS-1:0] channel_before = 0;
  reg [31:0] bin_count = 0;
  reg [63:0] hidden_sum = 0, output_sum = 0;

  // A sum in which a number's place counts: equal sums of 64 bits from other numbers would be an accident.
  function automatic [63:0] mixed(input [63:0] sum, input signed [63:0] potential, input spike);
    begin
      mixed = sum * 64'd6364136223846793005 + {potential[62:0], spike} + 64'd1442695040888963407;
    end
  endfunction

  always @(posedge clk) begin
    waiting <= running & event_valid & ~event_ready;
    channel_before <= event_channel;
    if (running) begin
      if (event_valid && !waiting) offered <= cycle;
      if (event_valid && event_ready)
        $fwrite(pair_file, "%0d %0d %0d\n", waiting ? offered : cycle, cycle, event_channel);
      if (waiting && (!event_valid || event_channel != channel_before)) broken(4);
      if (hidden_valid) hidden_sum <= mixed(hidden_sum, hidden_potential, hidden_spike);
      if (hidden_valid && hidden_spike) $fwrite(spike_file, "%0d %0d\n", bin_count, hidden_index);
      if (output_valid) output_sum <= mixed(output_sum, output_potential, output_spike);
      if (class_valid) begin
        $fwrite(class_file, "%0d %0d %0d %0d %0d %0d %0d %h\n", cycle, class_index, class_sure, overrun, stall_count,
                hidden_sum, output_sum, evidence);
        bin_count <= bin_count + 1;
        hidden_sum <= 0;
        output_sum <= 0;
      end
    end else begin
      bin_count <= 0;
      hidden_sum <= 0;
      output_sum <= 0;
    end
  end
`else
  reg waiting = 0;
  reg [ROW_BITS+COLUMN_BITS+2:0] payload_before = 0;
  wire [ROW_BITS+COLUMN_BITS+2:0] payload = {event_polarity, event_row, event_col};
  wire [7:0] row = event_row, column = event_col;
  wire [15:0] address = {event_polarity, row[6:0], column};
  assign event_ready = ready_pattern[cycle[15:3]][cycle[2:0]];

  always @(posedge clk) begin
    waiting <= running & event_valid & ~event_ready;
    payload_before <= payload;
    if (running) begin
      if (event_valid && event_ready)
        record_event({cycle[47:0], address});
      if (waiting && (!event_valid || payload != payload_before)) broken(4);
    end
  end
`endif
endmodule
