"""Train a policy by PPO of Stable-Baselines3, and write it as a file that `--stack policy:` loads.

Usage: python examples/policy/ppo.py FOLDER [--world WORLD] [--steps N]

Needs the extras `gym`, `policy` and `sb3`. Writes `policy.onnx` and `curve.json` to FOLDER: after
each rollout the steps, the seconds, and the mean reward of the last hundred episodes.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import gymnasium
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import SubprocVecEnv, VecNormalize

import wayproof.harness.gym
from wayproof.harness.gym.exported import save_sb3

ENVIRONMENTS = 2
"""Number of environments, each in a process of its own."""


class Curve(BaseCallback):
    """Notes how the rewards grow."""

    def __init__(self) -> None:
        """Start the clock."""
        super().__init__()
        self._began, self.rows = time.monotonic(), []

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        rewards = [one["r"] for one in self.model.ep_info_buffer]
        if rewards:
            seconds = round(time.monotonic() - self._began)
            self.rows.append([self.num_timesteps, seconds, round(float(np.mean(rewards)), 2)])
            print(*self.rows[-1], flush=True)


def main() -> None:
    """Train, and write the policy and its curve."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--world", default="Empty")
    parser.add_argument("--steps", type=int, default=100_000)
    args = parser.parse_args()
    name = f"Wayproof/{args.world.title()}-Quadruped-Flat-v0"

    def make() -> gymnasium.Env:
        return Monitor(gymnasium.make(name, settings=("episode.time_limit=30",)))

    environments = VecNormalize(SubprocVecEnv([make] * ENVIRONMENTS), norm_reward=False)
    model = PPO("MlpPolicy", environments, n_steps=1024, batch_size=256, device="cpu", seed=0)
    curve = Curve()
    model.learn(args.steps, callback=curve)
    args.folder.mkdir(parents=True, exist_ok=True)
    save_sb3(args.folder / "policy.onnx", model, environments)
    (args.folder / "curve.json").write_text(json.dumps(curve.rows))
    environments.close()


if __name__ == "__main__":
    assert wayproof.harness.gym.NAMESPACE == "Wayproof"  # importing it registers the ids
    main()
