#include "Veskin_readout.h"
#include "verilated.h"
#include <ctime>
#include <cstdio>
#include <cstring>
#include <vector>
int main(int argc, char** argv) {
  const int words = atoi(argv[1]), clocks_per_sample = atoi(argv[2]);
  std::vector<uint32_t> samples;
  FILE* file = fopen(argv[3], "rb");
  uint32_t word;
  while (fread(&word, 4, 1, file) == 1) samples.push_back(word);
  fclose(file);
  Veskin_readout top;
  top.clk = 0; top.rst = 1; top.event_ready = 1; top.sample_valid = 0;
  memset(&top.taxel_enable, 0xff, sizeof top.taxel_enable);
  for (int i = 0; i < 4; i++) { top.clk = 0; top.eval(); top.clk = 1; top.eval(); }
  top.rst = 0;
  const size_t ticks = samples.size() / words;
  uint64_t events = 0, sum = 0;
  const std::clock_t start = std::clock();
  for (size_t tick = 0; tick < ticks; tick++) {
    memcpy(&top.sample, &samples[tick * words], 4 * words);
    for (int clock = 0; clock < clocks_per_sample; clock++) {
      top.sample_valid = clock == 0;
      top.clk = 0; top.eval();
      if (top.event_valid) { events++; sum += 8 * top.event_row + top.event_col; }
      top.clk = 1; top.eval();
    }
  }
  const double seconds = double(std::clock() - start) / CLOCKS_PER_SEC;
  printf("{\"events\": %llu, \"sum\": %llu, \"seconds\": %.6f}\n", (unsigned long long)events,
         (unsigned long long)sum, seconds);
}
