"""Seeds: every random stream is named, so that drawing from one never shifts another."""

import hashlib

LARGEST_SEED = 2**31 - 1


def plan_seed(episode_seed: int, stream: str, sequence: int) -> int:
    """Return the seed of one draw of one stream: BLAKE2b (RFC 7693) of its three names.

    Args:
        episode_seed: Seed of the episode.
        stream: Name of the stream, such as `"plan"`.
        sequence: Number of the draw within the stream.

    Returns:
        Integer in [1, 2**31 - 1]; OMPL does not accept 0.
    """
    name = f"{episode_seed}/{stream}/{sequence}".encode()
    digest = hashlib.blake2b(name, digest_size=8).digest()
    return int.from_bytes(digest, "little") % LARGEST_SEED + 1
