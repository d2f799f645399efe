"""`tailbyte completion`: the script that makes bash, zsh or fish complete commands, options and what they take."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from analyzer.cli import status
from analyzer.cli.arguments import options

if TYPE_CHECKING:
    import argparse

NAME = "tailbyte completion"
SHELLS = ("bash", "zsh", "fish")
_EPILOG = """\
The script holds all names - of commands, options, types, fields, rules, pages of the manual -, so that a TAB starts no
program. Write it once, and again after an update or for types of your own (--dissector):

  tailbyte completion bash > ~/.local/share/bash-completion/completions/tailbyte
  tailbyte completion zsh > ~/.zfunc/_tailbyte    (a folder of fpath)
  tailbyte completion fish > ~/.config/fish/completions/tailbyte.fish"""


def add(parser: argparse.ArgumentParser) -> None:
    """Add what the command says of itself, and its options."""
    parser.usage = f"%(prog)s [options] {'|'.join(SHELLS)}"
    parser.description = __doc__
    parser.epilog = _EPILOG
    parser.add_argument("shell", nargs="?", choices=SHELLS, metavar="SHELL", help=", ".join(SHELLS))
    options.add_dissectors(parser)
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    import dissectors  # noqa: PLC0415
    from analyzer.app.process.start import plain_arrow  # noqa: PLC0415
    from dissectors import DsdlError, ProfileError  # noqa: PLC0415

    if args.shell is None:
        return status.usage(f"which shell? {NAME} {', '.join(SHELLS[:-1])} or {SHELLS[-1]}", NAME)
    plain_arrow()
    from analyzer.cli.completion.script import script  # noqa: PLC0415

    try:
        sys.stdout.write(script(args.shell, dissectors.load(*options.folders(args))))
    except (DsdlError, ProfileError, OSError) as error:
        return status.usage(error, NAME)
    return status.OK
