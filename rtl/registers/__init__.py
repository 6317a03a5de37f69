"""The run-time registers behind an SPI slave."""
