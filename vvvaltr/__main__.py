"""`python -m vvvaltr`: the same as the `vvvaltr` command."""

from __future__ import annotations

import sys

from vvvaltr.controller.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
