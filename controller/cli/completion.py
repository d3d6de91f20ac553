"""`vvvaltr completion`: commands, options and choices at the press of Tab."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from vvvaltr.controller.cli.answer import Answer, Subcommand


def _add_arguments(parser: ArgumentParser) -> None:
    parser.add_argument("shell", choices=("bash", "zsh", "tcsh"), help="the shell: bash, zsh or tcsh")


def _execute(arguments: Namespace) -> Answer:
    import shtab

    from vvvaltr.controller.cli.main import make_parser

    script = shtab.complete(make_parser(commands_help="command"), arguments.shell)
    return Answer(script, {"shell": arguments.shell, "script": script})


COMMAND = Subcommand(
    help="print the completion script of a shell, so that Tab completes commands and options",
    example="vvvaltr completion bash > ~/.local/share/bash-completion/completions/vvvaltr",
    add_arguments=_add_arguments,
    execute=_execute,
)
