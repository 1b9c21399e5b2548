"""What users and maintainers read is plain English: none of the phrases that once stood here comes
back.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
# The reason of each is the phrase to write instead.
INSTEAD = {
    r"(?<![Tt]here )\b(?:is|are|was|were) (?:no|none)\b(?! longer| more\b)": "is not a …",
    r"\bthan (?:is|are) none\b": "is not a …",
    r"\b(?:[Oo]ne|a|each) (?:line|row|column|page) an? [a-z]": "one line per …",
    r"\b(?:nothing|what) (?:is|was) kept of\b": "no records of …",
    r"\bt(?:ell|ells|elling|old) (?:[\w#{}]+ ){0,5}apart\b": "distinguish",
    r"\btold from\b": "distinguished from",
    r"\btell (?:it|them|one|that) from\b": "distinguish … from",
    r"\b(?:asked for|typed|rows|readings) at the line\b": "at the prompt",
    r", too(?=[.;:)\"]|$)": "also …",
    r"\b[Mm]end(?:s|ed|ing)?\b": "correct",
    r"\bslips? of the pen\b": "entry error",
    r"\b(?:four|4) times in (?:five|5)\b": "with 80 % power",
    r"\b[Cc]hance (?:of as much )?if nothing is wrong\b": "p-value",
    r"\b(?:sets|drawn) with nothing wrong\b": "null simulations",
    r"\bnot used for (?:the|a) fit\b": "held-out rows",
    r"\b[Ww]hat is left\b": "residual, remaining …",
    r"\b[Gg]auge uncertainty (?:not stated|if known|of)\b": "standard uncertainty of the gauge",
    r"\b[Ff]actors of all joints\b": "all-joint effect",
    r"\b[Oo]ne by one\b": "stepwise",
    r"\bare turned\b": "direction of …",
    r"\bby keeping\b": "Run mlg check --keep once to upgrade it.",
    r"\bat most; .{0,40}\bcannot\b": "… has another cause",
    r"\bthat none is\b": "Probably no joint …",
    r"\brestored, and not recorded\b": "Restored without a record?",
    r"\bthat should hold do\b": "all required values hold",
    r"\b[Bb]eside (?:it|them|one|those|others|the others|what is named|the named)\b": (
        "in addition to …"
    ),
    r"\b[Ee]valuations to stop at\b": "Maximum number of evaluations",
    r"\bfor the hand\b": "to fill in by hand",
    r"\bNothing follows from\b": "… contains no usable reading",
    r"\bof what was done\b": "partial results",
    r"\bproves no\b": "does not prove …",
    r"\botherwise than entered\b": "Corrected for this analysis",
    r"\bno chance and none\b": "significant but matches no listed cause",
    r"\bthat the data cannot tell\b": "that these data cannot identify",
    r"\bno gauge that moves\b": "a working gauge would vary",
    r"\bno cause on any list\b": "no known cause",
    r"\b[Ww]orth most\b": "Most useful next reading",
    r"\bcomes out right\b": "a correct prediction of it proves nothing",
    r"\b(?:is|was|were) (?:said|read|counted|used) so\b": "that is the reading, as entered …",
    r"\b(?:tells|tell|says) (?:the )?most\b": "the most informative …",
    r"\bin a word\b": "in short",
    r"\bwith a chance of\b": "the chance that … is …",
    r"\bsure to hold\b": "certain",
    r"\b[Ss]eed of everything\b": "Seed of all random draws",
    r"\bof a paper design, \d": "…; 100 if not given",
    r"\bturn (?:a|the) verdict\b": "change a verdict",
    r"\b[Aa]ppend that\b|\bthe right one counts\b": "Void …, Append a corrected …",
    r"\b(?:nothing|not) is (?:not )?taken out\b": "no effect is removed",
    r"\b[Nn]obody read [#{]": "Not read: …",
    r"\bas supposed\b": "assumed",
    r"\bgives none\b": "too little to estimate it",
    r"\bnothing can be cleared\b": "no gear can be cleared",
    r"\bgone on with\b": "continued",
    r"\ba chance of its own\b": "a separate probability",
    r"\b[Aa]ssumed beforehand\b": "Prior",
    r"\b(?:one|line|direction|interval) for each (?:joint|row|gear)\b": "one per joint",
    r"\bfall apart\b": "can be distinguished",
    r"\bleaves? nothing\b": "nothing remains",
    r"\bthe one right inspection\b": "the corrected …",
    r"\bwhat becomes of\b": "the outcome of",
    r"\b[Gg]o(?:es)? on with (?!fault)": "resume …, continue …",
    r"\bnobody from\b": "does not prevent …",
    r"\bspeaks? of\b": "describes, names",
    r"\bbeside its stated\b": "in addition to …",
    r"\b(?:who|gear|that) is told\b": "receives, reads",
    r"\blast change is taken back\b": "undone",
    r"\bone of its own\b": "a new …",
    r"\bkept before is untouched\b": "existing records are unchanged",
    r"\bThen, as expected\b": "Expected after that: …",
    r"\b[Aa]nything else as well\b": "a further effect",
    r"\bis not taken: ": "is not accepted: …",
    r"\benters nothing\b": "is not an answer",
    r"\bsays no day\b": "is not a date",
    r"\bsplits them\b": "distinguishes them",
    r"\bstands? in row\b": "is in row …",
}


def strings(source: str) -> Iterator[tuple[int, str]]:
    """Every text of a module, docstrings too; what an f-string fills in stands as {}."""
    tree = ast.parse(source)
    parts = {
        id(part)
        for node in ast.walk(tree)
        if isinstance(node, ast.JoinedStr)
        for part in node.values
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield (
                node.lineno,
                "".join(
                    str(part.value) if isinstance(part, ast.Constant) else "{}"
                    for part in node.values
                ),
            )
        elif (
            isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in parts
        ):
            yield node.lineno, node.value


def texts() -> tuple[tuple[str, str], ...]:
    found = []
    for path in sorted((ROOT / "mlg_troubleshoot").rglob("*.py")):
        place = path.relative_to(ROOT).as_posix()
        found += [
            (f"{place}:{line}", text) for line, text in strings(path.read_text(encoding="utf-8"))
        ]
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "templates").glob("*.j2")]
    pages += [
        *(ROOT / "mlg_troubleshoot").rglob("*.toml"),
        *(ROOT / "mlg_troubleshoot").rglob("*.schema.json"),
    ]
    for path in sorted(pages):
        # Of Jinja's tests, "is none" is a word of the language, not of the reader.
        text = (
            re.sub(r"\bis (not )?none\b", "", path.read_text(encoding="utf-8"))
            if path.suffix == ".j2"
            else None
        )
        text = path.read_text(encoding="utf-8") if text is None else text
        found += [
            (path.relative_to(ROOT).as_posix(), paragraph) for paragraph in text.split("\n\n")
        ]
    return tuple((place, " ".join(text.split())) for place, text in found)


def test_no_text_holds_a_phrase_that_has_a_plainer_one() -> None:
    places, lines = zip(*texts(), strict=True)
    whole = "\n".join(lines)
    hits = [
        f"{places[whole.count(chr(10), 0, hit.start())]}: …"
        f"{whole[max(0, hit.start() - 60) : hit.end() + 60]}…: write {plainer!r}"
        for phrase, plainer in INSTEAD.items()
        for hit in re.finditer(phrase, whole, re.MULTILINE)
    ]
    assert not hits, "\n".join(hits)
