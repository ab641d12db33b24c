"""What every test shares: fixed seeds, and the option that rewrites the goldens."""

import hypothesis
import pytest

# The same examples on every run and every machine, nothing written into the checkout, and no
# deadline: a slow machine is not a wrong result.
hypothesis.settings.register_profile(
    "kincompile", derandomize=True, database=None, deadline=None, print_blob=False
)
hypothesis.settings.load_profile("kincompile")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--update-goldens`, which the tests of the goldens obey; a rewrite fails the run."""
    parser.addoption(
        "--update-goldens",
        action="store_true",
        help="rewrite generated/ from the examples, remove strays, list both and fail the run",
    )
