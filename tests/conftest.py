"""Fixtures shared by all tests: seeded random numbers."""

import zlib

import numpy as np
import pytest


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """A generator seeded by the test's own name, so that each draws the same in any order."""
    return np.random.default_rng(zlib.crc32(request.node.name.encode()))
