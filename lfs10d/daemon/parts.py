"""The parts of a running daemon, as `build` makes them."""

from __future__ import annotations

from lfs10d.commands.dispatcher import Dispatcher
from lfs10d.commands.line_access import LineAccess
from lfs10d.config.live_config import LiveConfig
from lfs10d.daemon.shutdown import Shutdown
from lfs10d.daemon.signals import Signals
from lfs10d.daemon.storage import Storage
from lfs10d.daemon.supervision import Supervision
from lfs10d.line.line import Line
from lfs10d.mqtt.publisher import Publisher
from lfs10d.mqtt.uplink import Uplink
from lfs10d.reconfiguration.baudrate_watch import BaudrateWatch
from lfs10d.reconfiguration.reconfiguration import Reconfiguration
from lfs10d.system.clock import Clock
from lfs10d.system.dataclass import dataclass
from lfs10d.system.systemd import Notifier


@dataclass(frozen=True, slots=True)
class Parts:
    """Everything that runs, in the order in which it is built."""

    notifier: Notifier
    shutdown: Shutdown
    clock: Clock
    config: LiveConfig
    uplink: Uplink
    publisher: Publisher
    storage: Storage
    line: Line
    reconfiguration: Reconfiguration
    baudrate_watch: BaudrateWatch
    access: LineAccess
    dispatcher: Dispatcher
    signals: Signals
    supervision: Supervision
