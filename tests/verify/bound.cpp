#include "Vbound.h"
int main(int argc, char** argv) {
    Verilated::commandArgs(argc, argv);
    Vbound top;
    for (vluint64_t edge = 0; !Verilated::gotFinish(); ++edge) { top.clk = edge & 1; top.eval(); }
    top.final();
}
