"""The commands of ``inspection_data/DIAGNOSIS.md`` and what they print.

``python -m tests.diagnosis.story`` renews what is shown.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "inspection_data"
STORY = FOLDER / "DIAGNOSIS.md"
_CONSOLE = re.compile(r"```console\n\$ (?P<command>[^\n]*)\n(?P<shown>.*?)\n```", re.DOTALL)
_PYTHON = re.compile(r"```python\n(?P<code>from pathlib.*?)\n```\n\n```text\n(?P<shown>.*?)\n```", re.DOTALL)
CUT = "…"


def examples(text: str) -> list[tuple[str, str]]:
    """Commands, or code, with the output that is shown, in their order.

    Parameters
    ----------
    text : str
        The document.

    Returns
    -------
    list of tuple of str
        Command or code, and its output.
    """
    found = [(m.start(), m["command"], m["shown"]) for m in _CONSOLE.finditer(text)]
    found += [(m.start(), m["code"], m["shown"]) for m in _PYTHON.finditer(text)]
    return [(command, shown) for _place, command, shown in sorted(found)]


def printed(command: str, folder: Path) -> str:
    """Run a command or code in a folder.

    Parameters
    ----------
    command : str
        A command that starts with ``mlg``, or Python code.
    folder : Path
        A copy of the data sets.

    Returns
    -------
    str
        What it prints, results before messages.
    """
    words = shlex.split(command)[1:] if command.startswith("mlg ") else []
    arguments = ["-m", "mlg_troubleshoot", *words] if words else ["-c", command]
    room = {**os.environ, "COLUMNS": "110", "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=room,
        capture_output=True,
        text=True,
        encoding="utf-8",
        check=False,
    )
    return "\n".join(line.rstrip() for line in (done.stdout + done.stderr).splitlines())


def copied(folder: Path) -> Path:
    """Copy the data sets, so that commands may write beside them.

    Parameters
    ----------
    folder : Path
        Where to.

    Returns
    -------
    Path
        The copy.
    """
    return Path(shutil.copytree(FOLDER, folder / "inspection_data"))


def main() -> int:
    """Renew the outputs in the story.

    Returns
    -------
    int
        Exit code.
    """
    text = STORY.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        place = copied(Path(folder))
        for command, shown in examples(text):
            now = printed(command, place)
            if shown.endswith(CUT):
                now = "\n".join([*now.splitlines()[: len(shown.splitlines()) - 1], CUT])
            text = text.replace(f"{command}\n{shown}\n```", f"{command}\n{now}\n```")
            text = text.replace(f"{command}\n```\n\n```text\n{shown}\n```", f"{command}\n```\n\n```text\n{now}\n```")
    STORY.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
