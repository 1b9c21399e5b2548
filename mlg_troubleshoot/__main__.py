"""``python -m mlg_troubleshoot`` is the console command ``mlg``."""

import os
import sys


def run() -> None:
    """Take the current folder, which holds files of others, off the module path and start."""
    if sys.path[0] in {"", os.getcwd()}:  # noqa: PTH109 - pathlib would be imported from there
        del sys.path[0]
    from mlg_troubleshoot.cli import main

    main()


if __name__ == "__main__":
    run()
