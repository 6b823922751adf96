"""CDR against rclpy itself, both ways and all fields; the golden bytes are still rclpy's."""

import base64
import json
import subprocess

import pytest

from tests.harness.interface.ros2.test_cdr import GOLDEN, TYPES, variants
from tests.ros2.conftest import HERE, PYTHON
from wayproof.harness.interface.ros2.messages import decode, encode


@pytest.fixture(scope="module")
def theirs():
    """What rclpy writes, and what of ours it reads otherwise."""
    ours = {
        name: [base64.b64encode(encode(one)).decode() for one in variants(name)] for name in GOLDEN
    }
    words = [PYTHON, str(HERE / "make_golden.py"), "-"]
    ran = subprocess.run(words, input=json.dumps(ours), capture_output=True, text=True, check=True)
    return json.loads(ran.stdout)


def test_rclpy_reads_every_field_of_ours(theirs):
    assert theirs["misread"] == []


@pytest.mark.parametrize("name", sorted(GOLDEN))
def test_rclpy_writes_the_golden_bytes(theirs, name):
    kind = TYPES[name]
    for golden, live in zip(GOLDEN[name], theirs["golden"][name], strict=True):
        before, now = (decode(kind, base64.b64decode(one)) for one in (golden, live))
        assert encode(before) == encode(now)
