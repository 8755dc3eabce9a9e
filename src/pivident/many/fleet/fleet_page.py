"""The judgement of a fleet as one self-contained HTML page in the style of the report."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

from markupsafe import Markup

from pivident.many.fleet.control_chart import Alarm
from pivident.many.fleet.fleet_figures import chart_figure, overview_figure
from pivident.many.fleet.judgement import Judgement, promise
from pivident.many.fleet.wear import Rate
from pivident.report.builder import page_environment, page_of
from pivident.text.lists import plural
from pivident.text.numbers import with_spread
from pivident.text.toml import toml_lines

#: Maximum number of charts, those with alarms first; more would make the page slow.
MAX_CHARTS = 40

#: Number of charts if there are fewer alarms.
MIN_CHARTS = 8

#: Maximum number of robots in the headline.
MAX_NAMED = 6

#: Maximum number of listed failed logs and rates of wear.
MAX_LISTED = 100

HEADINGS = {
    "alarms": "Alarms",
    "overview": "All robots",
    "charts": "Control charts",
    "wear": "Wear and temperature",
    "logs": "Logs without an estimate",
    "provenance": "Provenance",
}


def render_page(judgement: Judgement) -> str:
    """The page as text."""
    fleet = judgement.fleet
    environment = page_environment("pivident.many.fleet")
    environment.globals |= {
        "rate": _rate,
        "digits": _digits,
        "percent_of": _percent,
        "alarm_numbers": _alarm_numbers,
        "counted": plural,
    }
    overview = overview_figure(judgement)
    content: dict[str, Any] = {
        "judgement": judgement,
        "fleet": fleet,
        "promise": promise(judgement),
        "headline": _headline(judgement),
        "overview": [] if overview is None else [overview],
        "charts": [chart_figure(c, 0) for c in _drawn(judgement)],
        "rates": _clearest_rates(judgement),
        "failures": list(fleet.failures.head(MAX_LISTED).iter_rows(named=True)),
        "programs": fleet.store.programs(),
        "identity": toml_lines(fleet.template.identity),
    }
    sections = []
    for key, heading in HEADINGS.items():
        if key == "logs" and not content["failures"]:
            continue
        body = environment.get_template(f"fleet_{key}.html").render(content)
        sections.append((key, heading, Markup(body)))
    counts = f"{plural(len(fleet.robots), 'robot')}, {plural(len(fleet.logs), 'log')}"
    return page_of(environment, f"{fleet.template.experiment.title}: {counts}", sections)


def _drawn(judgement: Judgement) -> list[Any]:
    """Charts with alarms, then those with the largest drift."""

    def size(chart: Any) -> float:
        return -max(abs(chart.sudden).max(), abs(chart.slow).max()) / chart.limit

    charts = sorted(judgement.charts, key=size)
    count = max(MIN_CHARTS, len(judgement.alarms))
    return charts[: min(count, MAX_CHARTS)]


def _clearest_rates(judgement: Judgement) -> list[tuple[str, str, str, float, Rate]]:
    """Robot, parameter, unit, level and rate of wear, the clearest first."""
    found = [
        (robot, wear.parameter, wear.unit, wear.level, rate)
        for wear in judgement.wear
        for robot, rate in wear.robots.items()
        if rate is not None and rate.clear
    ]
    return sorted(found, key=lambda f: (f[4].high - f[4].low) / abs(f[4].value))[:MAX_LISTED]


def _rate(rate: Rate | None, scale: float = 1.0) -> str:
    """A slope with its interval."""
    if rate is None:
        return "–"
    return f"{rate.value * scale:+.3g} ({rate.low * scale:+.3g} to {rate.high * scale:+.3g})"


def _headline(judgement: Judgement) -> str:
    """How many alarms, and whose."""
    count = Counter(alarm.robot for alarm in judgement.alarms)
    if not count:
        return "No alarm: no watched parameter has changed significantly from its baseline."
    robots = [f"{robot} ({number})" for robot, number in count.most_common()]
    more = f" and {len(robots) - MAX_NAMED} more" if len(robots) > MAX_NAMED else ""
    return f"{plural(count.total(), 'alarm')}: {', '.join(robots[:MAX_NAMED])}{more}."


def _alarm_numbers(alarm: Alarm) -> tuple[str, str, str]:
    """Change and ends of its interval, signed, to the second digit of the interval's half."""
    half = 0.5 * (alarm.high - alarm.low)
    values = (with_spread(x, half)[0] for x in (alarm.change, alarm.low, alarm.high))
    change, low, high = (x if x.startswith("-") else f"+{x}" for x in values)
    return change, low, high


def _digits(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else "–"


def _percent(share: float) -> str:
    return f"{100.0 * share:+.3g} %" if math.isfinite(share) else "–"
