"""The declaration of the extension `mavlink`."""

from quadrotor.extension import Command, Evidence, Extension, Group, Importer, Judged

EXTENSION = Extension(
    name="mavlink",
    summary="MAVLink 2 for QGroundControl, MAVSDK and other ground stations",
    protocol=1,
    offers=(
        Command(
            name="mavlink",
            group=Group.PROCESS,
            summary="Let QGroundControl, MAVSDK and others fly the vehicle over MAVLink 2.",
            target=".command:Mavlink",
            examples={
                "quadlab mavlink": "fly with QGroundControl or MAVSDK on this computer",
                "quadlab mavlink udpin:127.0.0.1:14550 --viewers": (
                    "listen, and send telemetry only"
                ),
                "quadlab mavlink tcpin:127.0.0.1:5760 --passphrase words.txt": (
                    "fly with signed messages"
                ),
            },
        ),
        Importer(
            name="tlog",
            # Time of arrival, us since 1970, of a clock that is set or began anew; a packet.
            pattern=rb"\0(?:[\x04-\x0f]..|\0\0[\0-\x7f]).{4}[\xfe\xfd]",
            target=".tlog:TlogTables.opened",
        ),
    ),
    judged=(Judged(Evidence.PEER, "MAVSDK 4, pymavlink, telemetry logs of ArduPilot"),),
    libraries={"pymavlink": "`scripts/setup mavlink` or `pip install 'quadlab[mavlink]'`"},
    docs="extending/mavlink.md",
)
