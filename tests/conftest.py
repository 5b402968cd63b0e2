"""What every test shares: reproducible examples and a seeded generator."""

import numpy as np
import pytest
from hypothesis import settings

# The same examples in every run and on every machine; a slow machine is not a failure.
settings.register_profile(
    "posekit", derandomize=True, database=None, deadline=None, max_examples=50, print_blob=True
)
settings.load_profile("posekit")


@pytest.fixture
def rng() -> np.random.Generator:
    """Return a generator that starts the same way in every test."""
    return np.random.default_rng(1985)
