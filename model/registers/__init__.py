"""The registers that a host sets at run time: their description, their model and their driver."""
