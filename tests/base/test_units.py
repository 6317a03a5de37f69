"""Test numbers with units."""

from eskin.base.units import with_unit


def test_units():
    values = (0, 0.0009236708571873865, 0.9996, 0.9994, -1234.5, 1e-20, 2.5e16, float("inf"), float("nan"))
    texts = ("0 V", "924 uV", "1 V", "999 mV", "-1.23 kV", "0.01 aV", "25,000 TV", "inf V", "nan V")
    assert tuple(with_unit(value, "V") for value in values) == texts
