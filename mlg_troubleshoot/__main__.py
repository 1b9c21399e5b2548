"""``python -m mlg_troubleshoot`` is the console command ``mlg``."""

from mlg_troubleshoot.cli import main

if __name__ == "__main__":
    main()
