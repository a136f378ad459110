"""What the fault tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.stress.runs import ORBIT, run


@pytest.fixture(scope="session")
def filled_cache(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder with a cache that `orbit` has filled and whose checksums are there, and what `orbit` prints."""
    folder = tmp_path_factory.mktemp("cache")
    done = [run(ORBIT, XDG_CACHE_HOME=str(folder)) for _ in range(2)]
    assert done[0].returncode == 0
    assert done[0].stdout == done[1].stdout
    return folder, done[0].stdout
