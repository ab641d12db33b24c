"""Golden rows of all spatial constraints, on every target."""

import pytest

from tests.targets.conftest import QUANTITIES
from tests.targets.golden_rows import assert_golden

pytestmark = pytest.mark.slow


def test_that_all_targets_give_the_golden_rows(target, case_named) -> None:
    found = {quantity: target["golden"][quantity][0] for quantity in QUANTITIES}
    assert_golden(case_named("golden").module.EQUATIONS, found)
