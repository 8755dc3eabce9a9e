"""The picture of the rooms in CONTRIBUTING.md, from the imports.

``python -m tests.rooms_picture`` draws it into the page.
"""

from __future__ import annotations

import ast
import re

from tests.conftest import REPOSITORY
from tests.rooms import MODULES, ROOMS, graph, room

PAGE = REPOSITORY / "CONTRIBUTING.md"

#: The way from a log to a verdict: each module, and how deep it stands below those that call it.
WAY = (
    (0, "app.cli.workflow"),
    (1, "experiment.experiment"),
    (2, "experiment.recording_tables"),
    (3, "data.recording.load"),
    (4, "data.logs.read_log"),
    (1, "estimation.identify"),
    (2, "estimation.methods"),
    (3, "estimation.prefiltered_iv"),
    (4, "loop.instruments.given_motion"),
    (4, "estimation.noise_identification"),
    (5, "signals.prefilter"),
    (4, "estimation.iteration"),
    (5, "dynamics.robot_regressor"),
    (5, "estimation.normal_equations"),
    (1, "judgement.diagnostics.diagnostics"),
    (2, "judgement.audit.recording_audit"),
    (2, "judgement.validation.instrument_tests"),
    (2, "judgement.validation.held_out.out_of_sample"),
    (2, "judgement.model_errors.named_causes"),
    (2, "judgement.diagnostics.trials"),
    (1, "judgement.diagnostics.verdict"),
    (2, "judgement.diagnostics.uses"),
    (1, "judgement.report.builder"),
)

#: The block of the page that is drawn here.
_BLOCK = re.compile(r"(?<=<!-- rooms -->\n```text\n).*?(?=```\n)", re.DOTALL)


def picture() -> str:
    """Which room imports which, and below it the way from a log to a verdict."""
    return "\n".join((*_rooms(), "", *_way())) + "\n"


def page(text: str) -> str:
    """The page with the picture of today."""
    return _BLOCK.sub(lambda _: picture(), text, count=1)


def _rooms() -> list[str]:
    """A row for each room, a dot below each room that it imports."""
    imports = {(room(a), room(b)) for a, others in graph().items() for b in others}
    wide = max(map(len, ROOMS))
    lines = [f"{'':{wide}} {' '.join(name[0] for name in ROOMS)}"]
    for number, name in enumerate(ROOMS):
        dots = " ".join("●" if (name, other) in imports else "·" for other in [*ROOMS][:number])
        about = first_line(f"pivident.{name}")
        lines.append(f"{name:{wide}} {dots:{2 * len(ROOMS) - 1}} {about}")
    return lines


def _way() -> list[str]:
    """Each module of the way with what it does; what stands deeper is imported by what is above."""
    stations = [("  " * depth + module, f"pivident.{module}") for depth, module in WAY]
    wide = max(len(shown) for shown, _ in stations)
    return [f"{shown:{wide}}  {first_line(module)}" for shown, module in stations]


def missing_steps() -> list[tuple[str, str]]:
    """Steps of the way at which the upper module does not import the lower one."""
    above: dict[int, str] = {}
    missing = []
    for depth, module in WAY:
        name = above[depth] = f"pivident.{module}"
        if depth and name not in graph()[above[depth - 1]]:
            missing.append((above[depth - 1], name))
    return missing


def first_line(name: str) -> str:
    """First line of a module's docstring."""
    words = ast.get_docstring(ast.parse(MODULES[name].read_text("utf-8"))) or ""
    return words.splitlines()[0]


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text("utf-8")), encoding="utf-8")
