"""Short recorded episodes, and copies of logs with edited messages."""

from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import write_copy
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.moments import moments
from wayproof.harness.replay.audit import Auditor

SHORT = {
    "drone": ("empty", "drone", 1, "episode.time_limit=2"),
    "quadruped": ("corridor", "quadruped", 1, "episode.time_limit=2"),
}


def altered(source, target, change):
    """Copy a log with valid checksums and its messages edited in place by `change`."""
    log = open_log(source)
    messages = list(read_messages(source))
    for message in messages:
        change(message)
    head = read_head(walk(source, head_only=True), source, False)
    write_copy(target, head, messages, log.result)
    return target


def committed_of(log):
    """What each decision of a log committed to, in order; each holds until the next."""
    auditor = Auditor()
    for moment in moments(log):
        committed = auditor.committed(moment)
        yield committed
        auditor.follow(committed)
