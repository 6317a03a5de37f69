"""Run-time registers: their description, model and driver."""
