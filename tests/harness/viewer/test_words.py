"""Text of a decision."""

from wayproof.harness.log.reader import open_log
from wayproof.harness.viewer.words import describe


def test_words_have_action_reason_and_map(log):
    opened = open_log(log)
    decision = next(opened.decisions())
    text = describe(decision, opened.config.costmap.cost_range)
    assert decision.action in text
    assert decision.reason in text
    assert decision.map_version[:12] in text
