"""The command line: composition of vehicle, station, web and simulator. One file a command."""
