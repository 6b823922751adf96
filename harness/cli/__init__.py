"""Verbs of the command line, one file each."""

from wayproof.harness.cli import (
    audit,
    bench,
    compare,
    explain,
    export,
    import_,
    lab,
    list_,
    regress,
    replay,
    report,
    run,
    serve,
    shadow,
    shrink,
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
    "audit": audit.VERB,
    "explain": explain.VERB,
    "shrink": shrink.VERB,
    "regress": regress.VERB,
    "view": view.VERB,
    "export": export.VERB,
    "study": study.VERB,
    "compare": compare.VERB,
    "report": report.VERB,
    "import": import_.VERB,
    "list": list_.VERB,
    "lab": lab.VERB,
    "serve": serve.VERB,
    "bench": bench.VERB,
}
"""Name on the command line -> verb, in the order of `--help`."""

COMMANDS: dict[str, Verb] = {}
"""Every command by its name, which is a verb or a verb and its kind."""

for _name, _verb in VERBS.items():
    COMMANDS[_name] = _verb
    COMMANDS |= {f"{_name} {_kind}": _one for _kind, _one in _verb.kinds.items()}

__all__ = ["COMMANDS", "VERBS", "Document", "Verb"]
