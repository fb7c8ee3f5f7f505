"""Names and sentences: words that a control engineer knows, and sentences that are read once."""

import ast
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from statistics import median, quantiles

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "pipeline" / "davinci_forces"

# Names that say nothing of the quantity; the list may only grow.
FILLERS = {
    "own", "said", "found", "made", "kept", "told", "every", "left", "one", "rest", "other", "each", "such", "given",
    "seen", "asked", "known",
}  # fmt: skip
MOST_FILLERS = 8  # in 1000 names of a function's parameters and variables
PREPOSITIONS_AND_PRONOUNS = {
    "about", "above", "after", "ahead", "all", "along", "alone", "any", "apart", "around", "at", "away", "before",
    "behind", "below", "beside", "between", "beyond", "both", "by", "down", "each", "every", "few", "fewer", "for",
    "from", "here", "in", "inside", "into", "it", "less", "many", "more", "most", "near", "of", "off", "on", "one",
    "out", "outside", "over", "same", "some", "such", "that", "then", "there", "these", "this", "those", "through",
    "to", "together", "under", "up", "upon", "with", "within", "without",
}  # fmt: skip
IRREGULAR_PARTICIPLES = {
    "begun", "bent", "bound", "broken", "brought", "built", "caught", "chosen", "cut", "done", "drawn", "driven",
    "fallen", "felt", "found", "given", "gone", "held", "hung", "kept", "known", "laid", "led", "left", "lost", "made",
    "meant", "met", "paid", "said", "seen", "sent", "shown", "split", "spread", "stood", "taken", "thought", "told",
    "torn", "understood", "won", "worn", "written", "hidden", "risen", "swept",
}  # fmt: skip
NOUNS_LIKE_PARTICIPLES = {
    "bed", "embed", "exceed", "feed", "need", "proceed", "seed", "speed", "spread",
    "damping", "heading", "reading", "setting", "spacing", "string", "timing", "padding", "wording", "warning",
    "bearing", "coupling", "gearing", "scaling", "loading", "tuning", "ring", "spring", "sampling", "intake",
    "thinning",
}  # fmt: skip
EXCEPTIONS = {
    "published": "the contract of records names it",
}
# Words of a private language, which the vocabulary of pipeline/README.md replaces; the list may only grow.
COINAGES = {
    "anew", "calm", "crew", "deaf", "driven", "driving", "feels", "gone", "hang", "hangs", "hung", "judge", "judged",
    "judges", "kin", "loudest", "poke", "settle", "settled", "tells", "told", "void",
}  # fmt: skip
VAGUE_CONSTANTS = {"FEWEST", "MOST", "LEAST", "LONGEST", "WHOLE", "NEAR", "USUAL", "SHOWN", "TOGETHER"}
LONGEST_DOCSTRING_SENTENCE = 30  # words
MEDIAN_SENTENCE, LONG_SENTENCE = 18, 32  # words, and those of the 90th percentile, of README and of a report


def is_participle(word: str) -> bool:
    """Whether a name is a participle alone."""
    if word in NOUNS_LIKE_PARTICIPLES:
        return False
    return word in IRREGULAR_PARTICIPLES or re.fullmatch(r"[a-z]{2,}(ed|ing)", word) is not None


@cache
def trees() -> dict[Path, ast.Module]:
    return {f: ast.parse(f.read_text(encoding="utf-8")) for f in sorted(PACKAGE.rglob("*.py"))}


def functions(tree: ast.AST) -> Iterator[ast.FunctionDef]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))


def names_of(function: ast.FunctionDef) -> set[str]:
    """Parameters and variables of a function, without those of functions in it."""
    a = function.args
    names = {x.arg for x in (*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg) if x}

    def visit(node: ast.AST) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Name) and isinstance(child.ctx, ast.Store):
                names.add(child.id)
            elif isinstance(child, ast.Lambda):
                names.update(x.arg for x in child.args.args)
            if not isinstance(child, ast.FunctionDef | ast.ClassDef):
                visit(child)

    visit(function)
    return names - {"self", "cls", "_"}


def fillers() -> tuple[Counter[str], Counter[str], int]:
    """How often each filler names something, where, and how many names there are."""
    words, places, total = Counter[str](), Counter[str](), 0
    for file, tree in trees().items():
        for function in functions(tree):
            names = names_of(function)
            total += len(names)
            words.update(names & FILLERS)
            places[file.relative_to(PACKAGE).as_posix()] += len(names & FILLERS)
    return words, +places, total


def test_names_of_variables_say_the_quantity():
    words, places, total = fillers()
    assert 1000 * words.total() / total <= MOST_FILLERS, (words.most_common(), places.most_common(20))


def public_functions() -> Iterator[tuple[Path, str]]:
    for file, tree in trees().items():
        yield from ((file, f.name) for f in functions(tree) if not f.name.startswith("_"))


def test_functions_are_verbs_or_noun_phrases():
    names = {name for _, name in public_functions()} - EXCEPTIONS.keys()
    assert {name for name in names if is_participle(name) or name in PREPOSITIONS_AND_PRONOUNS} == set()


def test_every_exception_is_used():
    assert EXCEPTIONS.keys() <= {name for _, name in public_functions()}


def constants() -> Iterator[tuple[str, str, str, str]]:
    """Room, file, name and value of every constant."""
    for file, tree in trees().items():
        place = file.relative_to(PACKAGE)
        for node in tree.body:
            for target in node.targets if isinstance(node, ast.Assign) else ():
                for name in target.elts if isinstance(target, ast.Tuple) else [target]:
                    if isinstance(name, ast.Name) and re.fullmatch(r"[A-Z][A-Z0-9_]*", name.id):
                        yield place.parts[0], place.as_posix(), name.id, ast.unparse(node.value)


AGREED = {"NAME", "ROBOT"}  # what modules of an extension folder export


def test_a_constant_has_one_value_in_a_room_and_says_of_what():
    values, vague = defaultdict(set), set()
    for room, file, name, value in constants():
        values[room, name].add((value, file))
        vague |= {(room, name)} if name in VAGUE_CONSTANTS else set()
    assert vague == set()
    assert {key for key, places in values.items() if key[1] not in AGREED and len(places) > 1} == set()


def words_of_names() -> dict[str, set[str]]:
    """The words that names of modules, functions, classes, parameters and variables consist of, with those names."""
    words = defaultdict(set)
    for file, tree in trees().items():
        for word in file.stem.split("_"):
            words[word].add(file.stem)
        for node in ast.walk(tree):
            match node:
                case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.arg(arg=name) | ast.Name(id=name):
                    for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name):
                        words[word.lower()].add(name)
    return words


def test_names_use_the_vocabulary_and_no_private_words():
    words = words_of_names()
    assert {word: words[word] for word in COINAGES & words.keys()} == {}
    contributing = (PACKAGE.parent / "README.md").read_text(encoding="utf-8")
    table = contributing.split("## Vocabulary")[1].split("\n## ")[0]
    rows = [line.split("|")[1] for line in table.splitlines() if line.startswith("| ")][1:]
    terms = [term.split() for row in rows for term in re.sub(r"`[^`]*`", "", row).split(",")]
    assert len(terms) >= 15
    assert [term for term in terms if not words.keys() >= {word.lower() for word in term}] == []


def sentences(text: str) -> Iterator[str]:
    """Sentences of a text, with code and formulas as one word; samples of files and aligned lists are none."""
    text = re.sub(r"``?[^`]+``?|\$[^$]+\$", "x", text)
    depth, paragraphs = 0, [""]
    for line in text.splitlines():
        indent = len(line) - len(line.lstrip())
        if not line.strip() or indent != depth or re.match(r"\s*([-*|]|\d+\.) |-+$", line):
            paragraphs.append("")
        depth = indent
        paragraphs[-1] += f" {line}"
    for paragraph in paragraphs:
        if not re.search(r"\S {3,}\S|^ {5,}\S+ = |^ {5,}\[", paragraph):
            yield from (s for s in re.split(r"(?<=[.!?])\s+", " ".join(paragraph.split())) if words_in(s) > 1)


def words_in(sentence: str) -> int:
    return len(re.findall(r"\S*[A-Za-z0-9]\S*", sentence))


def docstrings() -> Iterator[tuple[str, str]]:
    for file, tree in trees().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and (text := ast.get_docstring(node)):
                yield f"{file.relative_to(PACKAGE).as_posix()}:{getattr(node, 'name', '')}", text


def test_no_docstring_is_broken_like_a_text_in_code():
    assert [place for place, text in docstrings() if re.search(r'"\n\s*"', text)] == []


def test_no_sentence_of_a_docstring_is_long():
    lengths = [(words_in(s), place, s) for place, text in docstrings() for s in sentences(text)]
    long = sorted((row for row in lengths if row[0] > LONGEST_DOCSTRING_SENTENCE), reverse=True)
    assert not long, long[:10]


def median_and_90th_percentile(text: str) -> tuple[float, float]:
    lengths = [words_in(s) for s in sentences(text)]
    return median(lengths), quantiles(lengths, n=10)[-1]


GUIDE = PACKAGE / "guide"
PROSE = [ROOT / "README.md", *sorted(p for p in GUIDE.rglob("*.md") if p.parent.name not in ("reference", "changes"))]


@pytest.mark.parametrize("page", PROSE, ids=lambda page: page.stem)
def test_sentences_of_readme_and_guide_are_short(page):
    text = re.sub(r"```.*?```|<[^>]*>", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    prose = "\n".join(line for line in text.splitlines() if not line.startswith(("|", "#", "    ")))
    if len(list(sentences(prose))) < 5:
        return
    middle, long = median_and_90th_percentile(prose)
    assert middle <= MEDIAN_SENTENCE
    assert long <= LONG_SENTENCE
