"""Verbs of the command line, one file each."""

from wayproof.harness.cli import (
    audit,
    bench,
    compare,
    completion,
    convert,
    demo,
    explain,
    export,
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

__all__ = ["VERBS", "Document", "Verb"]
