"""Text of a stress run: the table on the terminal and the Markdown for a document."""

from __future__ import annotations

from clamp3d.bench.stress.assemblies.family import ASSEMBLIES, COUNTS
from clamp3d.bench.stress.outcome import Outcome
from clamp3d.bench.stress.registry import FAMILIES, METHODS
from clamp3d.bench.stress.run import StressRun


def _length(x: float | None) -> str:
    return "-" if x is None else f"{x:.2g}"


def percent(rate: float) -> str:
    """A share to two digits.

    >>> percent(0.0), percent(0.0312), percent(0.126), percent(1.0)
    ('0', '3.1 %', '13 %', '100 %')
    """
    x = 100.0 * rate
    return "0" if x == 0.0 else f"{x:.0f} %" if x >= 9.95 else f"{x:.2g} %"


def _rate(outcome: Outcome) -> str:
    rate = outcome.failure_rate
    if rate is None:
        return "refused" if outcome.refused else "not asked"
    return f"{percent(rate)} of {outcome.asked - outcome.refused}"


def _errors(outcome: Outcome) -> str:
    if outcome.worst_error is None:
        return "-"
    ratio = "" if outcome.worst_ratio is None else f" ({outcome.worst_ratio:.2g})"
    return f"{_length(outcome.worst_error)} / {_length(outcome.median_error)}{ratio}"


def _each(outcome: Outcome) -> str:
    if not outcome.asked or not outcome.seconds:  # not asked, or it died each time
        return ""
    seconds = outcome.seconds / outcome.asked
    return next(f"{seconds * k:.3g} {unit}" for k, unit in ((1e6, "us"), (1e3, "ms"), (1.0, "s")) if seconds * k < 1e3)


def _trouble(outcome: Outcome) -> str:
    parts = [f"{n} {what}" for n, what in ((outcome.exceptions, "raised"), (outcome.crashes, "crashed")) if n]
    if outcome.late:
        parts.append(f"{outcome.late} late")
    return ", ".join(parts)


def table(run: StressRun) -> str:
    """One line per family and method, fixed width."""
    head = (
        f"{'family':28s} {'method':14s} {'asked':>7s} {'refused':>7s} {'false hit':>9s} {'false miss':>10s} "
        f"{'> bound':>7s} {'worst mm':>9s} {'median':>9s} {'us each':>8s}  failures"
    )
    lines = [head, "-" * len(head)]
    for o in run.outcomes:
        each = 1e6 * o.seconds / o.asked if o.asked else 0.0
        beyond = "-" if o.beyond_bound is None else str(o.beyond_bound)
        lines.append(
            f"{o.family:28s} {o.method:14s} {o.asked:7d} {o.refused:7d} {o.false_hits:9d} {o.false_misses:10d} "
            f"{beyond:>7s} {_length(o.worst_error):>9s} {_length(o.median_error):>9s} {each:8.1f}  {_trouble(o)}"
        )
    lines.append(
        f"seed {run.seed}, {run.n} cases a family; {run.checked_50_digits} truths a family of poses worked out again "
        f"at 50 digits: largest difference {run.worst_truth_difference:.1g} of the scene"
    )
    if any(o.family in ASSEMBLIES for o in run.outcomes):
        lines.append(f"assemblies: {COUNTS}")
    return "\n".join(lines)


def markdown(run: StressRun, command: str) -> str:
    """The matrix of failure rates, what each family is, and the worst case of each method with its reproducer."""
    methods = list(dict.fromkeys(o.method for o in run.outcomes))
    families = list(dict.fromkeys(o.family for o in run.outcomes))
    by = {(o.family, o.method): o for o in run.outcomes}
    lines = [
        f"Made by `{command}`: {run.n} cases a family, seed {run.seed}; {run.checked_50_digits} truths a family of "
        "poses worked out a second time at 50 digits "
        f"(largest difference {run.worst_truth_difference:.1g} of the scene).",
        "",
        f"Machine: {run.machine}.",
        "",
    ]
    for title, cell in (
        (
            "Share of wrong verdicts (false hits, false misses, exceptions, crashes, no answer in time) among the "
            "cases that the method takes on:",
            _rate,
        ),
        ("Largest and median error in mm (largest in parts of the method's own bound):", _errors),
        ("Time a case, set-up of the shapes included:", _each),
    ):
        lines += [title, "", "| family | " + " | ".join(methods) + " |", "|---|" + "---|" * len(methods)]
        for f in families:
            cells = [cell(by[f, m]) if (f, m) in by else "" for m in methods]
            lines.append(f"| {f} | " + " | ".join(cells) + " |")
        lines.append("")
    lines += ["The families:", ""]
    lines += [f"- **{f}**: {FAMILIES[f].about}" for f in families]
    if any(f in ASSEMBLIES for f in families):
        lines += ["", f"Of assemblies: {COUNTS}."]
    findings = [finding(o, run) for o in run.outcomes if o.examples]
    if findings:
        lines += ["", "What was found, one line each, worst case first; the command prints the case as Python:", ""]
        lines += findings
    lines += ["", "The methods:", ""]
    lines += [f"- **{m}**: {METHODS[m]}" for m in methods]
    return "\n".join(lines) + "\n"


def finding(o: Outcome, run: StressRun) -> str:
    """One line: what a method got wrong in a family, and how to see it."""
    first = o.examples[0]
    counts = [
        f"{n} {what}"
        for n, what in (
            (o.false_hits, "false hits"),
            (o.false_misses, "false misses"),
            (o.beyond_bound or 0, "errors beyond its bound"),
            (o.exceptions, "exceptions"),
            (o.crashes, "crashes of the interpreter"),
            (o.late, "without an answer in time"),
        )
        if n
    ]
    answer = "none" if first.answer != first.answer else f"{first.answer:.6g} mm"
    return (
        f"- {o.method}, {o.family}: {', '.join(counts)} of {o.asked - o.refused}; {first.what}: truth "
        f"{first.truth:.6g} mm, answer {answer} "
        f'(`clamp3d stress --family "{o.family}" --n {run.n} --seed {run.seed} --case {first.case}`)'
    )
