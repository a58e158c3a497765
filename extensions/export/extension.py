"""The declaration of the extension `export`."""

from quadrotor.extension import Command, Evidence, Exporter, Extension, Judged

EXTENSION = Extension(
    name="export",
    summary="Logs as tables for other programs, and as a page that replays them without a server",
    protocol=1,
    offers=(
        Exporter(name="csv", target=".formats:csv_files"),
        Exporter(name="parquet", target=".formats:parquet_files"),
        Exporter(name="mat", target=".formats:MatFile"),
        Command(
            name="log export",
            target=".command:Export",
            summary="Write a log as tables for other programs, times in s and ns, values in SI "
            "units; or as a page that replays it without a server.",
            examples={"quadlab log export LOG --format parquet": "convert a log for pandas"},
        ),
    ),
    judged=(Judged(Evidence.PEER, "pyarrow and GNU Octave read the files"),),
    docs="runs.md",
)
