"""The registers that a host sets at run time, behind SPI."""
