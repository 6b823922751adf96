"""Train the policy of the reference stack `imitation`: DAgger from the stack `dwa`.

Ross, Gordon and Bagnell 2011, "A reduction of imitation learning and structured prediction to
no-regret online learning", AISTATS, algorithm 3.1: the expert drives the episodes of round 0, the
policy of the round before those of each later one (beta is 1, then 0); the expert labels them all.
Each round starts new episodes, so their share of successes is that of a policy on unseen seeds, by
which the best one is chosen.

Usage: python examples/policy/train.py FOLDER [--rounds N] [--jobs N]

Writes `policy.onnx`, `rounds.json` and `curve.svg` to FOLDER, and `round-K.npz` with the samples of
each round, from which it continues if it is run again.
"""

from __future__ import annotations

import argparse
import json
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")  # sums in one order

import gymnasium
import matplotlib as mpl
import numpy as np
import onnx
from network import mirrored, nearest_twists, onnx_model, train

from wayproof.harness.gym import environment_id
from wayproof.harness.interface.policy import PolicyStack
from wayproof.harness.interface.stacks.dwa import Dwa

WORLDS = ("warehouse", "office", "forest", "crossing")
"""Worlds of the episodes, each driven by the quadruped."""

FIRST_SEED = 1000
"""First seed of round 0; the tables in the docs use seeds below it."""

EPISODES = 6
"""Episodes of each world in a round, each of a seed of its own."""

SETTINGS = ("episode.time_limit=90", "episode.stuck_after=15", "motion.limits=cautious")
"""Settings of the episodes, which end early where nothing is learned any more, at up to 1 m/s."""


class Rollout(NamedTuple):
    """One episode, labelled.

    Attributes:
        inputs: Tensors of the policy, (steps, ...) each.
        labels: Twist of the expert, (steps,) numbers of `TWISTS`.
        outcome: How the episode ended.
        world: Where.
    """

    inputs: dict[str, np.ndarray]
    labels: np.ndarray
    outcome: str
    world: str


def roll_out(world: str, seed: int, policy: Path | None) -> Rollout:
    """Drive an episode by the policy, or by the expert if there is none, and label each step."""
    env = gymnasium.make(environment_id(world, "quadruped"), settings=SETTINGS)
    tensors, _ = env.reset(seed=seed)
    own = env.unwrapped
    expert, driver = Dwa(), None if policy is None else PolicyStack(policy)
    expert.start(own.task)
    limits = np.array([own.task.mission.max_speed, own.task.mission.max_yaw_rate])
    seen, labels, ended, info = [], [], False, {}
    while not ended:
        motion = expert.step(own.seen).motion
        twist = np.array([motion.forward, motion.yaw_rate]) / limits
        seen.append(tensors)
        labels.append(twist)
        if driver is None:
            action = np.array([twist[0], 0.0, 0.0, twist[1]], np.float32)
        else:
            action = driver.act(tensors)
        tensors, _, terminated, truncated, info = env.step(action)
        ended = terminated or truncated
    env.close()
    stacked = {name: np.stack([one[name] for one in seen]) for name in tensors}
    return Rollout(stacked, nearest_twists(np.array(labels)), info["outcome"], world)


def episodes_of(number: int) -> list[tuple[str, int]]:
    """World and seed of each episode of a round."""
    first = FIRST_SEED + EPISODES * number
    return [(world, seed) for world in WORLDS for seed in range(first, first + EPISODES)]


def main() -> None:
    """Train, and write the policy, the figures of each round and their curve."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--rounds", type=int, default=8, help="of DAgger, without the expert's")
    parser.add_argument("--jobs", type=int, default=2, help="processes; the result is the same")
    options = parser.parse_args()
    if options.rounds < 1:
        parser.error(f"--rounds: got {options.rounds}, expected at least 1, to choose a policy by")
    folder: Path = options.folder
    folder.mkdir(parents=True, exist_ok=True)
    rounds: list[dict[str, object]] = []
    samples: list[tuple[dict[str, np.ndarray], np.ndarray]] = []
    policy: Path | None = None
    for number in range(options.rounds + 1):
        kept = folder / f"round-{number}.npz"
        if not kept.exists():
            _drive(kept, episodes_of(number), policy, options.jobs)
        with np.load(kept) as file:
            outcomes = file["outcomes"].tolist()
            samples.append(({k: file[k] for k in file if k not in APART}, file["labels"]))
        network, loss = train(*mirrored(samples), seed=number)
        policy = folder / f"policy-{number}.onnx"
        onnx.save(onnx_model(network), policy)
        rounds.append(_figures(number, outcomes, samples, loss))
        print(json.dumps(rounds[-1]), flush=True)
    (folder / "rounds.json").write_text(json.dumps(rounds, indent=1) + "\n")
    chosen = best(rounds)
    print(f"best: policy {chosen}", flush=True)
    (folder / "policy.onnx").write_bytes((folder / f"policy-{chosen}.onnx").read_bytes())
    draw(rounds, folder / "curve.svg")


def best(rounds: list[dict[str, object]]) -> int:
    """Number of the policy that drove most episodes of its round to the goal, the later of two.

    Policy k drives round k + 1; the last one has driven none.
    """
    driven = [(one["success"], -one["collision"], one["round"] - 1) for one in rounds[1:]]
    return max(driven)[2]


APART = ("labels", "outcomes")
"""Arrays of a round's file that are no inputs."""


def _drive(kept: Path, episodes: list[tuple[str, int]], policy: Path | None, jobs: int) -> None:
    """Drive and label the episodes of a round, in processes."""
    context = get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as pool:
        runs = [pool.submit(roll_out, world, seed, policy) for world, seed in episodes]
        rollouts = [run.result() for run in runs]
    inputs = {
        name: np.concatenate([one.inputs[name] for one in rollouts]) for name in rollouts[0].inputs
    }
    labels = np.concatenate([one.labels for one in rollouts])
    outcomes = np.array([one.outcome for one in rollouts])
    partial = kept.with_suffix(".partial.npz")
    np.savez_compressed(partial, labels=labels, outcomes=outcomes, **inputs)
    partial.replace(kept)


def _figures(
    number: int,
    outcomes: list[str],
    samples: list[tuple[dict[str, np.ndarray], np.ndarray]],
    loss: float,
) -> dict[str, object]:
    """What a round showed: of its driver, and of the network trained on all samples so far."""
    starts = range(0, len(outcomes), EPISODES)
    by_world = [outcomes[first : first + EPISODES] for first in starts]
    return {
        "round": number,
        "driver": "dwa" if number == 0 else f"policy {number - 1}",
        "episodes": len(outcomes),
        "success": sum(one == "success" for one in outcomes),
        "collision": sum(one == "collision" for one in outcomes),
        "success by world": {
            world: sum(one == "success" for one in ended)
            for world, ended in zip(WORLDS, by_world, strict=True)
        },
        "samples": sum(len(labels) for _, labels in samples),
        "loss": round(loss, 4),
    }


def draw(rounds: list[dict[str, object]], path: Path) -> None:
    """Draw the share of successes and collisions of each round."""
    mpl.use("svg")
    from matplotlib import pyplot as plt

    mpl.rcParams["svg.hashsalt"] = "wayproof"
    figure, axes = plt.subplots(figsize=(6, 3))
    numbers = [one["round"] for one in rounds]
    for name in ("success", "collision"):
        shares = [one[name] / one["episodes"] for one in rounds]
        axes.plot(numbers, shares, marker="o", label=name)
    axes.set(xlabel="round (0: dwa drives)", ylabel="share of episodes", ylim=(0.0, 1.0))
    axes.legend(frameon=False)
    figure.tight_layout()
    figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    main()
