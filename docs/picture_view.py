"""Take a screenshot of a saved view in Rerun, without a screen.

Usage: python docs/picture_view.py FILE.rrd SECONDS OUT.png

It needs a Vulkan driver; Mesa's lavapipe (Debian: mesa-vulkan-drivers, libvulkan1) is enough.
"""

import ctypes
import io
import socket
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image
from rerun.experimental import ViewerClient

from wayproof.harness.viewer.rerun_view import loopback_viewer

NEEDS = "Rerun's viewer needs a Vulkan driver: apt-get install mesa-vulkan-drivers libvulkan1"
SETTLE = 3.0  # s, for data and shaders to arrive


def main(recording: Path, seconds: float, out: Path) -> None:
    """Open the recording at a simulated time, and save a screenshot in 128 colours."""
    start = loopback_viewer(Path(tempfile.mkdtemp()))
    try:
        with ViewerClient.spawn(
            headless=True,
            port=free_port(),
            hide_welcome_screen=True,
            executable_path=str(start),
        ) as viewer:
            viewer.open(str(recording))
            time.sleep(SETTLE)
            viewer.set_time("time", duration=seconds, play_state="paused")
            time.sleep(SETTLE)
            shot = Image.open(io.BytesIO(viewer.take_screenshot()))
    except ConnectionError as error:  # the viewer exits without a driver
        sys.exit(f"no picture here: {error}; {NEEDS}")
    shot = shot.convert("RGB").resize((1440, 810), Image.Resampling.LANCZOS)
    shot.quantize(128).save(out, optimize=True)


def check_vulkan() -> None:
    """Exit if there is no Vulkan: the viewer would exit too, only 5 s later."""
    try:
        ctypes.CDLL("libvulkan.so.1")
    except OSError as error:
        sys.exit(f"no picture here: {error}; {NEEDS}")


def free_port() -> int:
    """A port that nothing listens on."""
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        port: int = one.getsockname()[1]
        return port


if __name__ == "__main__":
    check_vulkan()
    main(Path(sys.argv[1]), float(sys.argv[2]), Path(sys.argv[3]))
