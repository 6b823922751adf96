from pathlib import Path

import pytest

FR079 = Path(__file__).resolve().parents[3] / "examples/recordings/fr079/fr079-200.clf.bz2"


@pytest.fixture(scope="session")
def fr079():
    """The first 200 scans of a real run, CC BY 3.0."""
    return FR079
