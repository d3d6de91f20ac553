from __future__ import annotations

from collections.abc import Iterator

import pytest

from drivers.mock.process import MockProcess


@pytest.fixture(scope="module")
def qik(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess("qik", tmp_path_factory.mktemp("qik") / "port") as mock:
        yield mock


@pytest.fixture(scope="module")
def odrive(tmp_path_factory: pytest.TempPathFactory) -> Iterator[MockProcess]:
    with MockProcess("odrive", tmp_path_factory.mktemp("odrive") / "port") as mock:
        yield mock
