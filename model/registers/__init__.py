"""The registers for settings at run time: description, model and driver."""
