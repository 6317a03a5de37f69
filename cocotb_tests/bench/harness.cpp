// SPDX-License-Identifier: Apache-2.0
// The two files that the harness touches in every tick and every event, for Verilator: $fread takes a byte at a time,
// and $fwrite reads its format anew for every event.

#include <cstdint>
#include <cstdio>
#include <vector>

#include "svdpi.h"

static FILE *stimulus = nullptr, *events = nullptr;
static std::vector<uint8_t> bytes_of_record;

extern "C" void open_files() {
  stimulus = std::fopen("stimulus.bin", "rb");
  events = std::fopen("events.bin", "wb");
}

extern "C" void close_files() {
  if (stimulus) std::fclose(stimulus);
  if (events) std::fclose(events);
  stimulus = events = nullptr;
}

// As $fread into a vector of so many bytes: most significant byte first; returns the bytes that were read.
extern "C" int read_record(svBitVecVal* record, int bytes) {
  bytes_of_record.resize(bytes);
  const int count = stimulus ? std::fread(bytes_of_record.data(), 1, bytes, stimulus) : 0;
  uint8_t* low = reinterpret_cast<uint8_t*>(record);
  for (int i = 0; i < bytes; i++) low[i] = bytes_of_record[bytes - 1 - i];
  return count;
}

extern "C" void write_event(uint64_t word) {
  if (events) std::fwrite(&word, sizeof word, 1, events);
}
