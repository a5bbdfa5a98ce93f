"""What a soak tells at its end."""

from __future__ import annotations

from collections.abc import Iterable

from soak.run import Soak


def figures(soak: Soak) -> Iterable[tuple[str, str]]:
    """Return the rows of the report: what, and how much."""
    counts, oracle = soak.ledger.counts, soak.oracle
    yield "disturbances", ", ".join(f"{number} x {what}" for what, number in sorted(soak.steps.items())) or "none"
    yield "samples", f"{counts['samples']}, {counts['good']} good, {counts['bad']} bad, {counts['history']} as history"
    yield "lost", str(counts["lost"])
    yield "wrong", str(counts["wrong"])
    yield "out of order", str(counts["disordered"])
    yield "changed between two sendings", str(counts["changed"])
    yield "unjudged", str(counts["unjudged"])
    yield "duplicates", str(counts["duplicates"])
    yield "declared as dropped", f"{counts['declared']} samples, {counts['dropped events']} events"
    around = "".join(f", {number} around {why}" for why, number in sorted(oracle.excused.items()))
    yield "answers with a value", f"{oracle.heard}, {oracle.told_of} published{around}"
    killed = f"{counts['killed with it']} samples between others, {oracle.excused['SIGKILL']} answers at the end"
    reach = max(soak.ledger.killed_seconds, oracle.reach.get("SIGKILL", 0.0))
    yield "lost with a SIGKILL", f"{killed}, of at most {reach:.1f} s"
    yield "good answers not accepted", f"{oracle.missed}, published as failures or polled again"
    yield "good answers without a sample", str(oracle.untold)
    yield "stale shown as live", str(len(soak.stale))
    for number, gauge in enumerate(soak.daemon.gauges, 1):
        if gauge.points:
            yield (
                f"daemon, life {number}",
                _life(gauge.points[-1].at, gauge.highest, gauge.growth() if gauge.judged else {}),
            )


def _life(seconds: float, highest: dict[str, float], growth: dict[str, float]) -> str:
    names = {"rss": "MB resident", "rss_anon": "MB anonymous", "descriptors": "descriptors", "threads": "threads"}
    return f"{seconds:.0f} s; at most " + ", ".join(
        f"{high:.1f} {names[what]}" + (f" ({growth[what]:+.1f})" if what in growth else "")
        for what, high in highest.items()
    )
