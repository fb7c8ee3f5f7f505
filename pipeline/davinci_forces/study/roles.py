"""Guess the roles of logs: by words in the names of files and folders, else by their motions and efforts."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple
from unicodedata import normalize

from davinci_forces.maths.contact.unexplained import MIN_UNEXPLAINED, Course, has_outliers, unexplained_share
from davinci_forces.study import names
from davinci_forces.study.holding import Holding

ROLE_WORDS = {kind: re.compile(rf"\b({'|'.join(words)})\b") for kind, words in names.WORDS["role"].items()}
ASCII = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "æ": "ae", "Ä": "AE", "Ö": "OE", "Ü": "UE"})
MASS = re.compile(r"(\d+(?:[.p]\d+)?) ?(k?g)\b")
GUESSED = "CHECK: guessed from its values"
WIDER = 1.2  # times the range of the logs before: a motion that reaches farther identifies, too


@dataclass(frozen=True)
class Evidence:
    """What is known of a log: its name, its folders and file as one text, its guessed content."""

    name: str
    path: str
    holding: Holding
    touches_tissue: bool = False  # it has a depth and a force
    slides: bool = False  # a prismatic joint moves


class Role(NamedTuple):
    """A role, "" if it is not known, the reason for it, and what a weight log has: its mass [kg], and its tare."""

    role: str
    reason: str
    mass: float = 0.0  # as its name states
    tare: int | None = None  # which of the logs


def roles_of(recordings: Sequence[Evidence]) -> list[Role]:
    """Guess the role of each log: by a word of its file or folders, else by its motion and effort among others."""
    words = [_word(recording.path) for recording in recordings]
    why = ", as no word of its name is known"
    if len(words) > 1 and all(word[0] == "test" for word in words):
        words, why = [("", "")] * len(words), ""  # a word that all share tells none from the others
    roles = [_by_word(recording, *word) for recording, word in zip(recordings, words, strict=True)]
    open_ones = [i for i, role in enumerate(roles) if role is None]
    touched = {i: reason for i in open_ones if (reason := _touched(recordings[i].holding))}
    rest = [i for i in open_ones if i not in touched]
    fixed = [i for i, role in enumerate(roles) if role is not None and role.role == "identification"]
    chosen = _by_motion(recordings, rest, fixed, [role is not None and role.role == "validation" for role in roles])
    reference = [recordings[i].holding for i in [*fixed, *(i for i in rest if chosen[i].role == "identification")]]
    others = [i for i in rest if chosen[i].role != "identification"]
    touched |= {i: reason for i in others if (reason := _unlike(recordings[i].holding, reference))}
    moving = {i: {*recordings[i].holding.moving} for i, role in enumerate(roles) if role is not None or i in rest}
    for i in rest:  # what values say is a guess where another log of the joint may have that role
        has_others = any(moving[i] & joints for k, joints in moving.items() if k != i)
        if has_others and '"' not in chosen[i].reason:
            chosen[i] = chosen[i]._replace(reason=f"{GUESSED}{why}: {chosen[i].reason}")
    named = [role or (Role("contact", touched[i]) if i in touched else chosen[i]) for i, role in enumerate(roles)]
    return _with_tares(recordings, _with_identification(recordings, named))


def _word(path: str) -> tuple[str, str]:
    """The kind of the first word that tells a role, and the word: of the file first, then of its folders upwards."""
    for name in reversed(path.split("/")):
        part = normalize("NFKD", normalize("NFC", name).translate(ASCII)).encode("ascii", "ignore").decode()
        text = " ".join(re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+(?:[.p]\d+)?", part)).lower()
        if kinds := [(kind, match[0]) for kind, words in ROLE_WORDS.items() if (match := words.search(text))]:
            if kinds[0][0] in ("weight", "empty") and (mass := MASS.search(text)) and float(mass[1].replace("p", ".")):
                return "weight", mass[0]  # `weight150g`: the mass says more than the word
            clash = {kind for kind, _ in kinds} & {"identification", "contact", "tissue", "weight"}
            if kinds[0][0] not in ("free", "empty") and "identification" in clash and len(clash) > 1:
                return "clash", " and ".join(word for _, word in kinds)
            return kinds[0]
    return "", ""


def _by_word(recording: Evidence, kind: str, word: str) -> Role | None:
    """The role that a word tells; None where the motion has to tell it."""
    reason = f'"{word}" in its name'
    if kind == "clash":
        return Role("", f"{reason} mean different roles")
    if recording.touches_tissue and (kind in ("", "tissue", "contact", "test") or not recording.holding.meanings):
        return Role("tissue", "it has a depth and a force")
    match kind:
        case "free" | "empty":
            return Role("validation", f"{reason}: free motion for validation")
        case "test":
            touched = _touched(recording.holding).removeprefix("CHECK: ")
            return Role("validation", f"CHECK: {reason}, but {touched}" if touched else reason)
        case "weight":
            mass = MASS.search(word)
            kilograms = float(mass[1].replace("p", ".")) * (1.0 if mass[2] == "kg" else 1e-3) if mass else 0.0
            return Role("weight", reason, kilograms)
        case "tissue" if not recording.slides:
            return Role("contact", f"{reason}, but it has no depth, and no joint of it slides")
        case "" | "excitation":
            return None
    return Role(kind, reason)


def _touched(holding: Holding) -> str:
    """Why a log is of contact, by itself: it stands still, or its effort has outliers."""
    if holding.ranges and not holding.moving:
        return "no joint moves in it, so nothing can be identified from it"
    pushed = [str(joint + 1) for joint, course in holding.courses.items() if has_outliers(course)]
    why = f"{_check(holding)}the effort of joint {', '.join(pushed)} has outliers, as pushes make them"
    return why if pushed else ""


def _check(holding: Holding) -> str:
    """Mark an effort that the motion of other joints may explain, which a model of one joint does not know."""
    return "CHECK: a contact, or coupled joints: " if len(holding.courses) > 1 else ""


def _unlike(holding: Holding, references: Sequence[Holding]) -> str:
    """Why a log is of contact, beside those that identify the same joints: their model does not explain its effort."""
    for joint, course in holding.courses.items():
        same: list[Course] = [other.courses[joint] for other in references if joint in other.courses]
        share = unexplained_share(course, same) if same else 0.0
        if share >= MIN_UNEXPLAINED:
            return f"{_check(holding)}{share:.0%} of the effort of joint {joint + 1} is not as in free motion"
    return ""


def _by_motion(
    recordings: Sequence[Evidence], rest: Sequence[int], fixed: Sequence[int], tested: Sequence[bool]
) -> dict[int, Role]:
    """Identify from the motions that repeat and reach farthest, then from any that add joints; test on the others."""
    reach: dict[int, tuple[float, str]] = {}
    roles: dict[int, Role] = {}
    for i in fixed:
        _cover(reach, recordings[i])
    holdings = [recording.holding for recording in recordings]
    words = {i: _word(recordings[i].path) for i in rest}
    excited = {i: kind == "excitation" for i, (kind, _) in words.items()}
    identifying = {i: bool(holdings[i].repeating) or excited[i] for i in rest}
    varied = {joint for i in [*rest, *fixed] if not holdings[i].steady for joint in holdings[i].moving}
    late: list[int] = []
    moved = {joint for i in rest if holdings[i].repeating for joint in holdings[i].moving}
    others = (holdings[i] for i in rest if not identifying[i])
    is_tested = any(tested) or any(moved <= set(other.moving) and not other.steady for other in others)

    def order(i: int) -> tuple[float, ...]:
        """Repeating motions first, then more joints; of those that reach about as far, the longest in whole periods."""
        holding, span = holdings[i], _reach(holdings[i])
        alike = [_reach(holdings[k]) for k in rest if holdings[k].repeating and holdings[k].moving == holding.moving]
        time = round(holding.repeating, 1) if WIDER * span >= max(alike, default=0.0) else 0.0
        return not holding.repeating, not excited[i], -len(holding.moving), -time, -span

    for i in sorted(rest, key=order):
        holding, spans = holdings[i], _spans(holdings[i])
        within = next((reach[joint][1] for joint in spans if joint in reach), "")
        if holding.steady and not excited[i] and varied & set(holding.moving):
            roles[i] = Role("friction", "its joint moves at one constant velocity after another")
        elif not identifying[i] and set(spans) - set(reach):
            late.append(i)
        elif identifying[i] and (is_tested or any(x > WIDER * reach.get(k, (0.0, ""))[0] for k, x in spans.items())):
            roles[i] = Role("identification", f'"{words[i][1]}" in its name' if excited[i] else "its motion repeats")
            _cover(reach, recordings[i])
        elif holding.repeating:
            is_within = all(x <= reach[joint][0] for joint, x in spans.items() if joint in reach)
            how = "its motion stays within that" if is_within else "its motion reaches hardly farther than that"
            roles[i] = Role("validation", f"{how} of {within}, which identifies")
        else:
            but = f", but that of {within} does" if within else ""
            why = f"its motion does not repeat{but}" if holding.ranges else "CHECK: no position in it is known"
            roles[i] = Role("validation", why)
    return roles | _not_repeating(recordings, late, reach, any(tested))


def _not_repeating(
    recordings: Sequence[Evidence], late: Sequence[int], reach: dict[int, tuple[float, str]], is_tested: bool
) -> dict[int, Role]:
    """Identify from motions that do not repeat where none does; the shortest whose joints others move is the test."""
    why = "it moves joints that no log with a repeating motion moves" if reach else "no log has a motion that repeats"
    roles = {i: Role("identification", why) for i in late}
    moved = {i: set(recordings[i].holding.moving) for i in late}
    spare = [i for i in late if moved[i] and moved[i] <= {*reach, *chain(*(moved[k] for k in late if k != i))}]
    if spare and not is_tested:
        samples = {i: max((len(c.q) for c in recordings[i].holding.courses.values()), default=0) for i in spare}
        last = min(spare, key=lambda i: (samples[i], -i))
        roles[last] = Role("validation", "the shortest motion of joints that other logs move: it tests the fit")
    return roles


def _spans(holding: Holding) -> dict[int, float]:
    """The range of each joint that moves."""
    spans = {joint: float(c.q.max() - c.q.min()) for joint, c in holding.courses.items()}
    return spans or dict.fromkeys(holding.moving, 1.0)


def _reach(holding: Holding) -> float:
    return sum(_spans(holding).values())


def _cover(reach: dict[int, tuple[float, str]], recording: Evidence) -> None:
    for joint, span in _spans(recording.holding).items():
        reach[joint] = max(reach.get(joint, (0.0, "")), (span, recording.name))


def _with_identification(recordings: Sequence[Evidence], roles: list[Role]) -> list[Role]:
    """Where no log identifies, take those called free if another one tests, else what reaches farthest."""
    free = [i for i, role in enumerate(roles) if role.role == "validation" and recordings[i].holding.moving]
    if free and not any(role.role == "identification" for role in roles):
        called = [i for i in free if _word(recordings[i].path)[0] == "free"]
        best = max(free, key=lambda i: (len(recordings[i].holding.moving), _reach(recordings[i].holding)))
        for i in called if 0 < len(called) < len(free) else [best]:
            reason = roles[i].reason.removeprefix("CHECK: ").partition(":")[0]
            roles[i] = Role("identification", f"CHECK: {reason}; but there is no other log to identify from")
    return roles


def _with_tares(recordings: Sequence[Evidence], roles: list[Role]) -> list[Role]:
    """Give each weight log the free motion of the same joints that is named as without the mass, nearest in range."""
    reach = [_spans(recording.holding) for recording in recordings]
    moving = [i for i, role in enumerate(roles) if role.role == "validation" and recordings[i].holding.moving]
    empty = [i for i in moving if _word(recordings[i].path)[0] == "empty"]
    for k, role in enumerate(roles):
        same = [i for i in empty if reach[i].keys() == reach[k].keys()]
        if role.role == "weight" and same:
            tare = min(same, key=lambda i: sum(abs(x - reach[k][j]) for j, x in reach[i].items()))
            roles[k] = role._replace(tare=tare)
    return roles
