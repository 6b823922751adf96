"""Verbs of the command line, one file each."""

from wayproof.harness.cli import (
    audit,
    bench,
    calibrate,
    compare,
    completion,
    convert,
    demo,
    explain,
    export,
    falsify,
    import_world,
    lab,
    list_,
    picture,
    recover,
    replay,
    report,
    robot,
    run,
    score,
    serve,
    shadow,
    sign,
    study,
    threshold,
    verify,
    view,
)
from wayproof.harness.cli.verb import Document, Verb

VERBS: dict[str, Verb] = {
    "run": run.VERB,
    "shadow": shadow.VERB,
    "replay": replay.VERB,
    "verify": verify.VERB,
    "explain": explain.VERB,
    "audit": audit.VERB,
    "score": score.VERB,
    "lab": lab.VERB,
    "study": study.VERB,
    "threshold": threshold.VERB,
    "calibrate": calibrate.VERB,
    "falsify": falsify.VERB,
    "report": report.VERB,
    "compare": compare.VERB,
    "view": view.VERB,
    "picture": picture.VERB,
    "convert": convert.VERB,
    "export": export.VERB,
    "recover": recover.VERB,
    "sign": sign.VERB,
    "serve": serve.VERB,
    "list": list_.VERB,
    "demo": demo.VERB,
    "bench": bench.VERB,
    "import": import_world.VERB,
    "robot": robot.VERB,
    "completion": completion.VERB,
}
"""Name on the command line -> verb, in the order of `--help`."""

RENAMED = {"critical": "threshold", "search": "falsify"}
"""Former name of a verb -> its name."""

__all__ = ["RENAMED", "VERBS", "Document", "Verb"]
