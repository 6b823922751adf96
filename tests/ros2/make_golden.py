"""Golden bytes of every message, as rclpy of ROS 2 Jazzy serializes them.

    ROS2_PYTHON tests/ros2/make_golden.py tests/harness/interface/ros2/golden.json

Each message is made three times: as it is by default, with every field set to a value of its own
and sequences of two, and with sequences of none. Values come from `FILL`, which the tests use, too.
"""

import base64
import importlib
import json
import sys
from pathlib import Path

from rclpy.serialization import serialize_message

sys.path.insert(0, str(Path(__file__).parent))
from fill import MESSAGES, Fill


def main():
    golden = {}
    for name in MESSAGES:
        package, _, kind = name.split("/")
        try:
            message = getattr(importlib.import_module(f"{package}.msg"), kind)
        except ModuleNotFoundError:  # tf2_msgs has no wheel
            continue
        variants = [message(), Fill(2).message(message()), Fill(0).message(message())]
        golden[name] = [base64.b64encode(serialize_message(one)).decode() for one in variants]
    Path(sys.argv[1]).write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
