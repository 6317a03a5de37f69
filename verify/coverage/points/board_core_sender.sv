// Points of a board, {{ config.design }}.
`COVER(frame_of_one_word, words == 1 && $past(words) == 0)
`COVER(longest_frame, words == {{ words }})
`COVER(flag_stuffed, valid && ready && byte_ == 8'h7d)
`COVER(number_0_behind_255, sequence_ == 0 && $past(sequence_) == 255)
`COVER(number_that_is_stuffed, sequence_ == 8'h7e || sequence_ == 8'h7d)
`COVER(words_wait_when_a_frame_ends, level != 0 && sequence_ != $past(sequence_))
