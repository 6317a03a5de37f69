set sta_report_default_digits 6
read_liberty {{ library }}
read_verilog {{ netlist }}
link_design {{ top }}
