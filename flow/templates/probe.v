module probe (clk, a, w, x, y, z);
  input clk, a;
  output w, x, y, z;
  OUT c0 (.A(a), .Z(w));
  IN c1 (.A(clk), .Z(x));
  OUT c2 (.A(clk), .Z(y));
  IN c3 (.A(a), .Z(z));
endmodule
