  wire [39:0] bidir_out, bidir_oe;
  assign uo_out = bidir_out[7:0];
  assign uio_out = bidir_out[15:8];
  assign uio_oe = bidir_oe[15:8];

  chip_core #(.NUM_INPUT_PADS(12), .NUM_BIDIR_PADS(40), .NUM_ANALOG_PADS(2)) chip (
      .clk(clk), .rst_n(rst_n), .input_in({4'b0, ui_in}), .bidir_in({24'b0, uio_in, 8'b0}),
      .bidir_out(bidir_out), .bidir_oe(bidir_oe),
      .input_pu(), .input_pd(), .bidir_cs(), .bidir_sl(), .bidir_ie(), .bidir_pu(), .bidir_pd(), .analog()
  );

  wire _unused = ena;
