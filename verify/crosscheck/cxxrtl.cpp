// Plays a stimulus on a readout; cxxrtl.py writes @ROW@, @COLUMN@ and @POLARITY@ (of the event).
#include "design.cpp"
#include <cstdio>
#include <fstream>
#include <vector>

template <size_t bits> static void take(std::ifstream& file, cxxrtl::value<bits>& port) {
  file.read(reinterpret_cast<char*>(port.data), sizeof port.data);
}

int main() {
  cxxrtl_design::p_eskin__readout top;
  std::ifstream file("stimulus.bin", std::ios::binary), pattern("ready.bin", std::ios::binary);
  std::vector<char> ready((std::istreambuf_iterator<char>(pattern)), std::istreambuf_iterator<char>());
  auto clock = [&](bool high) { top.p_clk.set<bool>(high); top.step(); };
  top.p_rst.set<bool>(true);
  for (int i = 0; i < 4; i++) { clock(false); clock(true); }
  top.p_rst.set<bool>(false);
  uint32_t head[2];  // clocks for which the record holds, and whether samples are valid in the first of them
  for (uint64_t t = 0; file.read(reinterpret_cast<char*>(head), sizeof head);) {
    take(file, top.p_taxel__enable);
    take(file, top.p_sample);
    for (uint32_t i = 0; i < head[0]; i++, t++) {
      top.p_sample__valid.set<bool>(i == 0 && head[1]);
      top.p_event__ready.set<bool>(ready[t % ready.size()]);
      clock(false);
      if (top.p_event__valid.get<bool>() && top.p_event__ready.get<bool>())
        std::printf("%llu %u %u %u\n", (unsigned long long)t, @ROW@, @COLUMN@, @POLARITY@);
      clock(true);
    }
  }
}
