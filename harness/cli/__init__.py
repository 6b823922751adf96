"""The verbs of the command line, one file each."""

from wayproof.harness.cli import (
    audit,
    bench,
    calibrate,
    compare,
    completion,
    convert,
    critical,
    demo,
    explain,
    import_world,
    listing,
    picture,
    recover,
    replay,
    report,
    run,
    score,
    search,
    sign,
    study,
    verify,
    view,
)
from wayproof.harness.cli.verb import Document, Verb

VERBS: dict[str, Verb] = {
    "run": run.VERB,
    "replay": replay.VERB,
    "verify": verify.VERB,
    "explain": explain.VERB,
    "audit": audit.VERB,
    "score": score.VERB,
    "study": study.VERB,
    "critical": critical.VERB,
    "calibrate": calibrate.VERB,
    "search": search.VERB,
    "report": report.VERB,
    "compare": compare.VERB,
    "view": view.VERB,
    "picture": picture.VERB,
    "convert": convert.VERB,
    "recover": recover.VERB,
    "sign": sign.VERB,
    "list": listing.VERB,
    "demo": demo.VERB,
    "bench": bench.VERB,
    "import": import_world.VERB,
    "completion": completion.VERB,
}
"""Name on the command line -> verb, in the order in which `--help` shows them."""

__all__ = ["VERBS", "Document", "Verb"]
