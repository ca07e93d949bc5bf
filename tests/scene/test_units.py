"""Quantities with units: read right, or refused with what was expected."""

import math

import pytest

from flexlin.scene.units import dimension_of, in_si

SAME = [
    ("2 mm", "m", 2e-3),
    ("-1.5e1cm", "m", -0.15),
    ("0.5 deg", "rad", math.pi / 360),
    ("30 rpm", "rad/s", math.pi),
    ("90 deg/s", "rad/s", math.pi / 2),
    ("3 N m", "N m", 3.0),
    ("3 Nm", "N m", 3.0),
    ("250 mN m", "N m", 0.25),
    ("3 N*m", "N m", 3.0),
    ("1 J", "N m", 1.0),
    ("20 ms", "s", 0.02),
    ("80 mm/s", "m/s", 0.08),
    ("0.3", "m", 0.3),
    (0.3, "m", 0.3),
    (2, "rad/s", 2.0),
    ("12 V A", "W", 12.0),
    ("1 kg m^2/s^2", "N m", 1.0),
]


@pytest.mark.parametrize(("text", "unit", "value"), SAME)
def test_quantities_in_si(text, unit, value):
    assert in_si(text, unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    "text", ["2 deg", "2 s", "2 m/s", "2 m m", "m", "", "2 mn", "nan m", "inf", "1e999x m", True, None, [1.0], "2 m/"]
)
def test_what_is_no_length_is_refused(text):
    with pytest.raises(ValueError, match="a length such as 2 mm"):
        in_si(text, "m")


def test_dimensions_of_products_and_quotients_agree():
    """W = N m / s = V A, and an angle is a dimension of its own."""
    assert dimension_of("W")[1] == dimension_of("N m/s")[1] == dimension_of("V A")[1]
    assert dimension_of("deg/s")[1] != dimension_of("1/s")[1]
