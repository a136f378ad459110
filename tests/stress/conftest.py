"""What the fault tests share."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.stress.runs import ORBIT, run


@pytest.fixture(scope="session")
def filled_cache(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder with a cache that one run of `orbit` has filled, and what `orbit` prints."""
    folder = tmp_path_factory.mktemp("cache")
    done = run(ORBIT, XDG_CACHE_HOME=str(folder))
    assert done.returncode == 0
    again = tmp_path_factory.mktemp("again")
    shutil.copytree(folder, again, dirs_exist_ok=True)
    assert run(ORBIT, XDG_CACHE_HOME=str(again)).stdout == done.stdout
    return folder, done.stdout
