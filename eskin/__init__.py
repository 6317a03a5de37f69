"""Spiking readout for electronic skin. The rooms are subpackages: ``eskin.model``, ``eskin.rtl``, and so on."""
