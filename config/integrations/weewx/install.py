"""Installer of the lfs10d extension: `weectl extension install config/integrations/weewx` (weewx 5)."""

from weecfg.extension import ExtensionInstaller


def loader():
    """Return the installer; weewx calls this."""
    return Lfs10dInstaller()


class Lfs10dInstaller(ExtensionInstaller):
    """Adds the driver and its section of weewx.conf."""

    def __init__(self):
        super().__init__(
            version="1.0",
            name="lfs10d",
            description="Wind from lfs10d by MQTT: windSpeed, windGust and windDir.",
            author="The lfs10d developers",
            config={
                "Lfs10d": {
                    "driver": "user.lfs10d",
                    "host": "localhost",
                    "port": "1883",
                    "topic": "lfs10d/line0",
                    "anemometer": "slave-2",
                    "vane": "",
                }
            },
            files=[("bin/user", ["bin/user/lfs10d.py"])],
        )
