"""Ratings of figures and runs by reviewers, and whether the numbers have changed since."""

from collections.abc import Iterator
from hashlib import sha256

from davinci_forces.report.content import Block, Prose, Table, Verdict, literal
from davinci_forces.report.context import Context, count
from davinci_forces.report.sections.parts import RATINGS, explanation, paper_or_screen, section_of
from davinci_forces.study.review import STUDY, Rating


@section_of("Ratings", "review")
def section(context: Context) -> Iterator[Block]:
    """Whether the ratings in review.toml are still valid, and a table of them."""
    if not context.ratings:
        return
    now = sha256(context.results.json()).hexdigest()
    old = [rating for rating in context.ratings if rating.results != now]
    yield Prose(explanation("review"))
    changed = explanation("review-changed", ratings=count(len(old), "rating"), total=len(context.ratings))
    same = "All ratings are of the numbers that this report shows."
    yield Verdict("warn", changed) if old else Verdict("info", same)
    rows = []
    for rating in context.ratings:
        words = (literal(text) or "–" for text in (rating.comment, rating.reviewer, rating.date))
        state = "as rated" if rating.results == now else "changed since"
        rows.append((subject(context, rating), RATINGS[rating.verdict], *words, state))
    header = ("Of", "Rating", "Comment", "Reviewer", "Date", "Numbers")
    yield from paper_or_screen(Table("Ratings, in the order of review.toml.", header, tuple(rows), "ratings", "llllll"))


def subject(context: Context, rating: Rating) -> str:
    """The rated subject: a figure of this report by its number, anything else by its name."""
    if rating.subject == STUDY:
        return "the study"
    if rating.subject == "figure" and rating.name in context.labels:
        return f"[@{rating.name}]"
    here = rating.subject == "run" and rating.name in [log.name for log in context.study.logs]
    return f"{rating.subject} {literal(rating.name)}{'' if here else ', not in this report'}"
