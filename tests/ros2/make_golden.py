"""Golden bytes of every message as rclpy serializes them; run by a Python that has rclpy.

`.venv-ros2/bin/python tests/ros2/make_golden.py FILE` writes the file of the tests. Each message is
made three times: as it is by default, with every field set to a value of its own and sequences of
two, and the same with empty sequences. The bytes between values are as Fast DDS left them.
"""

import base64
import importlib
import json
import sys
from pathlib import Path

from rclpy.serialization import deserialize_message, serialize_message

sys.path.insert(0, str(Path(__file__).parents[1] / "harness/interface/ros2"))
from fill import MESSAGES, Fill


def golden():
    """By the message's type, its bytes in base64."""
    found = {}
    for name in MESSAGES:
        package, _, kind = name.split("/")
        try:
            message = getattr(importlib.import_module(f"{package}.msg"), kind)
        except ModuleNotFoundError:  # tf2_msgs has no wheel; its transforms do
            continue
        variants = [message(), Fill(2).message(message()), Fill(0).message(message())]
        found[name] = [base64.b64encode(serialize_message(one)).decode() for one in variants]
    return found


def misread(ours):
    """The filled messages among bytes of others that rclpy reads differently."""
    wrong = []
    for name, variants in ours.items():
        package, _, kind = name.split("/")
        message = getattr(importlib.import_module(f"{package}.msg"), kind)
        expected = [Fill(2).message(message()), Fill(0).message(message())]
        read = [deserialize_message(base64.b64decode(one), message) for one in variants]
        if read != expected:
            wrong.append(name)
    return wrong


if __name__ == "__main__":
    if sys.argv[1] == "-":  # what of standard input rclpy misreads
        print(json.dumps({"golden": golden(), "misread": misread(json.load(sys.stdin))}))
    else:
        Path(sys.argv[1]).write_text(json.dumps(golden(), indent=1) + "\n")
