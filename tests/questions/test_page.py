"""The page of questions holds every case, and what answers it."""

from tests.questions.conftest import answered
from tests.questions.page import CHAPTERS, PAGE, cases, cell


def test_every_case_is_on_the_page_with_its_answer():
    text = PAGE.read_text(encoding="utf-8")
    rows = {line.split(" | ")[0]: line for line in text.splitlines() if line.startswith("| ")}
    number = 0
    for module in CHAPTERS.values():
        for case in cases(module):
            found = [
                line
                for start, line in rows.items()
                if start[2:].split(" (`")[0] == cell(case.question)
            ]
            assert len(found) == 1, f"{case.question}: run python -m tests.questions.page"
            assert answered(found, tuple(map(cell, case.answer))), found[0]
            number += 1
    assert number >= 200 and f"to {number} mistakes" in text
    assert len(rows) == number + 1  # and the heading of the tables


def test_questions_are_different_ones():
    asked = [case.question for module in CHAPTERS.values() for case in cases(module)]
    assert len(set(asked)) == len(asked)
