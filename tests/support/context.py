"""What handlers may use, without a daemon behind it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from lfs10d.command import Command, RefusedError, Result, ok, rejected
from lfs10d.commands.context import Context
from lfs10d.commands.reads import ReadResult
from lfs10d.config.changes_file import ChangesFile
from lfs10d.config.effective import Effective
from lfs10d.config.live_config import LiveConfig, News
from lfs10d.config.loader import load
from lfs10d.config.models import SlaveConfig
from lfs10d.config.reload import ReloadPlan
from lfs10d.line.jobs.identification import FoundDevice
from lfs10d.line.jobs.ping import Ping
from lfs10d.line.jobs.register_access import Access, Target
from lfs10d.line.jobs.scan import Scan
from lfs10d.line.jobs.scan_plan import ScanPlan
from lfs10d.modbus.frames import Codec, Framing
from lfs10d.modbus.pending import PendingRequests
from lfs10d.modbus.request import Request as RegisterRequest
from lfs10d.modbus.timing import LineTiming
from lfs10d.profiles.library import load_profile
from lfs10d.profiles.profile import Profile
from lfs10d.reading import Fault
from lfs10d.reconfiguration.adopt_request import AdoptRequest
from lfs10d.system.disk import Disk
from tests.support.volatile_disk import ForgetfulFiles

FILE = """\
line: {port: tty, baudrate: 9600}
poll: {interval: 2s}
slaves:
  - {id: 2, name: mast-top, interval: 1s}
  - 3
"""


STATE = Path("/state")


class FakeContext:
    """Answers as set beforehand and notes what was done. `at` are the slave ids that answer a ping."""

    def __init__(self, file: Path) -> None:
        self.done: list[object] = []
        self.read_result: ReadResult | None = None
        self.paused = False
        self.running: tuple[str, ...] = ()
        self.busy = False
        self.findings: tuple[FoundDevice, ...] = ()
        self.scanned = True, False
        """Whether a scan is complete, and whether its port was lost."""
        self.at: set[int] = set()
        self.silence: Fault | None = None
        self.came: dict[str, object] = {}
        """What came of an access: its attributes."""
        self.told: list[dict[str, object]] = []
        self.disk = ForgetfulFiles()
        self.file = file
        self.start()

    def reserved(self) -> dict[int, str]:
        return {77: "is reserved by the open change of slave-3"}

    async def readdress(self, device: str, to: int, *, dry_run: bool, call: Command) -> Result:
        self.done.append(("readdress", device, to, dry_run, call.id))
        return ok({"device": device})

    async def baudrate(self, to: int, *, power_cycle: bool, dry_run: bool, call: Command) -> Result:
        self.done.append(("baudrate", to, power_cycle, dry_run, call.id))
        return ok({"to": to})

    async def adopt(self, request: AdoptRequest, call: Command) -> Result:
        self.done.append(("adopt", request, call.id))
        return ok({"device": request.name})

    def start(self) -> None:
        """Begin anew, as a daemon does."""
        self.holding = LiveConfig(load(self.file), ChangesFile(STATE, Disk(self.disk)))
        self.holding.start(self)
        fake: Any = self
        self.context = Context(self.holding, fake, fake, fake)

    def report(self, news: News) -> None:
        """Take what became of changes."""

    async def apply(self, plan: ReloadPlan, before: Effective) -> None:
        assert before is not self.holding.now
        self.done.append(plan.applied)

    def health(self) -> dict[str, object]:
        return {"v": 1}

    def republish(self) -> int:
        self.done.append("republish")
        return 17

    def applied(self, request: str, command: Command, **facts: object) -> None:
        self.told.append({"request": request, "id": command.key, **facts})

    async def ping(self, slave: int, profile: Profile) -> Ping:
        self.done.append(f"ping {slave}")
        ping = Ping(slave, profile, Codec(Framing.RTU), lambda _: None)
        ping.answered = slave in self.at
        ping.fault = None if ping.answered else self.silence
        return ping

    async def access(self, request: RegisterRequest, device: SlaveConfig | None) -> Access:
        self.done.append((device and device.name, request))
        never = PendingRequests()
        access = Access(Target(1, Codec(Framing.RTU)), request, pending=never, echo_known=bool, over=lambda _: None)
        for name, what_came in self.came.items():
            setattr(access, name, what_came)
        return access

    async def read(self, device: str) -> ReadResult | None:
        self.done.append(f"read {device}")
        return self.read_result

    def trace(self, duration: float) -> None:
        self.done.append(duration)

    async def scan(self, ids: tuple[int, ...], rates: tuple[int, ...], share: float) -> Scan:
        self._begin()
        self.done.append((ids, rates, share))
        timings = tuple(LineTiming.of(rate) for rate in rates or (9600, 19200))
        scan = Scan(ScanPlan(ids, timings, Codec(Framing.RTU), (load_profile("lfs10", relative_to=self.file),)))
        scan.complete, scan.lost = self.scanned
        scan._found = {(each.slave, each.baudrate): each for each in self.findings}
        return scan

    async def pause(self, duration: float) -> None:
        self._begin()
        self.done.append(duration)

    def _begin(self) -> None:
        if self.busy:
            raise RefusedError(rejected("busy", "device/readdress is being carried out"))

    def cancel(self) -> tuple[str, ...]:
        running, self.running = self.running, ()
        return running


class Ask(Protocol):
    """Asks a request by its name with the payload as JSON text, and returns its answer."""

    def __call__(self, name: str, payload: str = "{}") -> Result:
        """Return the answer of admission, or of the request itself."""


class Asked(Protocol):
    """Asks a request with parameters, and returns status, error code and param, and data."""

    def __call__(self, name: str, /, **parameters: Any) -> tuple[str, Any]:  # noqa: ANN401 - plain data of any shape
        """Return `("ok", data)`, or the status and `(code, param)`."""
