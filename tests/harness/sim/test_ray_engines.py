"""Both ray engines lead to the same decisions."""

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build


def test_both_ray_engines_give_the_same_chain(tmp_path):
    chains = []
    for engine in ("tile", "mujoco"):
        settings = [f"sensors.engine={engine}", "episode.time_limit=3"]
        config = override(Config("empty", "drone", 1), settings)
        assert config.sensors.engine == engine
        chains.append(run_episode(build(config), tmp_path / f"{engine}.mcap").chain)
    assert chains[0] == chains[1]
