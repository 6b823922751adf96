"""Size of logs, cost of writing them, and speed of their replay.

`python -m wayproof.harness.bench.micro.log` prints one JSON document.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
from google.protobuf.message import Message

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.input_messages import decode_ranges
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import time_of, topic_of
from wayproof.harness.log.head import Head, read_head
from wayproof.harness.log.writer import FLUSH_PERIOD_NS, LogWriter
from wayproof.harness.replay.replay import replay
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.warm_up import warm_up
from wayproof.models.sensors import range_codec
from wayproof.models.sensors.beams import NO_RETURN

ROBOTS = ("quadruped", "drone")
LOADS = ("own", "ideal-lidar-dense")
SETTINGS = ("episode.time_limit=30",)
NOISE_MM = 10.0


@dataclass(frozen=True)
class LogRow:
    """One episode's log.

    Attributes:
        robot: Name of the robot.
        lidar: Name of the lidar.
        sim_time_s: Simulated time.
        full_mb_per_min: Size of the log for each simulated minute.
        noisy_mb_per_min: Size for each simulated minute with 1 cm of noise on every range.
        states_mb_per_min: Share of the saved states in the first.
        decisions_mb_per_min: Size for each simulated minute with `record = decisions`.
        episode_s: Processor time of the episode.
        logging_share: Share of it for encoding, packing, compressing and writing the log, on both
            threads.
        logging_own_share: The part of that on the episode's own thread, which waits for no other.
        replay_s: Processor time of the replay.
        replay_of_episode: Episode's processor time over the replay's.
        replay_of_simulated: Simulated time over the replay's processor time.
        wall_of_episode: Episode's wall time over the replay's.
    """

    robot: str
    lidar: str
    sim_time_s: float
    full_mb_per_min: float
    noisy_mb_per_min: float
    states_mb_per_min: float
    decisions_mb_per_min: float
    episode_s: float
    logging_share: float
    logging_own_share: float
    replay_s: float
    replay_of_episode: float
    replay_of_simulated: float
    wall_of_episode: float


def bench_log(robot: str, lidar: str) -> LogRow:
    """Run one warehouse episode and measure its log."""
    config = override(Config("warehouse", robot, 1), [*SETTINGS, f"sensors.lidar={lidar}"])
    warm_up(config)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run_episode(build(override(config, ["episode.time_limit=2"])), folder / "warm.mcap")
        began = time.process_time()
        result = run_episode(build(config), folder / "a.mcap")
        episode = time.process_time() - began
        path = Path(result.log)
        head = read_head(walk(path, head_only=True), path, False)
        messages = list(read_messages(path))
        sweeps = [message for message in messages if isinstance(message, pb.Sweep)]
        ranges = [(decode_ranges(sweep).astype(np.uint16), sweep.rows) for sweep in sweeps]
        minutes = result.sim_time_s / 60.0
        began, own_began = time.process_time(), time.thread_time()
        _write(folder / "again.mcap", head, messages, "full")
        for image, rows in ranges:
            range_codec.encode(image, rows)
        logging, own = time.process_time() - began, time.thread_time() - own_began
        replayed, replay_wall = _replay(path)
        sizes = {"full": result.log_mb_per_min}
        small = [one for one in messages if not isinstance(one, pb.State)]
        sizes["no states"] = _write(folder / "b.mcap", head, small, "full") / minutes
        _blur(messages)
        sizes["noisy"] = _write(folder / "c.mcap", head, messages, "full") / minutes
        kept = replace(config, record="decisions")
        sizes["decisions"] = run_episode(build(kept), folder / "d.mcap").log_mb_per_min
    return LogRow(
        robot=robot,
        lidar=lidar,
        sim_time_s=result.sim_time_s,
        full_mb_per_min=sizes["full"],
        noisy_mb_per_min=sizes["noisy"],
        states_mb_per_min=sizes["full"] - sizes["no states"],
        decisions_mb_per_min=sizes["decisions"],
        episode_s=episode,
        logging_share=logging / episode,
        logging_own_share=own / episode,
        replay_s=replayed,
        replay_of_episode=episode / replayed,
        replay_of_simulated=result.sim_time_s / replayed,
        wall_of_episode=result.wall_time_s / replay_wall,
    )


def _replay(path: Path) -> tuple[float, float]:
    """Return the processor time and wall time of a replay, s."""
    processor, wall = time.process_time(), time.perf_counter()
    assert replay(path).identical
    return time.process_time() - processor, time.perf_counter() - wall


def _write(path: Path, head: Head, messages: list[Message], record: str) -> float:
    """Write messages as an episode does; returns the log's size, MB."""
    config, mission = head.attachments["config.json"], head.attachments["mission.json"]
    with LogWriter(path, config, mission, head.scene, head.run, FLUSH_PERIOD_NS) as log:
        log.record = record
        for message in messages:
            log.write(topic_of(message), message, time_of(message))
        log.finish({})
    return path.stat().st_size * 1e-6


def _blur(messages: list[Message]) -> None:
    rng = np.random.default_rng(0)
    for message in messages:
        if isinstance(message, pb.Sweep):
            ranges = decode_ranges(message).astype(np.float64)
            noisy = np.rint(ranges + rng.normal(0.0, NOISE_MM, len(ranges))).clip(1, 65534)
            hit = (ranges > 0) & (ranges < NO_RETURN)
            blurred = np.where(hit, noisy, ranges).astype(np.uint16)
            message.ranges = range_codec.encode(blurred, message.rows)


if __name__ == "__main__":
    rows = [asdict(bench_log(robot, lidar)) for robot in ROBOTS for lidar in LOADS]
    print(msgspec.json.format(msgspec.json.encode({"rows": rows}), indent=1).decode())
