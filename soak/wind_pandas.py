"""A second opinion on gusts: `rolling("3s", closed="right")` of pandas, which is no dependency (it takes 150 MB).

`python -m pip install pandas` where `python -m soak.wind --pandas` is to run.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any, Final

from soak.wind_reference import LONG, SHORT, Comparison, Measured

GUST: Final = 3000
LEAST: Final = 3


class RollingGusts:
    """The gusts of one device, by pandas."""

    def __init__(self, measured: Measured) -> None:
        pandas = importlib.import_module("pandas")
        times = [at for at, _, _ in measured.values]
        index = pandas.to_datetime(times, unit="ms")
        self._speeds = pandas.Series([value for _, value, _ in measured.values], index=index)
        window = {"window": "3s", "closed": "right"}
        after_gap = [0.0] * len(times)
        for place, (at, _, hold) in enumerate(measured.values[:-1]):
            after_gap[place + 1] = float(at + hold < times[place + 1])
        gaps = pandas.Series(after_gap, index=index).rolling(**window).apply(_but_the_first, raw=True)
        rolling = self._speeds.rolling(**window)
        means = rolling.mean()
        self._gusts = means[(rolling.count() >= LEAST) & (gaps == 0)]
        self._timestamp: Any = pandas.Timestamp

    def _moment(self, ms: int) -> Any:  # noqa: ANN401 - of pandas
        return self._timestamp(ms, unit="ms")

    def compare_wind(self, made: Comparison, message: Mapping[str, Any]) -> None:
        """Compare gust, lull, greatest value and samples of a message of the topic `wind`."""
        ts = message["ts"]
        begin = ts - SHORT + GUST if message["discontinuity"] else ts - LONG + 1
        gusts = self._gusts[self._moment(begin) : self._moment(ts)]
        speeds = self._speeds[self._moment(ts - LONG + 1) : self._moment(ts)]
        self._compare(made, message, gusts, speeds, suffix="_10m")

    def compare_record(self, made: Comparison, message: Mapping[str, Any]) -> None:
        """Compare the same of a record."""
        window = slice(self._moment(message["from"]), self._moment(message["to"] - 1))
        self._compare(made, message, self._gusts[window], self._speeds[window], suffix="")

    def _compare(self, made: Comparison, message: Mapping[str, Any], gusts: Any, speeds: Any, *, suffix: str) -> None:  # noqa: ANN401 - of pandas
        within = 1e-6
        if "undersampled" not in message or not message["undersampled"]:
            made.near(message, f"gust{suffix}", float(gusts.max()) if len(gusts) else None, within)
            made.near(message, f"lull{suffix}", float(gusts.min()) if len(gusts) else None, within)
        made.near(message, f"max{suffix}", float(speeds.max()) if len(speeds) else None, within)
        made.equal(message, f"samples{suffix}", len(speeds))


def _but_the_first(each: Any) -> float:  # noqa: ANN401 - of numpy
    """Return the sum of an array without its first."""
    return float(each[1:].sum())
