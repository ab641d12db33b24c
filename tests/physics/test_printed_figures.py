"""The comparison with printed figures can fail: at half a unit of the last digit, and no sooner."""

import pytest


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("1.57, 0", [1.5749, 0.0049]),
        ("0.25, 5.1895651858", [0.25, 5.18956518584]),
        ("3.93443e-6, 1.511e-11", [3.934434e-6, 1.5114e-11]),
        ("-2.5056592734, .", [-2.50565927341, 17.0]),
        ("39", [39.4]),
    ],
)
def test_that_agreement_to_the_digits_printed_passes(printed, text, numbers):
    printed(text, numbers)


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("1.57, 0", [1.5751, 0.0]),
        ("1.57, 0", [1.57, 0.0051]),
        ("0.25, 5.1895651858", [0.2500000001, 5.1895651858]),
        ("3.93443e-6", [3.93444e-6]),
        ("1.511e-11", [1.512e-11]),
        ("39", [39.6]),
        ("1", [float("nan")]),
        ("1, 2", [1.0]),
    ],
)
def test_that_a_wrong_digit_fails(printed, text, numbers):
    with pytest.raises(AssertionError):
        printed(text, numbers)
