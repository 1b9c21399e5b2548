"""The examples and pictures of README.md and docs/: run, drawn, compared, and brought up to date.

``python tests/docs_examples.py`` rewrites what the commands print and draws the pictures again (of
pages that are named only those); ``test_docs.py`` fails while that would change anything.
"""

from __future__ import annotations

import importlib
import inspect
import math
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.warm_mlg import folder_of_mlg

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PAGES = (README, *sorted((ROOT / "docs").rglob("*.md")), ROOT / "inspection_data" / "README.md")
PICTURES = ROOT / ".github" / "pictures"
_BLOCK = re.compile(r"^```console\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_PROMPT = "$ "
# A hash of a record, whole or its beginning.
_HASH = re.compile(r"\b[0-9a-f]{10}(?:[0-9a-f]{54})?\b")
# What stands between this and the next blank line is made from that file or module.
_MADE = re.compile(
    r"(?<=<!-- made by tests/docs_examples\.py from )(\S+)( -->\n).*?\n(?=\n|\Z)", re.DOTALL
)
_FONTS = "DejaVu Sans, Verdana, Segoe UI, sans-serif"


@dataclass(frozen=True)
class Session:
    """One fenced console block: commands, each with what it prints."""

    commands: tuple[str, ...]
    printed: tuple[str, ...]

    def written(self) -> str:
        """The block as it stands in the README, without its fences."""
        return "".join(
            f"{_PROMPT}{c}\n{p}" for c, p in zip(self.commands, self.printed, strict=True)
        )


def sessions(text: str) -> Iterator[tuple[re.Match[str], Session]]:
    """Find every console block of a text."""
    for match in _BLOCK.finditer(text):
        parts = re.split(rf"^{re.escape(_PROMPT)}", match[1], flags=re.MULTILINE)[1:]
        pairs = [part.partition("\n") for part in parts]
        yield match, Session(tuple(p[0] for p in pairs), tuple(p[2] for p in pairs))


def run(commands: tuple[str, ...], folder: Path) -> Session:
    """Run the commands of a block one after the other in a shell, as a reader would; stderr is not
    shown.
    """
    for name in ("inspection_data", "mlg_troubleshoot", "tests", "docs"):
        if not (folder / name).exists():
            (folder / name).symlink_to(ROOT / name)
    here = os.pathsep.join((folder_of_mlg(), str(Path(sys.executable).parent), os.environ["PATH"]))
    mark = "-- end of a command --"
    # Each command sees the exit code of the one before it, as at a prompt.
    script = "\n".join(
        f"{command}\ncode=$?; printf '%s\\n' '{mark}'; (exit $code)" for command in commands
    )
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=folder,
        env={**os.environ, "PATH": here, "TERM": "dumb", "COLUMNS": "110"},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        encoding="utf-8",
        check=False,
    )
    printed = [
        "\n".join(line.rstrip() for line in p.split("\n"))
        for p in done.stdout.split(f"{mark}\n")[:-1]
    ]
    return Session(commands, tuple(printed))


def columns_table() -> str:
    """The columns of an inspection table, one line per column, from the table of the package."""
    from mlg_troubleshoot import load_gear
    from mlg_troubleshoot.decision.columns import COLUMNS, Need
    from mlg_troubleshoot.gear.gear import DEFAULT_GAUGE_U_IN

    gear = load_gear()
    low, high = gear.down_lock_range
    numbers = {
        "gauge_u": f"{DEFAULT_GAUGE_U_IN:g} in",
        "margin": f"{gear.margin.value:g} in",
        "down_lock": f"{low:g} to {high:g} in",
    }
    lines = ["| column | need | meaning, range |", "|---|---|---|"]
    for column in COLUMNS:
        unit = "_in" if column.is_length else ""
        names = [] if column.needs_joint else [f"{column.name}{unit}"]
        names += [f"{column.name}_n{unit}"] * bool(column.joint_fills)
        names += [f"{column.name}_{k}{unit}" for k in range(2, column.copies + 1)]
        meaning = column.meaning.format(low=column.low, high=column.high, **numbers)
        if column.is_length and column.high < math.inf:
            meaning += f" Range {column.low:g} to {column.high:g} in."
        need = "" if column.need is Need.OTHERWISE else column.need.lower()
        lines.append(f"| {', '.join(f'`{name}`' for name in names)} | {need} | {meaning} |")
    return "\n".join(lines) + "\n"


def names_table(module: str) -> str:
    """The public names of a module with the first sentence of each docstring; of a room those that
    the package has not.
    """
    door = importlib.import_module(module)
    users = {} if "." in module else by_name(USERS_OF_NAMES)
    lines = ["| name | is | for |", "|---|---|---|"] if users else ["| name | is |", "|---|---|"]
    for name in sorted(door.__all__, key=str.lower):
        thing = getattr(door, name)
        above = getattr(importlib.import_module("mlg_troubleshoot"), name, None)
        if inspect.ismodule(thing) or (thing is above and "." in module):
            continue
        text = " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())
        text = re.sub(r":\w+:`~?([^`]+)`", r"`\1`", text.replace("``", "`")).replace("|", "\\|")
        call = name
        if inspect.isfunction(thing):
            call = f"{name}({', '.join(inspect.signature(thing).parameters)})"
        lines.append(f"| `{call}` | {text} |" + (f" {users[name]} |" if users else ""))
    return "\n".join(lines) + "\n"


def _commands(command: Any, path: str) -> Iterator[tuple[str, Any]]:
    yield path, command
    for name in command.list_commands(None) if hasattr(command, "commands") else ():
        yield from _commands(command.get_command(None, name), f"{path} {name}")


def all_commands() -> list[tuple[str, Any]]:
    """Every command of the program as it is typed, without ``mlg``."""
    from typer.main import get_command

    from mlg_troubleshoot.cli.app import app

    return [(path.removeprefix("mlg "), each) for path, each in _commands(get_command(app), "mlg")][
        1:
    ]


def commands_table() -> str:
    """Each command with its arguments and what it does."""
    lines = ["| command | does |", "|---|---|"]
    for path, command in all_commands():
        takes = [p.metavar for p in command.params if p.param_type_name == "argument"]
        words = " ".join(("mlg", path, *takes)).replace("|", "\\|")
        lines.append(f"| `{words}` | {' '.join(command.help.split(chr(10) * 2)[0].split())} |")
    return "\n".join(lines) + "\n"


# Who uses each option and how often: by its name, or by command and name where commands differ.
USERS = {
    "administrator": {"seldom": "--store; history verify --report", "weekly": "--expect; --quiet"},
    "analyst": {
        "seldom": "--approve; --causes; --design; --figure; --seed; --size; --workers"
        "; --write-table; diagnose --why; study --csv",
        "weekly": "--extension; --json; --write-extension",
    },
    "fleet engineer": {
        "seldom": "--columns; --dates; --decimal-comma; --format; --gear; --no-forecast; --why"
        "; fleet --joint",
        "weekly": "--amend; --annotate; --csv; --failed; --force; --keep; --map; --sheet; --since"
        "; --within",
    },
    "technician": {
        "daily": "--detail; --report; --show; --side; --tail",
        "weekly": "--convention; --date; --joint; --landings; --set; --unit; --work-order",
    },
}
# The same for the names of the package.
USERS_OF_NAMES = {
    "analyst": {
        "daily": "check; diagnose; load_gear; predict; read_inspections",
        "weekly": "Assessment; CheckOptions; CheckResult; ClearanceConvention; DiagnoseOptions"
        "; DiagnoseResult; Gear; Inspection; Outcome; Picture; Side; TroubleshootError; Verdict"
        "; WorstCase; check_files; diagnose_files; diagnose_simulation; load_model_extension"
        "; SimulationDiagnosis; Suspect; write_extension",
        "seldom": "Cause; IndexTable; load_index_table; run_study; shipped_gears; StudyFindings"
        "; StudyOptions",
    },
    "fleet engineer": {
        "weekly": "forecast; Lives; Problem; Store; write_reports",
        "seldom": "LengthUnit; parse_length; schema; survey; SurveyResult",
    },
}


def by_name(users: dict[str, dict[str, str]]) -> dict[str, str]:
    """Who uses each thing and how often, by its name."""
    return {
        name: f"{who}, {often}"
        for who, rows in users.items()
        for often, names in rows.items()
        for name in names.split("; ")
    }


def options_table() -> str:
    """Each option with the commands that have it, and who uses it how often."""
    users = by_name(USERS)
    found: dict[tuple[str, str, str], list[str]] = {}
    for path, command in all_commands():
        for option in command.params:
            if option.param_type_name == "option" and "--help" not in option.opts:
                names = [max(o, key=len) for o in (option.opts, option.secondary_opts) if o]
                words = f"{'/'.join(names)} {option.metavar or ''}".strip().replace("|", "\\|")
                user = users.get(f"{path} {names[0]}") or users[names[0]]
                variable = f" Else `{option.envvar}`." if option.envvar else ""
                key = words, f"{option.help}{variable}", user
                found.setdefault(key, []).append(path)
    log = [path for path, command in all_commands() if path.startswith("history ")]
    lines = ["| option | does | of | for |", "|---|---|---|---|"]
    lines += [
        f"| `{words}` | {does} | {', '.join(of).replace(', '.join(log), 'history')} | {user} |"
        for (words, does, user), of in sorted(found.items())
    ]
    return "\n".join(lines) + "\n"


# What makes the table below a mark; a module stands for its names.
_TABLES = {
    "mlg_troubleshoot/decision/columns.py": columns_table,
    "mlg_troubleshoot/cli/app.py": commands_table,
    "mlg_troubleshoot/cli/options.py": options_table,
}


def _table(source: str) -> str:
    return _TABLES[source]() if source in _TABLES else names_table(source)


def _with_hashes_of(before: str, printed: str) -> str:
    """What was printed, each hash of a record as it stood: it holds the clock."""
    old, new = before.splitlines(keepends=True), printed.splitlines(keepends=True)
    if len(old) != len(new):
        return printed
    masked = [[_HASH.sub("", line) for line in lines] for lines in (old, new)]
    return "".join(o if a == b else n for o, n, a, b in zip(old, new, *masked, strict=True))


def refreshed(text: str, folder: Path) -> str:
    """The README with what its commands print today."""
    text = _MADE.sub(lambda m: f"{m[1]}{m[2]}{_table(m[1])}", text)
    pieces, end = [], 0
    for match, session in sessions(text):
        printed = run(session.commands, folder).written()
        pieces += [text[end : match.start(1)], _with_hashes_of(match[1], printed)]
        end = match.end(1)
    return "".join((*pieces, text[end:]))


def pictures() -> dict[str, str]:
    """Draw the picture of the README: the linkage of the published failure."""
    from mlg_troubleshoot import ClearanceConvention, Inspection, Side, check, load_gear
    from mlg_troubleshoot.reporting.figures import Lengths
    from mlg_troubleshoot.reporting.inspection_figures import joint_key, schematic

    gear = load_gear()
    failure = {3: 0.013, 5: 0.007}
    found = check(
        Inspection("PAPER-4.4", "not-stated", Side.LH, ClearanceConvention.RADIAL, failure), gear
    )
    drawn = schematic(gear, found, width=610.0)
    return {
        "linkage.svg": standing_alone(
            [
                *(str(panel) for _plane, panel, _width in drawn.panels),
                str(joint_key(gear, failure, Lengths())),
            ],
            f"{gear.name}, linkage {gear.reference.name} at mid-position: {gear.provenance}."
            f" Arrows: worst-case clearances of the published failure, {drawn.exaggeration} times"
            " larger than life.",
        )
    }


def standing_alone(panels: list[str], caption: str) -> str:
    """Set drawings side by side in a file of their own, with a caption below."""
    sizes = [
        tuple(map(float, re.search(r'width="([\d.]+)" height="([\d.]+)"', p).groups()))
        for p in panels
    ]  # type: ignore[union-attr]
    gap, margin, below = 6.0, 12.0, 26.0
    width = sum(w for w, _ in sizes) + gap * (len(sizes) - 1) + 2 * margin
    height = max(h for _, h in sizes) + 2 * margin + below
    parts, x = [], margin
    for panel, (w, _) in zip(panels, sizes, strict=True):
        parts.append(panel.replace("<svg ", f'<svg x="{x:g}" y="{margin:g}" ', 1))
        x += w + gap
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}"'
        f' width="{width:g}" height="{height:g}" font-family="{_FONTS}" role="img"><rect'
        f' width="100%" height="100%" fill="#ffffff"/>{"".join(parts)}<text x="{margin:g}"'
        f' y="{height - margin:g}" font-size="9.5" fill="#3c4650">{caption}</text></svg>\n'
    )


def main() -> None:
    """Bring the pages that are named, or all of them, and the pictures up to date."""
    import tempfile

    PICTURES.mkdir(parents=True, exist_ok=True)
    for name, drawing in pictures().items():
        (PICTURES / name).write_text(drawing, encoding="utf-8")
    wanted = [Path(name).resolve() for name in sys.argv[1:]] or PAGES
    for page in wanted:
        with tempfile.TemporaryDirectory() as folder:
            page.write_text(
                refreshed(page.read_text(encoding="utf-8"), Path(folder)), encoding="utf-8"
            )


if __name__ == "__main__":
    main()
