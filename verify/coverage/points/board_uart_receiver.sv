// Points of a board, {{ config.design }}.
`COVER(lowest_byte, valid && data == 8'h00)
`COVER(highest_byte, valid && data == 8'hff)
`COVER(noise_shorter_than_a_start_bit, fsm_state == 0 && $past(fsm_state) == 1 && !rst)
`COVER(start_bit_right_behind_a_stop_bit, fsm_state == 1 && $past(fsm_state) == 0 && $past(fsm_state, 2) == 2)
`COVER(line_that_stays_low, fsm_state == 2 && !line && $past(fsm_state, 8) == 2)
`RESETS(within_a_byte, fsm_state == 1)
