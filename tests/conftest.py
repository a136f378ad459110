"""Profiles for the property tests: ``ci`` by default, ``full`` with HYPOTHESIS_PROFILE=full.

``ci`` draws the same examples each time, so that a run can be repeated; ``full`` draws more, and
fresh ones. Code that the tests compile has its own cache.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

from tests.shares import pytest_addoption, pytest_collection_modifyitems, pytest_terminal_summary
from tippedisk_verify.flow import code_cache
from tippedisk_verify.support.cache import VARIABLE, code_folder

if TYPE_CHECKING:
    from tippedisk_verify.flow.contract import Engine
    from tippedisk_verify.reference_values.store import Store

# what pytest finds here
__all__ = [
    "pytest_addoption",
    "pytest_collection_modifyitems",
    "pytest_terminal_summary",
    "store",
    "taylor",
]

# What was kept from earlier runs must not stand in for what a test computes.
os.environ[VARIABLE] = "code"
# Each worker has a core: threads for linear algebra would wait for those of the others. NumPy reads
# this as it loads.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _own_code_folder() -> Path | None:
    """Return a folder for the code that tests compile, beside that of the package.

    They compile more than the package keeps, so that each run would compile everything again.
    """
    folder = code_folder()
    return folder / "tests" if folder and os.environ.get(VARIABLE) == "code" else folder


code_cache.code_folder = _own_code_folder
code_cache._MAX_CACHE_BYTES = 2**30  # the default tests alone need more than the usual 2**28

# The first call of a test compiles; that is not a slow example.
settings.register_profile(
    "ci",
    max_examples=100,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    derandomize=True,
)
settings.register_profile(
    "full", max_examples=500, deadline=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))


@pytest.fixture(scope="session")
def taylor() -> Engine:
    """The engine that `Disk` uses as well, so that each kind of integrator is compiled once."""
    from tippedisk_verify.flow import default_engine

    return default_engine()


@pytest.fixture(scope="session")
def store() -> Store:
    """The published reference values."""
    from tippedisk_verify.reference_values.store import load_store

    return load_store()
