import hashlib

from wayproof.planners import plan_seed


def test_seeds_are_named_draws():
    assert plan_seed(1, "plan", 2) == plan_seed(1, "plan", 2)
    seeds = {plan_seed(e, s, n) for e in range(9) for s in ("plan", "explore") for n in range(50)}
    assert len(seeds) == 9 * 2 * 50
    assert min(seeds) >= 1
    assert max(seeds) < 2**31
    # BLAKE2b, 8 bytes of "7/plan/0", little-endian, modulo 2^31 - 1, plus 1
    expected = hashlib.blake2b(b"7/plan/0", digest_size=8).digest()
    assert plan_seed(7, "plan", 0) == int.from_bytes(expected, "little") % (2**31 - 1) + 1
