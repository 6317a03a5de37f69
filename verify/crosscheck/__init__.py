"""The delivered text before tools of another kind: a third simulator, and a second front end of SystemVerilog."""
