"""What the tests share: materials made by code, a cache that is kept for the session, the program, the data folder."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import vernis


@pytest.fixture(scope="session", autouse=True)
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Computed once: what learned metrics need takes seconds."""
    folder = tmp_path_factory.mktemp("cache")
    os.environ["VERNIS_CACHE"] = str(folder)
    return folder


@pytest.fixture(scope="session")
def plastic() -> vernis.Brdf:
    return vernis.model("ggx", kd=[0.2, 0.1, 0.05], f0=0.04, alpha=0.15)


@pytest.fixture(scope="session")
def rougher() -> vernis.Brdf:
    return vernis.model("ggx", kd=[0.2, 0.1, 0.05], f0=0.04, alpha=0.3)


@pytest.fixture(scope="session")
def program(cache: Path):
    """Runs the program of the wheel; standard output where it succeeds."""

    def run(*arguments: object, code: int = 0) -> str:
        done = subprocess.run([sys.executable, "-m", "vernis", *map(str, arguments)], capture_output=True, text=True, timeout=600)
        assert done.returncode == code, done.stderr
        return done.stdout if code == 0 else done.stderr

    return run


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of published data; a test that needs it is skipped where there is none, and fails where there should be one."""
    folder = os.environ.get("VERNIS_DATA")
    if folder:
        return Path(folder)
    if os.environ.get("VERNIS_REQUIRE_DATA"):
        pytest.fail("VERNIS_DATA is not set, and VERNIS_REQUIRE_DATA is")
    pytest.skip("VERNIS_DATA is not set")
