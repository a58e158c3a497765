"""The declaration of the extension `importers`."""

from quadrotor.extension import Command, Evidence, Extension, Importer, Judged

EXTENSION = Extension(
    name="importers",
    summary="Flights that other systems recorded, as runs",
    protocol=1,
    offers=(
        Command(
            name="log import",
            summary="Import a flight that another system recorded, as a run, after a check of "
            "units, frames and clocks against gravity and motion (docs/importing.md).",
            target=".command:Import",
            examples={"quadlab log import FLIGHT.ulg": "import a flight that PX4 recorded"},
        ),
        Importer(
            name="hdf5",
            starts=(b"\x89HDF\r\n\x1a\n", b"MATLAB 7.3 MAT-file"),
            target=".readers.tables:Hdf5Table",
        ),
        Importer(name="parquet", starts=(b"PAR1",), target=".readers.parquet:ParquetTable"),
        Importer(name="mat", starts=(b"MATLAB 5.0 MAT-file",), target=".readers.mat:MatTable"),
        Importer(name="npy", starts=(b"\x93NUMPY",), target=".readers.tables:NumpyTable"),
        Importer(name="ulog", starts=(b"ULog\x01\x12\x35",), target=".readers.ulog:UlogTables"),
        Importer(name="crazyflie", starts=(b"\xbc",), target=".readers.crazyflie:CrazyflieTables"),
        Importer(name="mcap", starts=(b"\x89MCAP0\r\n",), target=".readers.mcap_tables:McapTables"),
        Importer(
            name="blackbox",
            starts=(b"H Product:Blackbox flight data recorder by Nicholas Sherlock",),
            target=".readers.blackbox:BlackboxTables",
        ),
        Importer(
            name="dataflash", starts=(b"\xa3\x95",), target=".readers.dataflash:DataFlashTables"
        ),
        Importer(
            name="rosbag",
            starts=(b"#ROSBAG V2", b"SQLite format 3\0"),
            target=".readers.ros_bags:BagTables",
        ),
    ),
    judged=(
        Judged(
            Evidence.PEER,
            "pyulog, rosbags, logs of Betaflight 3 and data sets that docs/importing.md names",
        ),
    ),
    docs="importing.md",
)
