"""Completion scripts of shells, for `wayproof --completion SHELL`."""

from __future__ import annotations

from pathlib import Path

from wayproof.harness.cli import VERBS
from wayproof.harness.cli.arguments import Parser
from wayproof.harness.cli.catalogue import Catalogue, read_catalogue

# Bash ends words at = and :, which are parts of settings and perturbations, and it replaces only
# what follows the last of them. A kind of a verb stands where its log may stand, which shtab does
# not know.
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
KINDS
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


def script(shell: str) -> str:
    """Return the completion script of a shell: `bash`, `zsh` or `fish`."""
    import shtab

    text: str = shtab.complete(_parser_with_values(), shell)
    if shell != "bash":
        return text
    kinds = (
        f"  [[ $COMP_CWORD == 2 && ${{COMP_WORDS[1]}} == {name} ]] && "
        f'COMPREPLY+=($(compgen -W "{" ".join(verb.kinds)}" -- "$last"))'
        for name, verb in VERBS.items()
        if verb.kinds
    )
    return text + BASH.replace("KINDS", "\n".join(kinds))


def _parser_with_values() -> Parser:
    """Return the parser of the whole command with the possible values of each argument."""
    from wayproof.harness.cli.main import parser_of, whole_parser

    names = values_of(read_catalogue())
    whole = whole_parser()
    verbs = whole.add_subparsers()
    for name, verb in VERBS.items():
        parents = _with_values(parser_of(name), names)
        parser = verbs.add_parser(name, help=verb.help, parents=[parents], add_help=False)
        kinds = parser.add_subparsers() if verb.kinds else None
        for kind, one in verb.kinds.items():
            parents = _with_values(parser_of(f"{name} {kind}"), names)
            assert kinds is not None
            kinds.add_parser(kind, help=one.help, parents=[parents], add_help=False)
    return whole


def _with_values(parser: Parser, names: dict[str, list[str]]) -> Parser:
    """Add the possible values to the arguments of a parser."""
    import shtab

    for action in parser._actions:
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
        "part": list(catalogue["benches"]),
        "name": [*catalogue, *(name for entries in catalogue.values() for name in entries)],
        "set": [*(f"{name}=" for name in settings), *chosen],
    }
