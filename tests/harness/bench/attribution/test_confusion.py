"""Table of planted causes against those found."""

from wayproof.harness.bench.attribution.confusion import confusion, right, table


def test_what_is_found_is_counted():
    counts = confusion(["tracking"], range(1))
    assert (counts, right(counts)) == ({("tracking", "tracking"): 1}, 1.0)
    assert table(counts).row_count == 1
