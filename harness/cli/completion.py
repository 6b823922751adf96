"""`wayproof completion`: print the completion script of a shell."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.catalogue import Catalogue, read_catalogue
from wayproof.harness.cli.verb import Document, Verb

SHELLS = ("bash", "zsh", "fish")

# Bash ends words at = and :, which are parts of settings and perturbations, and it replaces only
# what follows the last of them.
BASH = r"""
_wayproof_words_joined() {
  local -a joined=()
  local i word count=0 open=0 last=${COMP_WORDS[COMP_CWORD]}
  for ((i = 0; i <= COMP_CWORD; i++)); do
    word=${COMP_WORDS[i]}
    if ((open)) || [[ $count -gt 0 && $word == [=:]* ]]; then
      joined[count - 1]+=$word
    else
      joined[count++]=$word
    fi
    [[ $word == *[=:] ]] && open=1 || open=0
  done
  [[ $last == [=:] ]] && last=""
  local before=${joined[count - 1]%"$last"}
  local -a COMP_WORDS=("${joined[@]}")
  local COMP_CWORD=$((count - 1))
  _shtab_wayproof "$@"
  local reply
  local -a replies=()
  for reply in "${COMPREPLY[@]}"; do
    [[ $reply == "$before" ]] || replies+=("${reply#"$before"}")
  done
  COMPREPLY=("${replies[@]}")
  [[ ${#COMPREPLY[@]} -gt 0 && ${COMPREPLY[0]} == *= ]] && compopt -o nospace 2>/dev/null
  return 0
}

complete -o bashdefault -F _wayproof_words_joined wayproof
"""


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Print the script."""
    import shtab

    script = shtab.complete(_parser_with_values(), options.shell)
    if options.shell == "bash":
        script += BASH
    if not console.quiet:
        console.file.write(f"{script}\n")  # as it is: rich would wrap it
    return 0, {"shell": options.shell, "script": script}


def _parser_with_values() -> argparse.ArgumentParser:
    """Return the parser of the command with the possible values of each argument."""
    import shtab

    from wayproof.harness.cli.main import parsers

    names = values_of(read_catalogue())
    parser, verbs = parsers()
    for verb in verbs.values():
        for action in verb._actions:
            if action.dest in names and action.choices is None and action.type is not Path:
                action.choices = names[action.dest]
            elif action.dest == "log":
                action.complete = shtab.glob("*.mcap")  # type: ignore[attr-defined]
            elif action.type is Path:
                action.complete = shtab.FILE  # type: ignore[attr-defined]
    return parser


def values_of(catalogue: Catalogue) -> dict[str, list[str]]:
    """Return values of arguments by their name in the parser."""
    kinds = catalogue["perturbations"]
    modes = {kind: ["", *(f":{mode}" for mode in entry.choices)] for kind, entry in kinds.items()}
    severities = range(1, 6)
    settings = catalogue["settings"]
    chosen = [f"{name}={value}" for name, entry in settings.items() for value in entry.choices]
    return {
        "world": list(catalogue["worlds"]),
        "robot": list(catalogue["robots"]),
        "stack": list(catalogue["stacks"]),
        "perturb": [
            f"{kind}:{one}{mode}" for kind in kinds for one in severities for mode in modes[kind]
        ],
        "file": list(catalogue["studies"]),
        "stage": list(catalogue["benches"]),
        "name": [*catalogue, *(name for entries in catalogue.values() for name in entries)],
        "set": [*(f"{name}=" for name in settings), *chosen],
    }


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="shell of the script")


VERB = Verb(
    help='print a completion script for bash, zsh or fish: eval "$(wayproof completion bash)"',
    add_arguments=_add_arguments,
    run=run,
    example="wayproof completion bash",
)
