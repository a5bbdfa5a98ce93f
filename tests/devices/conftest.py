"""Lines of other devices than the LFS10, end to end: simulated, polled by the daemon, heard at a real broker.

One recording of each line serves many tests: it is made once, what was heard and what the line knows is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from tests.support.brokers import Mosquitto, path_of
from tests.support.recordings import LINES, Recording, record


@pytest.fixture(name="recordings", scope="session")
def _recordings(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[str], Recording]]:
    """Give the recording of a line by its name; each is made when first asked for."""
    made: dict[str, Recording] = {}
    brokers: list[Mosquitto] = []

    def recording(name: str) -> Recording:
        if name not in made:
            folder = tmp_path_factory.mktemp(name)
            (folder / "mosquitto").mkdir()
            broker = Mosquitto(path_of("mosquitto"), folder / "mosquitto")
            brokers.append(broker)
            broker.start()
            made[name] = record(folder, broker, *LINES[name])
        return made[name]

    yield recording
    for each in made.values():
        each.site.close()
    for broker in brokers:
        broker.close()


@pytest.fixture(params=LINES)
def recording(request: pytest.FixtureRequest, recordings: Callable[[str], Recording]) -> Recording:
    """Give each line in turn."""
    return recordings(request.param)


@pytest.fixture
def rtu(recordings: Callable[[str], Recording]) -> Recording:
    """Give the mixed RTU line of twelve."""
    return recordings("rtu")
